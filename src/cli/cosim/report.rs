//! The report of a co-simulation as text and as JSON.

use crate::cli::terminal;
use crate::cosim::{ConnectionReport, Divergence, Report};
use pilotage_text::counted;
use pilotage_text::number::short;
use serde_json::{Value, json};

/// The report as JSON.
pub fn to_json(report: &Report) -> Value {
    let steps = &report.steps;
    let instances: Vec<Value> = (report.instances.iter())
        .map(|instance| {
            let calls = &instance.calls;
            json!({
                "name": instance.name,
                "seconds": instance.seconds,
                "calls": {
                    "set": calls.sets,
                    "step": calls.steps,
                    "get": calls.gets,
                    "save": calls.saves,
                    "restore": calls.restores,
                },
            })
        })
        .collect();
    let connections: Vec<Value> = (report.connections.iter())
        .map(|connection| {
            json!({
                "from": connection.from,
                "to": connection.to,
                "unit": connection.unit,
                "transfer": connection.transfer.to_string(),
                "lag": connection.lag,
                "error": connection.error.map(|e| json!({ "mean": e.mean, "max": e.max })),
                "divergence": connection.divergence.map(|d| d.to_string()),
            })
        })
        .collect();
    json!({
        "steps": {
            "accepted": steps.accepted,
            "rejected": steps.rejected,
            "overTolerance": steps.over_tolerance,
            "corrections": steps.corrections,
            "matrices": steps.matrices,
            "unconverged": steps.unconverged,
            "repeated": steps.repeated,
            "unsettled": steps.unsettled,
            "jumps": steps.jumps,
            "ramps": steps.ramps,
            "shortest": steps.shortest,
            "longest": steps.longest,
        },
        // The instances; the key is kept for existing scripts.
        "slaves": instances,
        "connections": connections,
        "irrevocable": report.irrevocable,
        "fixed": report.fixed,
        "holding": report.holding,
        "masterSeconds": report.master_seconds,
        "timedSteps": report.timed_steps,
    })
}

/// The report as text: warnings and notes, then a few lines or, if `is_long`, all details.
pub fn to_text(report: &Report, is_long: bool) -> String {
    let warnings = warnings(report).into_iter();
    let warnings = warnings.map(|words| terminal::labelled("warning", &words));
    let notes = notes(report).into_iter();
    let notes = notes.map(|words| terminal::labelled("note", &words));
    warnings.chain(notes).collect::<String>()
        + &match is_long {
            true => details(report),
            false => brief(report),
        }
}

/// Warnings for the user.
pub fn warnings(report: &Report) -> Vec<String> {
    let steps = &report.steps;
    let irrevocable = (report.irrevocable.iter()).map(|name| {
        let errors = errors_of(report, name);
        format!(
            "`{name}` cannot go back to a saved state: its inputs are extrapolated, and no step is \
             repeated{errors}"
        )
    });
    let (accepted, fixed) = (steps.accepted, report.fixed.join("`, `"));
    let counted: [(u64, &dyn Fn(u64) -> String); 4] = [
        (steps.unconverged, &|n| {
            format!(
                "in {n} of {accepted} steps the corrections did not converge; try a shorter --step"
            )
        }),
        (steps.over_tolerance, &|n| {
            format!(
                "the error of {} is larger than the tolerance",
                counted(n as usize, "step")
            )
        }),
        (steps.unsettled, &|n| {
            format!(
                "in {n} of {accepted} steps integers, booleans, enumerations or texts did not settle: they \
                 are passed on a step late"
            )
        }),
        (steps.ramps, &|n| {
            format!(
                "{n} jumps of the inputs became ramps over a step: `{fixed}` cannot take steps of different \
                 lengths"
            )
        }),
    ];
    let counted = counted.into_iter().filter(|(n, _)| *n > 0);
    (irrevocable.chain(counted.map(|(n, words)| words(n))))
        .chain(divergences(report))
        .collect()
}

/// Notes for the user.
pub fn notes(report: &Report) -> Vec<String> {
    let note = |name: &String| {
        format!(
            "`{name}` cannot let its inputs change within a step (no input derivatives, no intermediate \
             updates): it holds their means; --parts {name}=N makes that finer"
        )
    };
    report.holding.iter().map(note).collect()
}

/// Connections with diverging signals, alternating ones first.
fn divergences(report: &Report) -> Option<String> {
    let mut lines: Vec<String> = (report.connections.iter())
        .filter_map(|c| {
            let why = match c.divergence? {
                Divergence::Alternating => {
                    "swings further from step to step: its coupling diverges"
                }
                Divergence::Growing => {
                    "grows without end: its coupling diverges, or the system is unstable"
                }
            };
            Some(format!("`{}` -> `{}` {why}", c.from, c.to))
        })
        .collect();
    lines.sort_by_key(|line| !line.contains("swings"));
    let (first, rest) = lines.split_first()?;
    let more = match rest.len() {
        0 => String::new(),
        n => format!("; so do {n} more connections"),
    };
    Some(format!(
        "{first}{more}; try --algorithm strong, a lower --extrapolation or a shorter --step"
    ))
}

