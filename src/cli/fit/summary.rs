//! The results of a problem fit, for people and for scripts.

use super::checks::Checked;
use super::sure;
use crate::cli::excitation;
use crate::cli::fit::SCHEMA;
use crate::cli::fit::describing;
use crate::cli::fit::refits::Refitted;
use crate::cli::format::aligned;
use crate::cli::terminal;
use crate::estimation::beforehand::Beforehand;
use crate::estimation::file::Noise;
use crate::estimation::posed::data::RunData;
use crate::estimation::result::Beside;
use crate::estimation::result::{Found, RunFit};
use crate::estimation::validation::Judged;
use crate::estimation::{Fit, Posed};
use crate::inference::residuals::{Explained, LjungBox};
use crate::inference::{Autoregression, Interval};
use crate::sqp::Status;
use pilotage_text::counted;
use pilotage_text::number::significant;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// A fit with its validation runs and further results.
pub struct Outcomes<'a> {
    /// The problem.
    pub posed: &'a Posed<'a>,
    /// Its fit.
    pub fit: &'a Fit,
    /// The validation runs, simulated with the estimates.
    pub judged: &'a [Judged],
    /// Refits of the fit.
    pub refitted: Option<&'a Refitted>,
    /// Results of the checks before the solve; `None` if they were not run.
    pub before: Option<&'a Beforehand>,
    /// Autoregressive noise model of each measured signal.
    pub processes: Vec<Option<Autoregression>>,
    /// Fits of the same problem to some of its runs, if asked for.
    pub checked: Option<&'a Checked>,
    /// The fitted runs without the estimated initial states, if there are such.
    pub alone: Option<&'a [RunFit]>,
}

/// A run and its usage.
#[derive(Clone, Copy)]
pub struct Used<'a> {
    /// The run.
    pub run: &'a RunFit,
    /// For a validation run, the initial states estimated from it.
    pub judged: Option<&'a Judged>,
    /// Whether its figures are defined: fitted runs have to satisfy the equations.
    pub has_figures: bool,
}

impl Used<'_> {
    /// `fit` or `validation`.
    pub fn usage(self) -> &'static str {
        match self.judged {
            Some(_) => "validation",
            None => "fit",
        }
    }

    /// Its name, marked if it is a validation run.
    pub fn name(self) -> String {
        match self.judged {
            Some(_) => format!("{} ({})", self.run.name, self.usage()),
            None => self.run.name.clone(),
        }
    }

    /// Root mean square of the residuals of a measured signal, absolute and relative to their standard deviation;
    /// `None` if the run has no figures.
    fn rms(self, k: usize, noise: Noise) -> Option<(f64, f64)> {
        self.has_figures.then(|| rms(self.run, k, noise))
    }
}

impl<'a> Outcomes<'a> {
    /// Fraction of a measured signal explained one step ahead by the model and the process of its residuals.
    fn one_step(&self, own: Used<'_>, k: usize) -> Option<Explained> {
        let process = self.processes[k].as_ref().filter(|_| own.has_figures)?;
        own.run
            .one_step(k, self.posed.file.measured[k].noise, process)
    }

    /// Root mean square of the residuals of a fitted run without the estimated initial states.
    fn rms_alone(&self, own: Used<'_>, k: usize) -> Option<f64> {
        let all = self.alone.filter(|_| own.judged.is_none())?;
        let alone = all.iter().find(|alone| alone.name == own.run.name)?;
        Some(plain_rms(alone, k))
    }

    /// A note if free initial states, rather than the pilot, reproduce the recorded motion.
    pub fn carried(&self) -> Option<String> {
        const FAR: f64 = 3.0;
        let measured = 0..self.posed.file.measured.len();
        let has_pilot = self
            .posed
            .joint
            .parts
            .iter()
            .any(|(name, _)| name == "pilot");
        let mut far = measured.filter_map(|k| {
            let sum = |of: &dyn Fn(&RunFit) -> f64, all: &[RunFit]| -> f64 {
                all.iter().map(|run| of(run).powi(2)).sum()
            };
            let squares = |all| sum(&|run| plain_rms(run, k), all);
            let ratio = (squares(self.alone?) / squares(&self.fit.runs)).sqrt();
            (ratio > FAR).then_some((k, ratio))
        });
        let (k, ratio) = far.find(|_| has_pilot)?;
        Some(format!(
            "without its estimated initial states {} is {} times as far off: they carry the runs; if nobody moved before the \
             target did, say in [initial] how the runs began",
            self.posed.file.measured[k].column.value,
            significant(ratio, 2)
        ))
    }

