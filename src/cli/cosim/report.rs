//! The report of a co-simulation, in words and for machines.

use crate::cosim::Report;
use serde_json::{Value, json};

/// As JSON.
pub fn to_json(report: &Report) -> Value {
    let steps = &report.steps;
    let slaves: Vec<Value> = (report.slaves.iter())
        .map(|slave| {
            let calls = &slave.calls;
            json!({
                "name": slave.name,
                "seconds": slave.seconds,
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
            "shortest": steps.shortest,
            "longest": steps.longest,
        },
        "slaves": slaves,
        "connections": connections,
        "irrevocable": report.irrevocable,
        "masterSeconds": report.master_seconds,
    })
}

/// In words: what is to be warned of and, if `is_long`, all.
pub fn to_text(report: &Report, is_long: bool) -> String {
    let steps = &report.steps;
    let mut text = String::new();
    for name in &report.irrevocable {
        let errors = errors_of(report, name);
        text += &format!(
            "warning: `{name}` cannot go back to a saved state: its inputs are extrapolated, and no \
             step is repeated{errors}\n"
        );
    }
    if steps.unconverged > 0 {
        let n = steps.unconverged;
        text += &format!(
            "warning: in {n} of {} steps the corrections did not converge; try a shorter --step\n",
            steps.accepted
        );
    }
    if steps.over_tolerance > 0 {
        let n = steps.over_tolerance;
        text += &format!("warning: the error of {n} steps is larger than the tolerance\n");
    }
    if is_long {
        text += &details(report);
    }
    text
}

/// The errors of an instance's inputs, if measured.
fn errors_of(report: &Report, name: &str) -> String {
    let is_own = |to: &str| {
        to.strip_prefix(name)
            .is_some_and(|rest| rest.starts_with('.'))
    };
    let own = report.connections.iter().filter(|c| is_own(&c.to));
    let errors: Vec<String> = own
        .filter_map(|c| Some(format!("`{}` by {:.3e} {}", c.to, c.error?.mean, c.unit)))
        .map(|text| text.trim_end().to_owned())
        .collect();
    match errors.is_empty() {
        true => "; --report tells the error that this causes".to_owned(),
        false => format!("; wrong in the mean are {}", errors.join(", ")),
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
        text += &format!("{} -> {}: {}, lag {:.6} s", c.from, c.to, c.transfer, c.lag);
        if let Some(error) = c.error {
            let unit = if c.unit.is_empty() { "" } else { " " };
            let unit = format!("{unit}{}", c.unit);
            text += &format!(
                ", error {:.3e}{unit} (largest {:.3e})",
                error.mean, error.max
            );
        }
        text.push('\n');
    }
    for slave in &report.slaves {
        let calls = &slave.calls;
        text += &format!(
            "{}: {} set, {} step, {} get, {} save, {} restore",
            slave.name, calls.sets, calls.steps, calls.gets, calls.saves, calls.restores
        );
        if let Some(seconds) = slave.seconds {
            text += &format!(", {seconds:.6} s");
        }
        text.push('\n');
    }
    if let Some(seconds) = report.master_seconds {
        text += &format!("master and recorder: {seconds:.6} s\n");
    }
    text
}
