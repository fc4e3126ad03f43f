//! What a fit of a problem gave, for people and for scripts.

use super::sure;
use crate::cli::format::aligned;
use crate::estimation::file::Noise;
use crate::estimation::result::{Found, RunFit};
use crate::estimation::{Fit, Posed};
use crate::inference::Interval;
use crate::report::significant;
use crate::sqp::Status;
use serde_json::{Map, Value, json};

/// A fit, and the runs that were kept out of it.
#[derive(Clone, Copy)]
pub struct Outcomes<'a> {
    /// The problem.
    pub posed: &'a Posed<'a>,
    /// Its fit.
    pub fit: &'a Fit,
    /// The validation runs, simulated with what was found.
    pub judged: &'a [RunFit],
}

impl<'a> Outcomes<'a> {
    /// All runs, with what they are used for.
    pub fn runs(self) -> impl Iterator<Item = (&'a RunFit, &'static str)> {
        let fitted = self.fit.runs.iter().map(|run| (run, "fit"));
        fitted.chain(self.judged.iter().map(|run| (run, "validation")))
    }

    /// Whether a run has figures: validation runs are simulated, fitted ones have to fulfil the equations.
    pub fn has_figures(self, usage: &str) -> bool {
        usage != "fit" || self.fit.is_met()
    }

    /// Root mean square of the residuals of a measured signal, as they are and over their standard deviation; none
    /// where the run has no figures.
    fn rms(self, run: &RunFit, usage: &str, k: usize) -> Option<(f64, f64)> {
        let noise = self.posed.file.measured[k].noise;
        self.has_figures(usage).then(|| rms(run, k, noise))
    }
}

/// The one object of `--json`.
pub fn to_json(outcomes: &Outcomes<'_>) -> Value {
    let Outcomes { posed, fit, .. } = *outcomes;
    let runs = outcomes.runs().map(
        |(run, usage)| json!({ "name": run.name, "use": usage, "measured": measured(outcomes, run, usage) }),
    );
    let runs: Vec<Value> = runs.collect();
    // What does not fulfil the equations has no objective.
    let told = |figure: f64| fit.is_met().then_some(figure);
    let starts = fit.starts.iter();
    let starts = starts
        .map(|(status, objective)| json!({ "status": status.as_str(), "objective": objective }));
    json!({
        "status": fit.ending(),
        "converged": fit.is_answer(),
        "objective": told(fit.objective),
        "simulated_objective": fit.simulated_objective,
        "chi2": told(fit.chi2),
        "nllh": told(fit.nllh),
        "violation": fit.kkt.primal,
        "samples": fit.samples,
        "parameters": Value::Object(sure::of(fit).map(parameter).collect()),
        "uncertainty": sure::to_json(fit),
        "initial": initial(posed, fit),
        "closed_loop": {
            "stable": fit.is_stable(),
            "poles": fit.poles,
        },
        "doubts": fit.diagnostics.iter().map(|own| json!({ "code": own.code(), "words": own.to_string() })).collect::<Vec<_>>(),
        "iterations": fit.refinement.iterations,
        "kkt": fit.kkt.residual(),
        "mesh": {
            "intervals": fit.refinement.intervals,
            "refinements": fit.refinement.rounds,
            "error": fit.refinement.error,
            "scheme": fit.refinement.scheme.name(),
            "changes": fit.refinement.changes,
        },
        "starts": starts.collect::<Vec<_>>(),
        "runs": runs,
        "seconds": fit.seconds,
    })
}

fn parameter((found, intervals): (&Found, Option<&[Interval]>)) -> (String, Value) {
    let mut entry = Map::new();
    match found.values.as_slice() {
        [(None, value)] => entry.insert("value".into(), json!(value)),
        all => {
            let all = all
                .iter()
                .map(|(label, value)| (label.clone().unwrap_or_default(), json!(value)));
            entry.insert("value".into(), Value::Object(all.collect()))
        }
    };
    entry.insert("unit".into(), json!(found.unit));
    if let Some(bound) = found.bound {
        entry.insert("bound".into(), json!(bound));
    }
    if let Some(intervals) = intervals {
        sure::add_to(&mut entry, found, intervals);
    }
    if found.is_tied {
        entry.insert("tied".into(), json!(true));
    }
    (found.name.clone(), Value::Object(entry))
}

/// For each state that is estimated at the begin, its value in each run.
fn initial(posed: &Posed<'_>, fit: &Fit) -> Value {
    let all = fit.initial(posed).into_iter().map(|found| {
        let value = |k: usize| found.values.get(k).unwrap_or(&found.values[0]).1;
        let runs = fit.runs.iter().enumerate();
        let values = runs.map(|(k, run)| (run.name.clone(), json!(value(k))));
        (found.name.clone(), Value::Object(values.collect()))
    });
    Value::Object(all.collect())
}

fn measured(outcomes: &Outcomes<'_>, run: &RunFit, usage: &str) -> Value {
    let mut all = Map::new();
    for (k, measured) in outcomes.posed.file.measured.iter().enumerate() {
        let (residual, relative) = outcomes.rms(run, usage, k).unzip();
        all.insert(
            measured.column.value.clone(),
            json!({ "rms_residual": residual, "rms_per_sd": relative }),
        );
    }
    Value::Object(all)
}