    /// All runs with their usage.
    pub fn runs(&self) -> impl Iterator<Item = Used<'a>> + use<'a> {
        let has_figures = self.fit.is_met();
        let fitted = self.fit.runs.iter().map(move |run| Used {
            run,
            judged: None,
            has_figures,
        });
        let judged = self.judged.iter().map(|own| Used {
            run: &own.run,
            judged: Some(own),
            has_figures: own.is_answer,
        });
        fitted.chain(judged)
    }
}

/// The JSON object of `--json`.
pub fn to_json(outcomes: &Outcomes<'_>) -> Value {
    let Outcomes { posed, fit, .. } = outcomes;
    let runs: Vec<Value> = outcomes.runs().map(|own| run(outcomes, own)).collect();
    // An iterate that violates the equations has no objective.
    let if_met = |figure: f64| fit.is_met().then_some(figure);
    let starts = fit.starts.iter().enumerate().map(|(k, own)| {
        json!({
            "start": k + 1,
            "status": own.status.as_str(),
            "objective": own.objective,
            "iterations": own.iterations,
            "kkt": own.kkt,
            "parameters": own.parameters.iter().map(|(name, value)| (name.clone(), json!(value))).collect::<Map<_, _>>(),
        })
    });
    let mut object = json!({
        "schema": SCHEMA,
        "status": fit.ending(),
        "converged": fit.is_answer(),
        "objective": if_met(fit.objective),
        "simulated_objective": fit.simulated_objective,
        "chi2": if_met(fit.chi2),
        "nllh": if_met(fit.nllh),
        "violation": fit.kkt.primal,
        "samples": fit.samples,
        "parameters": Value::Object(sure::of(fit).map(|own| sought(own, outcomes)).collect()),
        "left_out": posed.left_out,
        "notes": notes(posed),
        "derived": Value::Object(sure::derived(fit).map(|own| refitted(parameter(own), outcomes)).collect()),
        "loop_cut_at": fit.cuts,
        "excitation": beforehand(outcomes.before),
        "saturated": fit.saturated.iter().map(|own| {
            json!({ "output": own.output, "samples": own.samples, "of": own.of })
        }).collect::<Vec<_>>(),
        "describing_function": describing::to_json(&fit.describing),
        "uncertainty": uncertainty(outcomes),
        "initial": initial(posed, fit),
        "initial_intervals": sure::initial(posed, fit),
        "closed_loop": {
            "stable": fit.is_stable(),
            "poles": fit.poles,
        },
        "doubts": fit.diagnostics.iter().map(|own| json!({ "code": own.code(), "words": own.to_string() })).collect::<Vec<_>>(),
        "iterations": fit.refinement.iterations,
        "unknowns": fit.solved.as_ref().map(|own| own.solution.iterate.z.len()),
        "kkt": fit.kkt.residual(),
        "curvature": fit.curvature,
        "offset": fit.offset,
        "mesh": {
            "intervals": fit.refinement.intervals,
            "refinements": fit.refinement.rounds,
            "error": fit.refinement.error,
            "scheme": fit.refinement.scheme.name(),
            "changes": fit.refinement.changes,
        },
        "delays": fit.delays.as_ref().map(|own| json!({
            "order": own.order,
            "before": own.moved.as_ref().map(|(order, ..)| order),
            "moved": own.moved.as_ref().map(|(_, most, _)| most),
            "parameter": own.moved.as_ref().map(|(.., name)| name),
            "enough": own.is_enough,
        })),
        "starts": starts.collect::<Vec<_>>(),
        "starts_agreeing": fit.agreeing(),
        "skipped": fit.skipped(),
        "runs": runs,
        "cross_correlations": fit.beside.iter().map(beside).collect::<Vec<_>>(),
        "seconds": {
            "total": fit.seconds.total(),
            "reading": fit.seconds.reading,
            "search": fit.seconds.search,
            "solve": fit.seconds.solve,
            "uncertainty": fit.seconds.uncertainty,
            "diagnostics": fit.seconds.diagnostics,
        },
    });
    if let Some(checked) = outcomes.checked {
        checked.add_to(&mut object);
    }
    object
}

/// Cross-correlation of residuals with an input.
fn beside(own: &Beside) -> Value {
    let crossed = &own.crossed;
    let outside = (0..crossed.lags.len()).filter(|k| crossed.is_outside(*k));
    json!({
        "measured": own.measured,
        "input": own.input,
        "lags": crossed.lags,
        "correlations": crossed.correlations,
        "bands": crossed.bands,
        "p": crossed.p,
        "share": crossed.share,
        "outside": outside.map(|k| crossed.lags[k]).collect::<Vec<_>>(),
    })
}

