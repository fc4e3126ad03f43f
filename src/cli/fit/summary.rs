//! The results of a fit, for people and for scripts.

use super::SCHEMA;
use super::describing;
use super::refits::Refitted;
use crate::cli::terminal;
use crate::cli::{excitation, format};
use crate::identification::{
    Diagnostic, Fit, FitOptions, Identification, InitialState, Objective, Uncertainty, pilot_file,
};
use crate::inference::{Interval, LEVEL, Method};
use crate::linear::Figure;
use crate::vehicle::{ClosedLoop, Mode};
use nalgebra::DMatrix;
use pilotage_inference::statistics::rms;
use pilotage_text::counted;
use pilotage_text::number::significant;
use serde_json::{Value, json};
use std::fmt::Display;

/// The rows of a matrix for `--json`.
pub fn reals(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let rows = matrix.row_iter();
    rows.map(|row| row.iter().copied().collect()).collect()
}

/// The JSON object of `--json`.
pub fn to_json(found: &Identification, refitted: Option<&Refitted>) -> Value {
    let Identification { fit, options, .. } = found;
    let modes = Mode::of_poles(&options.pilot.poles(&fit.theta));
    let runs: Vec<Value> = (found.outcomes())
        .map(|run| {
            json!({
                "name": run.trial.name,
                "use": if run.solution.is_some() { "fit" } else { "validation" },
                "rms_residual": run.solution.filter(|_| fit.is_feasible()).map(|run| rms(&run.residual)),
                "closed_loop_rms_m": run.errors().map(|(rms, _)| rms),
                "closed_loop_final_error_m": run.errors().map(|(_, last)| last),
            })
        })
        .collect();
    let starts: Vec<Value> = (fit.starts.iter())
        .map(|start| {
            json!({
                "start": start.number,
                "status": start.status.as_str(),
                "objective": start.objective,
                "feasible": start.feasible,
                "kkt": start.kkt,
                "curvature": start.curvature,
                "iterations": start.iterations,
                "seconds": start.seconds,
            })
        })
        .collect();
    json!({
        "schema": SCHEMA,
        "status": fit.status.as_str(),
        "converged": fit.converged,
        "objective": fit.objective,
        "theta": fit.theta,
        "parameters": parameters(fit, options, refitted),
        "uncertainty": fit.uncertainty.as_ref().map(|own| uncertainty(own, refitted)),
        "closed_loop": fit.closed_loop.as_ref().map(closed_loop),
        "derived": derived(found, refitted),
        "excitation": excitation::to_json(found.excitation.as_ref()),
        "describing_function": describing::to_json(&found.describing),
        "unknowns": fit.unknowns,
        "iterations": fit.iterations,
        "starts": starts,
        "skipped": fit.skipped,
        "starts_tried": fit.tried,
        "starts_agreeing": fit.agreeing(),
        // The diagnostics; the key is kept for existing scripts.
        "doubts": diagnostics(&fit.diagnostics),
        "kkt": fit.kkt,
        "violation": fit.violation,
        "curvature": fit.curvature,
        "seconds": fit.seconds,
        "poles": modes.iter().map(|mode| json!([mode.pole.re, mode.pole.im])).collect::<Vec<_>>(),
        "runs": runs,
    })
}

/// Value, unit and interval of each parameter, by name.
fn parameters(fit: &Fit, options: &FitOptions, refitted: Option<&Refitted>) -> Value {
    let all = fit.theta.iter().zip(pilot_file::units(options.pilot));
    let all = all.enumerate().map(|(i, (value, unit))| {
        let mut entry = json!({ "value": value, "unit": unit });
        if let Some(own) = fit.uncertainty.as_ref().map(|own| own.intervals[i]) {
            for (name, field) in FIELDS {
                entry[name] = field(&own);
            }
        }
        let name = format!("theta{}", i + 1);
        if let (Some(refitted), Some(entry)) = (refitted, entry.as_object_mut()) {
            refitted.add_to(&name, entry);
        }
        (name, entry)
    });
    Value::Object(all.collect())
}

/// The figures of the closed loop with intervals, by name.
fn derived(found: &Identification, refitted: Option<&Refitted>) -> Value {
    let all = found.derived.iter().map(|(figure, interval)| {
        let mut entry = json!({ "value": figure.value, "unit": figure.unit });
        for (name, field) in FIELDS {
            entry[name] = field(interval);
        }
        if let (Some(refitted), Some(entry)) = (refitted, entry.as_object_mut()) {
            refitted.add_to(&figure.name, entry);
        }
        (figure.name.clone(), entry)
    });
    Value::Object(all.collect())
}

/// The figures of the closed loop except its poles, with their intervals.
fn figures(found: &Identification) -> String {
    let all = found.derived.iter();
    let all = all.filter(|(figure, _)| !figure.name.starts_with("pole"));
    let line = |(figure, own): &(Figure, Interval)| {
        format!(
            "  {:<20} {:>10}  {:<6}{}\n",
            figure.name.replace('_', " "),
            significant(figure.value, 4),
            figure.unit,
            interval_words(own)
        )
    };
    let text: String = all.map(line).collect();
    match text.is_empty() {
        true => text,
        false => format!("\n{text}"),
    }
}