/// Root mean square of the residuals of a measured signal, as they are and over their standard deviation.
fn rms(run: &RunFit, k: usize, noise: Noise) -> (f64, f64) {
    let mean = |residuals: Vec<f64>| {
        let known = residuals.iter().filter(|r| !r.is_nan());
        let sum: f64 = known.clone().map(|r| r * r).sum();
        (sum / known.count() as f64).sqrt()
    };
    let plain = run.recorded[k].iter().zip(&run.predicted[k]);
    let plain = plain.map(|(y, h)| y - h).collect();
    (mean(plain), mean(run.residuals(k, noise)))
}

/// The summary for people.
pub fn to_text(outcomes: &Outcomes<'_>) -> String {
    let Outcomes { posed, fit, .. } = *outcomes;
    let verdict = fit.verdict();
    let mut text = format!(
        "{verdict}: {} iterations, {} s, scaled KKT residual {:.1e}\n{} runs, {} measured values: {}\n\n",
        fit.refinement.iterations,
        significant(fit.seconds, 3),
        fit.kkt.residual(),
        fit.runs.len(),
        fit.samples,
        objective(fit),
    );
    text += &aligned(&parameter_rows(fit));
    text += &sure::to_text(fit);
    text += "\n";
    let initial = fit.initial(posed);
    if !initial.is_empty() {
        text += &aligned(&initial_rows(&initial));
        text += "\n";
    }
    text += &aligned(&run_rows(posed, outcomes));
    text += &mesh(posed, fit);
    match (fit.starts.len(), fit.agreeing()) {
        (1, _) => {}
        (starts, 0) => text += &format!("starts: none of {starts} converged\n"),
        (starts, count) => text += &format!("starts: {count} of {starts} ended at this optimum\n"),
    }
    for diagnostic in &fit.diagnostics {
        text += &format!("diagnostic [{}]: {diagnostic}\n", diagnostic.code());
    }
    text
}

/// The objective; where the equations are not met, why there is none.
fn objective(fit: &Fit) -> String {
    let simulated = fit.simulated_objective.map_or(String::new(), |own| {
        format!("; simulated with these parameters: {}", significant(own, 8))
    });
    let (objective, chi2) = (significant(fit.objective, 8), significant(fit.chi2, 8));
    match (fit.is_met(), fit.status) {
        (true, _) => format!("objective {objective}, chi2 {chi2}"),
        (false, Status::UndefinedStart) => {
            "no objective, since not all is finite at the start".into()
        }
        (false, _) => format!("no objective, since the equations are not met{simulated}"),
    }
}

/// The mesh in a line.
fn mesh(posed: &Posed<'_>, fit: &Fit) -> String {
    let refinement = &fit.refinement;
    let is_stiff = posed.file.options.scheme.is_none() && refinement.is_for_stiff();
    let stiff = if is_stiff {
        " (the equations are stiff)"
    } else {
        ""
    };
    let error = match refinement.error.is_nan() {
        true => "error not estimated".to_owned(),
        false => format!("estimated error {:.1e}", refinement.error),
    };
    format!(
        "\nmesh: {} intervals of {}{stiff} after {} refinements, {error}\n",
        refinement.intervals, refinement.scheme, refinement.rounds
    )
}

fn parameter_rows(fit: &Fit) -> Vec<[String; 7]> {
    let header = ["parameter", "value", "sd", "low", "high", "unit", ""];
    let mut rows = vec![header.map(str::to_owned)];
    for (found, intervals) in sure::of(fit) {
        let remark = match (found.is_tied, found.bound) {
            (true, _) => "tied".to_owned(),
            (false, Some(bound)) => format!("at its bound {bound}"),
            (false, None) => String::new(),
        };
        for (k, (name, value)) in found.named().enumerate() {
            let unit = found.unit.clone().unwrap_or_default();
            let [sd, low, high, meaning] = sure::cells(intervals.and_then(|all| all.get(k)));
            let remark = match found.bound {
                None if !meaning.is_empty() => meaning,
                _ => remark.clone(),
            };
            rows.push([name, significant(value, 7), sd, low, high, unit, remark]);
        }
    }
    rows
}

fn initial_rows(all: &[Found]) -> Vec<[String; 3]> {
    let mut rows = vec![["initial state", "value", "unit"].map(str::to_owned)];
    for found in all {
        for (name, value) in found.named() {
            let unit = found.unit.clone().unwrap_or_default();
            rows.push([name, significant(value, 7), unit]);
        }
    }
    rows
}

/// For each run and measured signal its residual.
pub fn run_rows(posed: &Posed<'_>, outcomes: &Outcomes<'_>) -> Vec<[String; 4]> {
    let mut rows = vec![["run", "column", "rms residual", "over sd"].map(str::to_owned)];
    for (run, usage) in outcomes.runs() {
        for (k, measured) in posed.file.measured.iter().enumerate() {
            let told = outcomes.rms(run, usage, k);
            let shown = |own: Option<f64>| own.map_or("-".to_owned(), |own| significant(own, 4));
            let (plain, relative) = told.unzip();
            let name = match usage {
                "fit" => run.name.clone(),
                _ => format!("{} ({usage})", run.name),
            };
            rows.push([
                name,
                measured.column.value.clone(),
                shown(plain),
                shown(relative),
            ]);
        }
    }
    rows
}