/// Excitation of the runs, and identifiability at the start values.
fn beforehand(before: Option<&Beforehand>) -> Value {
    let own = before.and_then(|own| own.excitation.as_ref());
    let identifiability = before.and_then(|own| own.identifiability.as_ref());
    json!({
        "forcing": excitation::to_json(own),
        "identifiability": identifiability.map(|own| json!({
            "starts": own.starts,
            "singular_values": own.singular_values,
            "sd": own.deviations.iter().cloned().collect::<BTreeMap<String, f64>>(),
            "flat": own.flat,
            "weak": own.weak,
        })),
    })
}

/// How the files of the runs were taken where they are not plain, one sentence each.
pub fn notes(posed: &Posed<'_>) -> Vec<String> {
    let of_run = |run: &RunData<'_>| {
        let note = run.series.note.as_ref()?;
        Some(format!("{}: {note}", run.line.file.display()))
    };
    let mut all: Vec<String> = posed.data.iter().filter_map(of_run).collect();
    // A file may be part of several runs.
    all.dedup();
    all
}

fn sought(own: (&Found, Option<&[Interval]>), outcomes: &Outcomes<'_>) -> (String, Value) {
    let (name, mut entry) = parameter(own);
    if own.0.is_tied {
        entry["tied"] = json!(true);
    }
    refitted((name, entry), outcomes)
}

/// Adds the results of refits.
fn refitted((name, mut entry): (String, Value), outcomes: &Outcomes<'_>) -> (String, Value) {
    if let (Some(refitted), Some(entry)) = (outcomes.refitted, entry.as_object_mut()) {
        refitted.add_to(&name, entry);
    }
    (name, entry)
}

fn uncertainty(outcomes: &Outcomes<'_>) -> Value {
    let mut object = sure::to_json(outcomes.fit);
    if let Some(refitted) = outcomes.refitted {
        refitted.add_methods(&mut object);
    }
    object
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
    (found.name.clone(), Value::Object(entry))
}

/// The value of each estimated initial state in each run.
fn initial(posed: &Posed<'_>, fit: &Fit) -> Value {
    let all = fit.initial(posed).into_iter().map(|found| {
        let value = |k: usize| found.values.get(k).unwrap_or(&found.values[0]).1;
        let runs = fit.runs.iter().enumerate();
        let values = runs.map(|(k, run)| (run.name.clone(), json!(value(k))));
        (found.name.clone(), Value::Object(values.collect()))
    });
    Value::Object(all.collect())
}

/// The figures of a run; for validation runs also the initial states estimated from it.
fn run(outcomes: &Outcomes<'_>, own: Used<'_>) -> Value {
    let mut object = json!({
        "name": own.run.name,
        "use": own.usage(),
        "measured": measured(outcomes, own),
    });
    if let Some(judged) = own.judged {
        object["mean_of_subjects"] = json!(judged.averaged);
    }
    if let Some(judged) = own.judged.filter(|judged| !judged.initial.is_empty()) {
        let initial = judged.initial.iter();
        let initial = initial.map(|own| (own.name.clone(), json!(own.mean())));
        object["initial"] = Value::Object(initial.collect());
        object["converged"] = json!(judged.is_answer);
    }
    object
}

fn measured(outcomes: &Outcomes<'_>, own: Used<'_>) -> Value {
    let mut all = Map::new();
    for (k, measured) in outcomes.posed.file.measured.iter().enumerate() {
        let (residual, relative) = own.rms(k, measured.noise).unzip();
        let explained = own.run.explained(k).filter(|_| own.has_figures);
        let residuals = own.run.residuals(k, measured.noise);
        let process = outcomes.processes[k].as_ref();
        let one_step = outcomes.one_step(own, k);
        let order = process.map(Autoregression::order);
        let white = LjungBox::of(&residuals).filter(|_| own.has_figures);
        let mut entry = json!({
            "rms_residual": residual,
            "rms_per_sd": relative,
            "vaf": explained.map(|own| own.vaf),
            "fit": explained.map(|own| own.fit),
            "one_step": one_step.map(|own| {
                json!({ "vaf": own.vaf, "fit": own.fit, "order": order })
            }),
            "ljung_box": white.map(|own| {
                json!({ "lags": own.lags, "statistic": own.statistic, "p": own.p })
            }),
        });
        if let Some(rms) = own.run.rms_ahead(k) {
            entry["rms_one_step"] = json!(rms);
        }
        if let Some(rms) = outcomes.rms_alone(own, k) {
            entry["rms_alone"] = json!(rms);
        }
        all.insert(measured.column.value.clone(), entry);
    }
    Value::Object(all)
}