fn uncertainty(own: &Uncertainty, refitted: Option<&Refitted>) -> Value {
    let mut object = json!({
        "method": own.spread.method.as_str(),
        "level": LEVEL,
        "degrees_of_freedom": own.spread.degrees,
        "covariance": reals(&own.spread.covariance),
        "correlations": reals(&own.correlations),
        "correlated_by": own.correlated_by.as_str(),
        "cramer_rao_percent": own.cramer_rao,
        "insensitivity_percent": own.insensitivity,
        "notes": own.notes(),
    });
    if let Some(refitted) = refitted {
        refitted.add_methods(&mut object);
    }
    object
}

/// The interval of a component of θ; empty if not known.
fn interval(fit: &Fit, component: usize) -> String {
    let own = fit.uncertainty.as_ref().map(|own| own.intervals[component]);
    own.map_or_else(String::new, |own| interval_words(&own))
}

fn interval_words(own: &Interval) -> String {
    match own.sd.is_finite() {
        true => format!(
            "  sd {:<9} {:>10} to {}",
            significant(own.sd, 3),
            significant(own.low, 4),
            significant(own.high, 4)
        ),
        false => "  not determined by the data".to_owned(),
    }
}

/// The method of the intervals, and notes on it.
fn sureness(fit: &Fit) -> String {
    let Some(own) = &fit.uncertainty else {
        return String::new();
    };
    let mut text = format!("  {}\n", how(own.spread.method));
    for note in own.notes() {
        text += &terminal::labelled("  note", &note);
    }
    text
}

/// Reads a field of an interval.
type Field = fn(&Interval) -> Value;

/// Fields of an interval for scripts.
pub const FIELDS: [(&str, Field); 4] = [
    ("sd", |own| json!(own.sd)),
    ("low", |own| json!(own.low)),
    ("high", |own| json!(own.high)),
    ("class", |own| json!(own.class.as_str())),
];

/// Description of the intervals of a method.
pub fn how(method: Method) -> &'static str {
    match method {
        Method::Plain => "95 % intervals (plain: for residuals without colour)",
        Method::Sidpac => "95 % intervals (sidpac: with the autocorrelations of the residuals)",
        Method::Ar => "95 % intervals (ar: with autoregressive noise)",
        Method::Cr3 => "95 % intervals (cr3: by leaving out one run at a time)",
    }
}

/// Stability, and each pole as real and imaginary part [1/s].
fn closed_loop(closed_loop: &ClosedLoop) -> Value {
    let poles = closed_loop.poles.iter();
    json!({
        "stable": closed_loop.is_stable(),
        "poles": poles.map(|pole| json!([pole.re, pole.im])).collect::<Vec<_>>(),
    })
}

/// Code and words of each, and whether it is fatal.
pub fn diagnostics(all: &[Diagnostic]) -> Vec<Value> {
    let one = |own: &Diagnostic| doubt(own.code(), own, own.is_fatal());
    all.iter().map(one).collect()
}

/// Code and words of a doubt, and whether it is fatal.
pub(in crate::cli) fn doubt(code: &str, words: &impl Display, is_fatal: bool) -> Value {
    json!({ "code": code, "words": words.to_string(), "fatal": is_fatal })
}

/// The status of the fit in a few words, which always includes doubts if there are diagnostics.
pub fn verdict(fit: &Fit) -> String {
    let unstable = |diagnostic: &Diagnostic| matches!(diagnostic, Diagnostic::UnstableLoop { .. });
    match fit.diagnostics.first() {
        _ if !fit.converged => format!("NOT CONVERGED ({})", fit.status),
        Some(diagnostic) if unstable(diagnostic) => {
            "converged, but the closed loop is UNSTABLE".into()
        }
        Some(diagnostic) if diagnostic.is_fatal() => {
            format!("NO ANSWER ({}), though converged", diagnostic.code())
        }
        Some(_) => format!("converged, in doubt ({})", fit.diagnostics.len()),
        None => "converged".into(),
    }
}

