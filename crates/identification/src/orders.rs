//! Choice of the order of the linear pilot: each order is fitted to all trials, and once without each trial.

use super::problem::free_initial_states;
use super::solve::{Observer, Progress};
use super::{FitError, FitOptions, Identification, Trial, TrialSet, fit};
use pilotage_inference::choice::Contender;
use pilotage_models::Pilot;
use std::cell::Cell;
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// A pilot of one order.
#[derive(Debug, Clone)]
pub struct Ordered {
    /// The order.
    pub order: usize,
    /// The fit to all trials.
    pub fit: super::Fit,
    /// Its statistics, with the noise level as one more unknown. A held-out trial is simulated with the pilot alone,
    /// from rest at its first recorded position; NaN if it cannot be simulated, or if the fit to the other trials is
    /// not valid.
    pub figures: Contender,
    /// Whether no fit was stopped: neither that to all trials nor one to the others.
    pub is_whole: bool,
}

/// Fits pilots of these orders. If the observer stops a fit, higher orders are not fitted, and the trials that are left to
/// predict have NaN.
///
/// # Errors
/// As [`fit`](fit()).
pub fn ordered(
    trials: &TrialSet,
    options: &FitOptions,
    orders: RangeInclusive<usize>,
    observer: &mut Observer<'_>,
) -> Result<Vec<Ordered>, FitError> {
    let is_stopped = Cell::new(false);
    let mut observer = |progress: &Progress| {
        let asked = observer(progress);
        is_stopped.set(is_stopped.get() || asked.is_break());
        asked
    };
    let observer: &mut Observer<'_> = &mut observer;
    let mut all: Vec<Ordered> = Vec::new();
    for order in orders.take_while(|_| !is_stopped.get()) {
        let options = FitOptions {
            pilot: Pilot { order },
            ..options.clone()
        };
        let whole = fit(&trials.fit, &options, observer)?;
        let is_answer = whole.is_answer();
        let held_out = match is_answer {
            true => held_out(trials, &options, &whole.theta, observer, &is_stopped)?,
            false => vec![f64::NAN; trials.fit.len()],
        };
        let (noise, samples) = noise(&whole);
        let states = free_initial_states(&trials.fit, &options);
        all.push(Ordered {
            order,
            figures: Contender {
                unknowns: 2 * order + states + 1,
                samples,
                surprise: samples as f64 * (1.0 + (TAU * noise).ln()),
                held_out,
            },
            fit: whole,
            is_whole: !is_stopped.get(),
        });
    }
    Ok(all)
}

/// −2 log likelihood of each trial by the pilot fitted to the other trials.
fn held_out(
    trials: &TrialSet,
    options: &FitOptions,
    theta: &[f64],
    observer: &mut Observer<'_>,
    is_stopped: &Cell<bool>,
) -> Result<Vec<f64>, FitError> {
    let begun = FitOptions {
        start: Some(theta.to_vec()),
        random_starts: Some(0),
        covariance: None,
        ..options.clone()
    };
    let without = |k: usize| {
        let mut others = trials.fit.clone();
        let own = others.remove(k);
        (others, own)
    };
    let mut all = Vec::new();
    for k in 0..trials.fit.len() {
        let (others, own) = without(k);
        all.push(match others.is_empty() || is_stopped.get() {
            true => f64::NAN,
            false => left_out(others, own, [&begun, options], observer)?,
        });
    }
    Ok(all)
}

/// −2 log likelihood of a trial by the pilot fitted to others: with the first of these options whose fit has an answer.
fn left_out(
    others: Vec<Trial>,
    own: Trial,
    options: [&FitOptions; 2],
    observer: &mut Observer<'_>,
) -> Result<f64, FitError> {
    let set = TrialSet {
        fit: others,
        validation: vec![own],
        ..TrialSet::default()
    };
    let [begun, anew] = options.map(Clone::clone);
    let mut found = Identification::new(set.clone(), begun, observer)?;
    if !found.fit.is_answer() {
        found = Identification::new(set, anew, observer)?;
    }
    let (noise, _) = noise(&found.fit);
    let flown = found.outcomes().last().and_then(|own| own.alone);
    let is_answer = found.fit.is_answer();
    let surprise = flown.filter(|_| is_answer).map(|run| {
        let known = run.residual.iter().filter(|e| e.is_finite());
        known.map(|e| e * e / noise + (TAU * noise).ln()).sum()
    });
    Ok(surprise.unwrap_or(f64::NAN))
}

/// Maximum likelihood estimate of the variance of a fit's residuals, and their number.
fn noise(fit: &super::Fit) -> (f64, usize) {
    let samples = fit.residuals().filter(|e| e.is_finite()).count();
    (fit.objective / samples.max(1) as f64, samples)
}