/// Root mean square of the residuals of a measured signal, absolute and relative to their standard deviation.
fn rms(run: &RunFit, k: usize, noise: Noise) -> (f64, f64) {
    (
        plain_rms(run, k),
        mean_square(&run.residuals(k, noise)).sqrt(),
    )
}

/// Root mean square of what was recorded of a measured signal minus what the model says.
fn plain_rms(run: &RunFit, k: usize) -> f64 {
    let pairs = run.recorded[k].iter().zip(&run.predicted[k]);
    mean_square(&pairs.map(|(y, h)| y - h).collect::<Vec<f64>>()).sqrt()
}

fn mean_square(residuals: &[f64]) -> f64 {
    let known = residuals.iter().filter(|r| !r.is_nan());
    let sum: f64 = known.clone().map(|r| r * r).sum();
    sum / known.count() as f64
}

/// How far from an optimum the solve ended.
fn distance(fit: &Fit) -> String {
    let residual = format!("scaled KKT residual {:.1e}", fit.kkt.residual());
    match fit.offset {
        Some(offset) => format!(
            "{residual} at kinks, {} standard deviations from the optimum on its mesh",
            significant(offset, 1)
        ),
        None => residual,
    }
}

/// The summary as text for people.
pub fn to_text(outcomes: &Outcomes<'_>) -> String {
    let Outcomes { posed, fit, .. } = outcomes;
    let verdict = fit.verdict();
    let mut text = format!(
        "{verdict}: {}, {} s, {}\n{}, {}: {}\n\n",
        counted(fit.refinement.iterations, "iteration"),
        significant(fit.seconds.total(), 3),
        distance(fit),
        counted(fit.runs.len(), "run"),
        counted(fit.samples, "measured value"),
        objective(fit),
    );
    text += &aligned(&parameter_rows("parameter", sure::of(fit)));
    text += &sure::to_text(fit);
    let is_short = |(found, _): &(&Found, _)| !found.name.starts_with("pole");
    let derived: Vec<_> = sure::derived(fit).filter(is_short).collect();
    if !derived.is_empty() {
        text += "\n";
        text += &aligned(&parameter_rows("derived", derived.into_iter()));
        if !fit.cuts.is_empty() {
            text += &format!(
                "loop cut at {}, linear where the first run ends\n",
                fit.cuts.join(" and at ")
            );
        }
    }
    text += &outcomes.refitted.map_or(String::new(), Refitted::to_text);
    text += "\n";
    let initial = fit.initial(posed);
    if !initial.is_empty() {
        text += &aligned(&initial_rows(&initial, fit));
        text += "\n";
    }
    text += &aligned(&run_rows(posed, outcomes));
    for own in &fit.saturated {
        text += &format!(
            "{} saturates at {} of {}\n",
            own.output,
            own.samples,
            counted(own.of, "sample")
        );
    }
    text += &judged(outcomes);
    text += &outcomes
        .carried()
        .map_or(String::new(), |note| format!("note: {note}\n"));
    text += &(outcomes.checked).map_or(String::new(), |own| own.to_text(fit));
    text += &mesh(posed, fit);
    if let Some(own) = &fit.delays {
        let label = if own.is_enough { "" } else { "note: " };
        text += &format!("{label}{}\n", own.words());
    }
    match (fit.starts.len(), fit.agreeing()) {
        (1, _) => {}
        (starts, 0) => text += &format!("starts: none of {starts} converged\n"),
        (starts, count) => text += &format!("starts: {count} of {starts} ended at this optimum\n"),
    }
    for diagnostic in &fit.diagnostics {
        let label = format!("diagnostic [{}]", diagnostic.code());
        text += &terminal::labelled(&label, &diagnostic.to_string());
    }
    text
}

/// The initial states of validation runs, if estimated.
fn judged(outcomes: &Outcomes<'_>) -> String {
    let all = outcomes.judged.iter();
    let mut text = match all.clone().any(|own| !own.initial.is_empty()) {
        true => {
            "validation runs begin with free initial states estimated from them, all else held\n"
                .into()
        }
        false => String::new(),
    };
    for own in all.filter(|own| !own.is_answer) {
        text += &format!("{}: no initial states were found for it\n", own.run.name);
    }
    outcomes
        .judged
        .iter()
        .filter_map(averaged)
        .for_each(|note| text += &note);
    text
}