/// The summary as text for people.
pub fn to_text(found: &Identification) -> String {
    let Identification { fit, options, .. } = found;
    let unit = match options.objective {
        Objective::Response => " m",
        Objective::Stick => "",
    };
    let squared = unit.replace('m', "m²");
    let residuals = || fit.runs.iter().flat_map(|run| &run.residual);
    let (verdict, feasible) = (verdict(fit), fit.is_feasible());
    let count = residuals().filter(|residual| residual.is_finite()).count();
    let mut text = format!(
        "{verdict}: {}, {} s, scaled KKT residual {:.1e}{}\n{}{}, {}: {}\n",
        counted(fit.iterations, "iteration"),
        significant(fit.seconds, 3),
        fit.kkt,
        curvature(fit),
        skipped(fit),
        counted(fit.runs.len(), "run"),
        counted(count, "sample"),
        match feasible {
            true => format!(
                "rms residual {}{unit}, sum of squares {}{squared}",
                significant(rms(residuals()), 3),
                significant(fit.objective, 6),
            ),
            false => format!(
                "the last iterate violates the equations by {:.1e} (scaled), so it has no residual",
                fit.violation
            ),
        }
    );
    for diagnostic in &fit.diagnostics {
        let label = format!("diagnostic ({})", diagnostic.code());
        text += &terminal::labelled(&label, &diagnostic.to_string());
    }
    text += "\n";
    for (i, (value, unit)) in fit
        .theta
        .iter()
        .zip(pilot_file::units(options.pilot))
        .enumerate()
    {
        let name = format!("θ{}", i + 1);
        let value = significant(*value, 6);
        let line = format!("  {name:<4} {value:>12}  {unit:<10}{}", interval(fit, i));
        text += &format!("{}\n", line.trim_end());
    }
    text += &sureness(fit);
    text += "\n  pole [1/s]            frequency [rad/s]  damping\n";
    for mode in Mode::of_poles(&options.pilot.poles(&fit.theta)) {
        text += &format::mode(&mode);
    }
    text + &loop_poles(fit) + &figures(found) + &runs(found) + &agreement(fit) + &carried(found)
}

/// The modes of the closed loop.
fn loop_poles(fit: &Fit) -> String {
    let Some(closed_loop) = &fit.closed_loop else {
        return "\n  closed loop: not known, since no --vehicle was given\n".into();
    };
    let stable = match (fit.is_feasible(), closed_loop.is_stable()) {
        (false, _) => "of this iterate",
        (true, true) => "stable",
        (true, false) => "UNSTABLE",
    };
    let modes = Mode::of_poles(&closed_loop.poles);
    let modes: String = modes.iter().map(format::mode).collect();
    let title = format!("closed loop, {stable}");
    format!("\n  {title:<20}  frequency [rad/s]  damping\n{modes}")
}

/// Number of starts that agree.
fn agreement(fit: &Fit) -> String {
    match fit.tried {
        0 | 1 => String::new(),
        _ if !fit.converged => String::new(),
        all => format!(
            "\n{} of {all} starts ended within 0.1 % of this sum of squares\n",
            fit.agreeing()
        ),
    }
}

/// The second-order condition, if the first-order one is satisfied.
fn curvature(fit: &Fit) -> String {
    match fit.curvature {
        Some(curvature) => format!(", smallest curvature {curvature:.1e}"),
        None if fit.converged => ", curvature not checked".into(),
        None => String::new(),
    }
}

/// A note if the fit ended before all starts were tried.
fn skipped(fit: &Fit) -> String {
    match fit.skipped {
        0 => String::new(),
        skipped => format!(
            "stopped early: {skipped} of {} starts were not tried\n",
            fit.starts.len() + skipped
        ),
    }
}

/// A note if free initial states, rather than the pilot, reproduce the recorded motion.
fn carried(found: &Identification) -> String {
    let options = &found.options;
    let fitted = || (found.outcomes()).filter_map(|run| Some((run.solution?, run.alone?)));
    let solved = rms(fitted().flat_map(|(solution, _)| &solution.residual));
    let alone = rms(fitted().flat_map(|(_, run)| &run.residual));
    let comparable = options.objective == Objective::Response;
    match comparable && options.initial_state != InitialState::AtRest && alone > 3.0 * solved {
        true => format!(
            "\nnote: the optimiser's runs are within {} m rms, but the pilot alone, from rest, is {} m off:\n      \
             its free initial states carry the runs. If nobody moved before the target appeared, fit with\n      \
             --initial-state at-rest\n",
            significant(solved, 2),
            significant(alone, 2)
        ),
        false => String::new(),
    }
}

/// One line for each run: the optimiser's residual, and the error of the closed loop flown alone from rest.
fn runs(found: &Identification) -> String {
    let Identification { fit, options, .. } = found;
    let names = found.outcomes();
    let width = names.map(|run| run.trial.name.chars().count()).max();
    let width = width.unwrap_or(0).max(10);
    let unit = options.objective.unit();
    let mut text = format!(
        "\n  {:<width$}  rms residual [{unit}]  flown alone from rest: rms [m]  final error [m]\n",
        "run"
    );
    for run in found.outcomes() {
        let residual = match run.solution {
            Some(run) if fit.is_feasible() => significant(rms(&run.residual), 3),
            Some(_) => "-".into(),
            None => "validation".into(),
        };
        let (alone, last) = run
            .errors()
            .map_or(("-".into(), "-".into()), |(rms, last)| {
                (significant(rms, 3), significant(last, 3))
            });
        text += &format!(
            "  {:<width$}  {residual:>16}  {alone:>30}  {last:>15}\n",
            run.trial.name,
        );
    }
    text
}
