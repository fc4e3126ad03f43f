//! The results of a fit as HTML tables.

use super::html::{escape, table};
use super::number;
use crate::flights::trials::Summary;
use crate::identification::pilot_file::units;
use crate::identification::result::StartReport;
use crate::identification::{
    Fit, FitOptions, Identification, InitialState, Mesh, Objective, RunFit,
};
use crate::models::{COEFFICIENTS, Pilot};
use crate::vehicle::Mode;
use pilotage_inference::statistics::rms;
use pilotage_text::number::{short, significant};

/// The coefficient of the pilot's transfer function for each component of θ.
fn meanings(pilot: Pilot) -> impl Iterator<Item = String> {
    let term = |i: usize| match i {
        0 => "1".to_owned(),
        1 => "<i>s</i>".to_owned(),
        _ => format!("<i>s</i><sup>{i}</sup>"),
    };
    let part = move |part: &'static str| {
        (0..pilot.order).map(move |i| format!("{part}, coefficient of {}", term(i)))
    };
    part("denominator").chain(part("numerator"))
}

/// Text for a cell: escaped, with a true minus sign.
fn cell(text: impl AsRef<str>) -> String {
    escape(text.as_ref()).replace('-', "\u{2212}")
}

pub fn theta(fit: &Fit, pilot: Pilot) -> String {
    let names = units(pilot).into_iter().zip(meanings(pilot));
    let rows: Vec<_> = (fit.theta.iter().zip(names).enumerate())
        .map(|(i, (value, (unit, meaning)))| {
            let mut row = vec![format!("θ{}", i + 1), number::html(*value, 5)];
            row.extend(sureness(fit, i));
            row.extend([unit, meaning]);
            row
        })
        .collect();
    let header = [
        "θ",
        "value",
        "sd",
        "95 % low",
        "95 % high",
        "Cramér–Rao [%]",
        "insensitivity [%]",
        "unit",
        "in the transfer function",
    ];
    table(&header, &[1, 2, 3, 4, 5, 6], &rows) + &method_notes(fit)
}

/// Standard deviation, interval, Cramér–Rao bound and insensitivity of a component of θ.
fn sureness(fit: &Fit, component: usize) -> [String; 5] {
    let Some(own) = &fit.uncertainty else {
        return std::array::from_fn(|_| "–".to_owned());
    };
    let of = own.intervals[component];
    let percents = [own.cramer_rao[component], own.insensitivity[component]];
    let cell = |value: f64, digits| match value.is_finite() {
        true => number::html(value, digits),
        false => "–".to_owned(),
    };
    [
        cell(of.sd, 3),
        cell(of.low, 4),
        cell(of.high, 4),
        cell(percents[0], 3),
        cell(percents[1], 3),
    ]
}

/// The method of the intervals, and notes on it.
fn method_notes(fit: &Fit) -> String {
    let Some(own) = &fit.uncertainty else {
        return String::new();
    };
    let notes = own
        .notes()
        .into_iter()
        .map(|note| format!("; {}", escape(&note)));
    let notes: String = notes.collect();
    format!(
        "<p>Intervals by the method {}{notes}.</p>",
        own.spread.method
    )
}

/// Active constraints of the solution: limits of the stick, stability conditions.
pub fn active(found: &Identification) -> String {
    const ON: f64 = 1e-6;
    let limit = found.options.stick_limit;
    let on_limit = |stick: &&f64| stick.abs() >= limit * (1.0 - ON);
    let of_run = |run: &RunFit| {
        let count = run.stick.iter().filter(on_limit).count();
        let share = format!("{count} of {} samples", run.stick.len());
        (count > 0).then(|| vec![format!("|stick| ≤ {limit}"), escape(&run.name), share])
    };
    let mut rows: Vec<_> = found.fit.runs.iter().filter_map(of_run).collect();
    let pole = found
        .fit
        .closed_loop
        .as_ref()
        .and_then(|own| own.on_bound());
    rows.extend(pole.map(|pole| {
        let pole = format!("pole at {} 1/s", number::html(pole.re, 3));
        vec!["stability of the closed loop".into(), "all".into(), pole]
    }));
    match rows.is_empty() {
        true => "<p>None.</p>\n".into(),
        false => table(&["constraint", "run", "where"], &[], &rows),
    }
}