/// The parameters per subject for which a predicted run has the mean of the other subjects.
pub fn averaged(own: &Judged) -> Option<String> {
    let names: Vec<String> = own
        .averaged
        .iter()
        .map(|name| format!("`{name}`"))
        .collect();
    (!names.is_empty()).then(|| {
        format!(
            "{}: no fitted run of its subject determines {}; the mean of the others is used\n",
            own.run.name,
            names.join(", ")
        )
    })
}

/// The objective, or the reason why there is none.
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

/// One line about the mesh.
fn mesh(posed: &Posed<'_>, fit: &Fit) -> String {
    let refinement = &fit.refinement;
    let is_stiff = posed.file.options.scheme.is_none() && refinement.is_for_stiff();
    let stiff = if is_stiff {
        " (for stiff equations)"
    } else {
        ""
    };
    let error = match refinement.error.is_nan() {
        true => "error not estimated".to_owned(),
        false => format!("estimated error {:.1e}", refinement.error),
    };
    format!(
        "\nmesh: {} of {}{stiff} after {}, {error}\n",
        counted(refinement.intervals, "interval"),
        refinement.scheme,
        counted(refinement.rounds, "refinement")
    )
}

fn parameter_rows<'f>(
    what: &str,
    all: impl Iterator<Item = (&'f Found, Option<&'f [Interval]>)>,
) -> Vec<[String; 7]> {
    let header = [what, "value", "sd", "low", "high", "unit", ""];
    let mut rows = vec![header.map(str::to_owned)];
    for (found, intervals) in all {
        let remark = match (found.is_tied, found.bound) {
            (true, _) if what != "parameter" => String::new(),
            (true, Some(bound)) => format!("tied, at its bound {bound}"),
            (true, None) => "tied".to_owned(),
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

fn initial_rows(all: &[Found], fit: &Fit) -> Vec<[String; 6]> {
    let header = ["initial state", "value", "sd", "low", "high", "unit"];
    let mut rows = vec![header.map(str::to_owned)];
    let known = fit.uncertainty.as_ref().ok();
    for (k, found) in all.iter().enumerate() {
        for (j, (name, value)) in found.named().enumerate() {
            let unit = found.unit.clone().unwrap_or_default();
            let interval = known.and_then(|own| own.initial[k][j].as_ref());
            let [sd, low, high, _] = sure::cells(interval);
            rows.push([name, significant(value, 7), sd, low, high, unit]);
        }
    }
    rows
}

/// Columns for each run and measured signal: free run of the model, and one-step-ahead prediction. With process noise,
/// the innovations are compared with their standard deviations.
pub fn run_header(outcomes: &Outcomes<'_>) -> &'static [&'static str] {
    match (&outcomes.posed.filter, outcomes.alone) {
        (Some(_), _) => &[
            "run",
            "column",
            "rms residual, free run",
            "one step ahead",
            "over its sd",
        ],
        (None, None) => &RUNS[..6],
        (None, Some(_)) => &RUNS,
    }
}

const RUNS: [&str; 7] = [
    "run",
    "column",
    "rms residual",
    "over sd",
    "vaf [%]",
    "one step [%]",
    "rms, no free states",
];

/// A row of residuals for each run and measured signal.
pub fn run_rows(posed: &Posed<'_>, outcomes: &Outcomes<'_>) -> Vec<Vec<String>> {
    let header = run_header(outcomes).iter().map(|&own| own.to_owned());
    let mut rows = vec![header.collect::<Vec<_>>()];
    for own in outcomes.runs() {
        for (k, measured) in posed.file.measured.iter().enumerate() {
            let shown = |own: Option<f64>| own.map_or("-".to_owned(), |own| significant(own, 4));
            let (plain, relative) = own.rms(k, measured.noise).unzip();
            let mut row = vec![
                own.name(),
                measured.column.value.clone(),
                shown(plain),
                shown(relative),
            ];
            if posed.filter.is_some() {
                row.insert(3, shown(own.run.rms_ahead(k)));
            } else {
                let explained = own.run.explained(k).filter(|_| own.has_figures);
                row.push(shown(explained.map(|own| own.vaf)));
                row.push(shown(outcomes.one_step(own, k).map(|own| own.vaf)));
                let alone = outcomes.alone.map(|_| outcomes.rms_alone(own, k));
                row.extend(alone.map(shown));
            }
            rows.push(row);
        }
    }
    rows
}
