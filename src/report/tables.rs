//! The results of a fit as HTML tables.

use super::html::{Html, html, paragraph, table};
use super::number;
use super::overlay::{self, Parameters};
use crate::flights::trials::Summary;
use crate::identification::closed_loop::on_bound;
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
fn meanings(pilot: Pilot) -> impl Iterator<Item = Html> {
    let part = move |part: &'static str| {
        (0..pilot.order).map(move |i| html! { (part) ", coefficient of " (power(i)) })
    };
    part("denominator").chain(part("numerator"))
}

/// A power of s.
pub fn power(exponent: usize) -> Html {
    match exponent {
        0 => html! { "1" },
        1 => html! { i { "s" } },
        _ => html! { i { "s" } sup { (exponent) } },
    }
}

/// A cell of text.
fn cell(text: impl AsRef<str>) -> Html {
    html! { (text.as_ref()) }
}

/// A number, if there is one.
fn finite(value: f64, digits: usize) -> Html {
    match value.is_finite() {
        true => number::html(value, digits),
        false => cell("–"),
    }
}

pub fn theta(fit: &Fit, pilot: Pilot) -> Html {
    let names = units(pilot).into_iter().zip(meanings(pilot));
    let rows: Vec<_> = (fit.theta.iter().zip(names).enumerate())
        .map(|(i, (value, (unit, meaning)))| {
            let mut row = vec![html! { "θ" (i + 1) }, number::html(*value, 5)];
            row.extend(sureness(fit, i));
            row.extend([cell(unit), meaning]);
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
    html! { (table(&header, &[1, 2, 3, 4, 5, 6], &rows)) (method_notes(fit)) }
}

/// Standard deviation, interval, Cramér–Rao bound and insensitivity of a component of θ.
fn sureness(fit: &Fit, component: usize) -> [Html; 5] {
    let Some(own) = &fit.uncertainty else {
        return std::array::from_fn(|_| cell("–"));
    };
    let of = own.intervals[component];
    [
        finite(of.sd, 3),
        finite(of.low, 4),
        finite(of.high, 4),
        finite(own.cramer_rao[component], 3),
        finite(own.insensitivity[component], 3),
    ]
}

/// The method of the intervals, and notes on it.
fn method_notes(fit: &Fit) -> Html {
    let Some(own) = &fit.uncertainty else {
        return html! {};
    };
    let mut words = vec![format!("Intervals by the method {}", own.spread.method)];
    words.extend(own.notes());
    paragraph(None, &(words.join("; ") + "."))
}

/// Active constraints of the solution: limits of the stick, stability conditions.
pub fn active(found: &Identification) -> Html {
    const ON: f64 = 1e-6;
    let limit = found.options.stick_limit;
    let on_limit = |stick: &&f64| stick.abs() >= limit * (1.0 - ON);
    let of_run = |run: &RunFit| {
        let count = run.stick.iter().filter(on_limit).count();
        let share = format!("{count} of {} samples", run.stick.len());
        (count > 0).then(|| vec![html! { "|stick| ≤ " (limit) }, cell(&run.name), cell(share)])
    };
    let mut rows: Vec<_> = found.fit.runs.iter().filter_map(of_run).collect();
    let pole = found.fit.closed_loop.as_ref().and_then(on_bound);
    rows.extend(pole.map(|pole| {
        let pole = html! { "pole at " (number::html(pole.re, 3)) " 1/s" };
        vec![cell("stability of the closed loop"), cell("all"), pole]
    }));
    match rows.is_empty() {
        true => paragraph(None, "None."),
        false => table(&["constraint", "run", "where"], &[], &rows),
    }
}

pub fn poles(fit: &Fit, pilot: Pilot) -> Html {
    overlay::table(&modes(&Mode::of_poles(&pilot.poles(&fit.theta))))
}

pub fn closed_loop(fit: &Fit) -> Html {
    match &fit.closed_loop {
        Some(closed_loop) => overlay::table(&modes(&Mode::of_poles(&closed_loop.poles))),
        None => paragraph(None, "Not known: the fit was given no vehicle."),
    }
}

/// The figures of the closed loop except its poles, with their intervals.
pub fn derived(found: &Identification) -> Html {
    let all = found.derived.iter();
    let all = all.filter(|(figure, _)| !figure.name.starts_with("pole"));
    let rows: Vec<_> = all
        .map(|(figure, own)| {
            vec![
                cell(figure.name.replace('_', " ")),
                finite(figure.value, 4),
                finite(own.sd, 3),
                finite(own.low, 4),
                finite(own.high, 4),
                cell(figure.unit),
            ]
        })
        .collect();
    let header = ["", "value", "sd", "95 % low", "95 % high", "unit"];
    match rows.is_empty() {
        true => paragraph(None, "Not known."),
        false => table(&header, &[1, 2, 3, 4], &rows),
    }
}

/// Poles, or conjugate pairs of poles.
pub fn modes(modes: &[Mode]) -> Parameters {
    let row = |mode: &Mode| {
        let imaginary = match mode.pole.im == 0.0 {
            true => String::new(),
            false => significant(mode.pole.im, 4),
        };
        let time = match mode.pole.re < 0.0 {
            true => significant(-1.0 / mode.pole.re, 4),
            false if mode.pole.re == 0.0 => "–".into(),
            false => "unstable".into(),
        };
        vec![
            significant(mode.pole.re, 4),
            imaginary,
            significant(mode.frequency, 4),
            significant(mode.damping, 3),
            time,
        ]
    };
    Parameters {
        header: vec![
            "pole [1/s]",
            "± i [1/s]",
            "frequency [rad/s]",
            "damping",
            "time constant [s]",
        ],
        numeric: vec![0, 1, 2, 3, 4],
        rows: modes.iter().map(row).collect(),
        notes: Vec::new(),
    }
}

/// The target of a run \[m\], or its range if it moves.
pub fn target_of(summary: &Summary) -> String {
    let [least, greatest] = summary.target_range.map(|target| short(target, 4));
    match summary.target_range[0] == summary.target_range[1] {
        true => least,
        false => format!("{least} to {greatest}"),
    }
}

pub fn runs(found: &Identification) -> Html {
    let unit = found.options.objective.unit();
    let rows: Vec<_> = (found.outcomes())
        .filter_map(|outcome| {
            let (run, trial, flown) = (outcome.solution?, outcome.trial, outcome.alone);
            let summary = trial.summary();
            let finite = run.residual.iter().filter(|r| r.is_finite());
            let largest = finite.fold(0.0, |largest: f64, r| largest.max(r.abs()));
            let peak = summary.peak_stick;
            Some(vec![
                cell(&run.name),
                cell(target_of(&summary).replace('-', "\u{2212}")),
                html! { (summary.samples - summary.missing) },
                cell(short(trial.weight, 4)),
                number::html(summary.final_error, 3),
                cell((summary.overshoot).map_or("–".into(), |part| format!("{:.1}", 100.0 * part))),
                cell(peak.map_or("–".into(), |peak| format!("{peak:.3}"))),
                number::html(rms(&run.residual), 3),
                number::html(largest, 3),
                flown.map_or(cell("–"), |flown| number::html(rms(&flown.residual), 3)),
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

pub fn solve(fit: &Fit, options: &FitOptions) -> Html {
    let unit = match options.objective {
        Objective::Response => " m²",
        Objective::Stick => "",
    };
    let start = match &options.start {
        None => "estimated from the data".to_owned(),
        Some(start) => start
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(", "),
    };
    let rows = [
        ("status", cell(fit.status.as_str())),
        (
            "sum of squared residuals",
            html! { (number::html(fit.objective, 6)) (unit) },
        ),
        (
            "scaled KKT residual",
            cell(format!(
                "{:.2e} (tolerance {:e})",
                fit.kkt, options.tolerance
            )),
        ),
        (
            "iterations",
            html! { (fit.iterations) " (limit " (options.max_iterations) ")" },
        ),
        ("unknowns", html! { (fit.unknowns) }),
        ("starts, best first", starts(fit)),
        ("wall time", html! { (significant(fit.seconds, 3)) " s" }),
        ("collocation", cell(scheme(options))),
        ("mesh", cell(mesh(options.mesh))),
        ("objective", cell(objective(options.objective))),
        ("initial states", cell(initial_state(options.initial_state))),
        (
            "position at the start",
            cell(options.initial_position.as_str()),
        ),
        (
            "closed loop",
            match options.stable_loop && options.objective == Objective::Response {
                true => cell("kept stable"),
                false => cell("as it came out"),
            },
        ),
        ("start of θ", cell(start)),
        ("pilot", html! { "linear, order " (options.pilot.order) }),
        ("stick limit", html! { (options.stick_limit) }),
    ];
    let rows: Vec<_> = rows
        .into_iter()
        .map(|(what, value)| vec![cell(what), value])
        .collect();
    table(&["", ""], &[], &rows)
}

/// The result of each start, one line each.
fn starts(fit: &Fit) -> Html {
    let line = |start: &StartReport| {
        html! {
            (start.status.as_str()) " after " (start.iterations) " iterations: " (number::html(start.objective, 6))
        }
    };
    html! {
        @for (k, start) in fit.starts.iter().enumerate() {
            @if k > 0 { br; }
            (line(start))
        }
    }
}

pub fn vehicle(options: &FitOptions) -> Html {
    let rows: Vec<_> = (COEFFICIENTS.iter())
        .map(|field| {
            vec![
                html! { code { (field.name) } },
                number::chosen((field.get)(&options.vehicle), 6),
                cell(pilotage_units::pretty(field.unit)),
                cell(field.meaning),
            ]
        })
        .collect();
    table(&["vehicle", "value", "unit", "meaning"], &[1], &rows)
}

/// Names of files with their SHA-256.
pub fn files<'a>(files: impl Iterator<Item = (&'a str, &'a str)>) -> Html {
    let rows: Vec<_> = files
        .map(|(name, sha256)| vec![cell(name), html! { code { (sha256) } }])
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