pub fn poles(fit: &Fit, pilot: Pilot) -> String {
    modes(&Mode::of_poles(&pilot.poles(&fit.theta)))
}

pub fn closed_loop(fit: &Fit) -> String {
    match &fit.closed_loop {
        Some(closed_loop) => modes(&Mode::of_poles(&closed_loop.poles)),
        None => "<p>Not known: the fit was given no vehicle.</p>".into(),
    }
}

/// The figures of the closed loop except its poles, with their intervals.
pub fn derived(found: &Identification) -> String {
    let all = found.derived.iter();
    let all = all.filter(|(figure, _)| !figure.name.starts_with("pole"));
    let rows: Vec<_> = all
        .map(|(figure, own)| {
            let cell = |value: f64, digits| match value.is_finite() {
                true => number::html(value, digits),
                false => "–".to_owned(),
            };
            vec![
                figure.name.replace('_', " "),
                cell(figure.value, 4),
                cell(own.sd, 3),
                cell(own.low, 4),
                cell(own.high, 4),
                figure.unit.to_owned(),
            ]
        })
        .collect();
    let header = ["", "value", "sd", "95 % low", "95 % high", "unit"];
    match rows.is_empty() {
        true => "<p>Not known.</p>".into(),
        false => table(&header, &[1, 2, 3, 4], &rows),
    }
}

/// Poles, or conjugate pairs of poles.
pub fn modes(modes: &[Mode]) -> String {
    let rows: Vec<_> = (modes.iter())
        .map(|mode| {
            let (re, im) = (number::html(mode.pole.re, 4), number::html(mode.pole.im, 4));
            let pole = match mode.pole.im == 0.0 {
                true => re,
                false => format!("{re} ± {im} i"),
            };
            let time = match mode.pole.re < 0.0 {
                true => number::html(-1.0 / mode.pole.re, 4),
                false if mode.pole.re == 0.0 => "–".into(),
                false => "unstable".into(),
            };
            let frequency = number::html(mode.frequency, 4);
            vec![pole, frequency, number::html(mode.damping, 3), time]
        })
        .collect();
    let header = [
        "pole [1/s]",
        "frequency [rad/s]",
        "damping",
        "time constant [s]",
    ];
    table(&header, &[0, 1, 2, 3], &rows)
}

/// The target of a run \[m\], or its range if it moves.
pub fn target_of(summary: &Summary) -> String {
    let [least, greatest] = summary.target_range.map(|target| short(target, 4));
    match summary.target_range[0] == summary.target_range[1] {
        true => least,
        false => format!("{least} to {greatest}"),
    }
}

pub fn runs(found: &Identification) -> String {
    let unit = found.options.objective.unit();
    let rows: Vec<_> = (found.outcomes())
        .filter_map(|outcome| {
            let (run, trial, flown) = (outcome.solution?, outcome.trial, outcome.alone);
            let summary = trial.summary();
            let finite = run.residual.iter().filter(|r| r.is_finite());
            let largest = finite.fold(0.0, |largest: f64, r| largest.max(r.abs()));
            let peak = summary.peak_stick;
            Some(vec![
                escape(&run.name),
                cell(target_of(&summary)),
                (summary.samples - summary.missing).to_string(),
                short(trial.weight, 4),
                number::html(summary.final_error, 3),
                (summary.overshoot).map_or("–".into(), |part| format!("{:.1}", 100.0 * part)),
                peak.map_or("–".into(), |peak| format!("{peak:.3}")),
                number::html(rms(&run.residual), 3),
                number::html(largest, 3),
                flown.map_or("–".into(), |flown| number::html(rms(&flown.residual), 3)),
            ])
        })
        .collect();
    let (rms, largest) = (
        format!("rms residual [{unit}]"),
        format!("largest residual [{unit}]"),
    );
    let header = [
        "run",
        "target [m]",
        "samples",
        "weight",
        "final error [m]",
        "overshoot [%]",
        "peak stick",
        &rms,
        &largest,
        "flown alone from rest, rms [m]",
    ];
    table(&header, &[1, 2, 3, 4, 5, 6, 7, 8, 9], &rows)
}

