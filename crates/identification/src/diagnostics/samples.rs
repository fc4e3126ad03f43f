//! Diagnostics of residuals, or of samples if the fit is not feasible.

use super::{Diagnostic, Fit, FitOptions, Trial};
use crate::{InitialState, Objective, RunFit};
use pilotage_flights::Check;
use pilotage_flights::checks::{self, samples};
use pilotage_inference::outliers::{self, Breaks, Kind, Values};
use pilotage_inference::sampling;
use pilotage_inference::statistics::rms;

/// The diagnostics of the samples.
pub fn diagnostics(fit: &Fit, options: &FitOptions, trials: &[Trial]) -> Vec<Diagnostic> {
    let looked_at = looked_at(fit, trials);
    let kind = match fit.is_feasible() {
        true => Kind::Residuals,
        false => Kind::Recorded,
    };
    let (frozen, breaks) = samples::broken(trials, &looked_at, kind);
    let stands_out = match fit.is_feasible() {
        true => [
            outlier(&breaks, &looked_at, fit, options, trials),
            jump(&breaks, options, trials),
        ],
        false => [
            samples::outlier(&breaks, &looked_at, trials).map(Diagnostic::from),
            samples::jump(&breaks, trials).map(Diagnostic::from),
        ],
    };
    let checks = [frozen].into_iter().chain(samples::of_columns(trials));
    let checks = checks.chain([moving(&looked_at, options, trials)]);
    let others = [
        gap(trials).filter(|_| !fit.is_feasible()),
        misfit(&looked_at, trials).filter(|_| fit.is_feasible()),
    ];
    let all = stands_out
        .into_iter()
        .chain(checks.map(|own| own.map(Diagnostic::from)));
    all.chain(others).flatten().collect()
}

/// The residuals of each run, or the recorded positions if the fit is not feasible.
fn looked_at(fit: &Fit, trials: &[Trial]) -> Vec<Values> {
    let pairs = trials.iter().zip(&fit.runs);
    let of_run = |(trial, run): (&Trial, &RunFit)| match fit.is_feasible() {
        true => samples::values(trial, run.residual.clone()),
        false => samples::values(trial, trial.position.clone()),
    };
    pairs.map(of_run).collect()
}

/// The largest residual among the outliers, and their share of the objective.
fn outlier(
    breaks: &Breaks,
    looked_at: &[Values],
    fit: &Fit,
    options: &FitOptions,
    trials: &[Trial],
) -> Option<Diagnostic> {
    let size = |(run, k): (usize, usize)| looked_at[run].values[k].abs();
    let (run, k) = (breaks.samples()).max_by(|a, b| size(*a).total_cmp(&size(*b)))?;
    let squares = breaks.samples().map(|sample| size(sample).powi(2));
    let total = fit.residuals().filter(|r| r.is_finite()).map(|r| r * r);
    Some(Diagnostic::Outlier {
        run: trials[run].name.clone(),
        time: trials[run].time[k],
        value: looked_at[run].values[k],
        unit: options.objective.unit(),
        count: breaks.samples().count(),
        share: squares.sum::<f64>() / total.sum::<f64>(),
    })
}

fn jump(breaks: &Breaks, options: &FitOptions, trials: &[Trial]) -> Option<Diagnostic> {
    let (run, k, size) = breaks.jump()?;
    Some(Diagnostic::Jump {
        run: trials[run].name.clone(),
        time: trials[run].time[k],
        size,
        unit: options.objective.unit(),
    })
}

/// The run with the worst fit, if it is far worse than the others both in metres and relative to its task.
fn misfit(looked_at: &[Values], trials: &[Trial]) -> Option<Diagnostic> {
    let sizes: Vec<f64> = looked_at.iter().map(|own| rms(&own.values)).collect();
    let tasks: Vec<f64> = trials.iter().map(Trial::forcing).collect();
    let (run, ratio) = outliers::misfit(&sizes, &tasks)?;
    Some(Diagnostic::Misfit {
        run: trials[run].name.clone(),
        ratio,
    })
}

/// The longest time without rows. If the samples are the mesh's nodes, it is a single interval, over which no scheme is
/// accurate.
fn gap(trials: &[Trial]) -> Option<Diagnostic> {
    let of_run = |trial: &Trial| {
        let [from, to] = sampling::gap(&trial.time)?;
        let run = trial.name.clone();
        Some((to - from, Diagnostic::Gap { run, from, to }))
    };
    let all = trials.iter().filter_map(of_run);
    all.max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, diagnostic)| diagnostic)
}

/// A run that is fitted from rest but moves at its start.
fn moving(looked_at: &[Values], options: &FitOptions, trials: &[Trial]) -> Option<Check> {
    let is_from_rest =
        options.initial_state != InitialState::Free && options.objective == Objective::Response;
    let noise = outliers::noise(looked_at);
    let found = || checks::moving(&options.vehicle, options.stick_limit, noise, trials);
    is_from_rest.then(found).flatten()
}