/// Maximum number of connections, and of instances, in a short report.
const NAMED: usize = 6;

/// A few lines: steps, times and calls, the lag of the connections and the resulting errors of their signals.
fn brief(report: &Report) -> String {
    let steps = &report.steps;
    let in_instances: f64 = report
        .instances
        .iter()
        .map(|instance| instance.seconds)
        .sum();
    let all = in_instances + report.master_seconds;
    let part = |seconds: f64| 100.0 * seconds / all.max(f64::MIN_POSITIVE);
    let mut text = format!(
        "{} communication steps taken, {} rejected, in {}, {:.0} % of it in the master and for the result\n",
        steps.accepted,
        steps.rejected,
        match all {
            all if all < 1.0 => format!("{:.2} ms", 1e3 * all),
            all => format!("{all:.2} s"),
        },
        part(report.master_seconds)
    );
    let mut instances: Vec<_> = report.instances.iter().collect();
    instances.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
    for instance in instances.iter().take(NAMED) {
        let calls = &instance.calls;
        let others = calls.sets + calls.gets + calls.saves + calls.restores;
        text += &format!(
            "  {}: {}, {}, {:.0} % of the time\n",
            instance.name,
            counted(calls.steps as usize, "step"),
            counted(others as usize, "other call"),
            part(instance.seconds)
        );
    }
    let mean = |c: &ConnectionReport| c.error.map_or(0.0, |error| error.mean);
    let mut connections: Vec<_> = report.connections.iter().collect();
    connections.sort_by(|a, b| mean(b).total_cmp(&mean(a)));
    for c in connections.iter().take(NAMED) {
        let late = match c.lag {
            lag if lag > 0.0 => format!("{lag:.6} s late"),
            lag if lag < 0.0 => format!("{:.6} s early", -lag),
            _ => "no lag".to_owned(),
        };
        let [from, to] = [&c.from, &c.to].map(|name| terminal::line(name));
        text += &format!("  {from} -> {to}: {}, {late}", c.transfer);
        if let Some(error) = c.error {
            text += &format!(
                ", off by {}{} in the mean of a step",
                short(error.mean, 2),
                unit(c)
            );
        }
        text.push('\n');
    }
    let unnamed = |all: usize| all.saturating_sub(NAMED);
    let rest = unnamed(report.instances.len()) + unnamed(report.connections.len());
    if rest > 0 {
        text += "  the others by --details\n";
    }
    text
}

/// The errors of an instance's inputs, if it has taken a step.
fn errors_of(report: &Report, name: &str) -> String {
    let is_own = |to: &str| {
        to.strip_prefix(name)
            .is_some_and(|rest| rest.starts_with('.'))
    };
    let own = report.connections.iter().filter(|c| is_own(&c.to));
    let errors: Vec<String> = own
        .filter_map(|c| {
            Some(format!(
                "`{}` by {}{}",
                c.to,
                short(c.error?.mean, 4),
                unit(c)
            ))
        })
        .collect();
    match errors.is_empty() {
        true => String::new(),
        false => format!("; wrong in the mean are {}", errors.join(", ")),
    }
}

/// The unit to append to a value of the connection's output.
fn unit(connection: &ConnectionReport) -> String {
    match connection.unit.as_str() {
        "" | "1" => String::new(),
        unit => format!(" {unit}"),
    }
}

fn details(report: &Report) -> String {
    let steps = &report.steps;
    let mut text = format!(
        "{} communication steps of {:.6} to {:.6} s, {} rejected, {} corrections, {} matrices\n",
        steps.accepted,
        steps.shortest,
        steps.longest,
        steps.rejected,
        steps.corrections,
        steps.matrices
    );
    for c in &report.connections {
        let [from, to] = [&c.from, &c.to].map(|name| terminal::line(name));
        text += &format!("{from} -> {to}: {}, lag {:.6} s", c.transfer, c.lag);
        if let Some(error) = c.error {
            text += &format!(
                ", error {}{} (largest {})",
                short(error.mean, 4),
                unit(c),
                short(error.max, 4)
            );
        }
        text.push('\n');
    }
    for instance in &report.instances {
        let calls = &instance.calls;
        text += &format!(
            "{}: {} set, {} step, {} get, {} save, {} restore",
            instance.name, calls.sets, calls.steps, calls.gets, calls.saves, calls.restores
        );
        text += &format!(", {:.6} s\n", instance.seconds);
    }
    text += &format!("master and recorder: {:.6} s\n", report.master_seconds);
    text
}