pub fn solve(fit: &Fit, options: &FitOptions) -> String {
    let unit = match options.objective {
        Objective::Response => " m²",
        Objective::Stick => "",
    };
    let start = match &options.start {
        None => "estimated from the data".into(),
        Some(start) => start
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(", "),
    };
    let rows = [
        ("status", escape(fit.status.as_str())),
        (
            "sum of squared residuals",
            number::html(fit.objective, 6) + unit,
        ),
        (
            "scaled KKT residual",
            format!("{:.2e} (tolerance {:e})", fit.kkt, options.tolerance),
        ),
        (
            "iterations",
            format!("{} (limit {})", fit.iterations, options.max_iterations),
        ),
        ("unknowns", fit.unknowns.to_string()),
        ("starts, best first", starts(fit)),
        ("wall time", format!("{} s", significant(fit.seconds, 3))),
        ("collocation", scheme(options)),
        ("mesh", mesh(options.mesh)),
        ("objective", objective(options.objective).into()),
        (
            "initial states",
            initial_state(options.initial_state).into(),
        ),
        (
            "position at the start",
            options.initial_position.as_str().into(),
        ),
        (
            "closed loop",
            match options.stable_loop && options.objective == Objective::Response {
                true => "kept stable".into(),
                false => "as it came out".into(),
            },
        ),
        ("start of θ", start),
        ("pilot", format!("linear, order {}", options.pilot.order)),
        ("stick limit", format!("{}", options.stick_limit)),
    ];
    let rows: Vec<_> = rows
        .into_iter()
        .map(|(what, value)| vec![what.into(), value])
        .collect();
    table(&["", ""], &[], &rows)
}

/// The result of each start, one line each.
fn starts(fit: &Fit) -> String {
    let line = |start: &StartReport| {
        format!(
            "{} after {} iterations: {}",
            escape(start.status.as_str()),
            start.iterations,
            number::html(start.objective, 6)
        )
    };
    fit.starts.iter().map(line).collect::<Vec<_>>().join("<br>")
}

pub fn vehicle(options: &FitOptions) -> String {
    let rows: Vec<_> = (COEFFICIENTS.iter())
        .map(|field| {
            vec![
                format!("<code>{}</code>", field.name),
                number::chosen((field.get)(&options.vehicle), 6),
                escape(&pilotage_units::pretty(field.unit)),
                escape(field.meaning),
            ]
        })
        .collect();
    table(&["vehicle", "value", "unit", "meaning"], &[1], &rows)
}

/// Names of files with their SHA-256.
pub fn files<'a>(files: impl Iterator<Item = (&'a str, &'a str)>) -> String {
    let rows: Vec<_> = files
        .map(|(name, sha256)| vec![escape(name), format!("<code>{sha256}</code>")])
        .collect();
    table(&["file", "SHA-256"], &[], &rows)
}

fn mesh(mesh: Mesh) -> String {
    match mesh {
        Mesh::Samples => "the samples".into(),
        Mesh::Step(step) => format!("intervals of about {step} s"),
    }
}

fn scheme(options: &FitOptions) -> String {
    let (name, order) = (options.scheme.name(), options.scheme.order());
    let paper = if name == "euler" { ", the paper's" } else { "" };
    format!("{name} (order {order}{paper})")
}

fn objective(objective: Objective) -> &'static str {
    match objective {
        Objective::Response => "the vehicle's response (the paper's)",
        Objective::Stick => "the stick, driven by the recorded error",
    }
}

fn initial_state(initial_state: InitialState) -> &'static str {
    match initial_state {
        InitialState::Free => "all free (the paper's)",
        InitialState::VehicleAtRest => "vehicle hovers, pilot free",
        InitialState::AtRest => "vehicle hovers, pilot at zero",
    }
}
