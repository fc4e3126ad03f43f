//! What flights and their vehicle let doubt of a fit, beside what the fit finds in any recording.

use super::{Check, of_motion, of_vehicle, recorded, samples, vehicle};
use crate::FlightOptions;
use crate::options::{InitialState, Objective};
use crate::trials::Trial;
use pilotage_estimation::result::RunFit;
use pilotage_estimation::{Diagnostic, Doubt, Fit};
use pilotage_inference::outliers::{self, Values};

/// The diagnostics of fitted flights, those that make the result meaningless first. Where nothing moves, they alone.
pub fn doubts(fit: &Fit, trials: &[Trial], options: &FlightOptions) -> Vec<Diagnostic> {
    // Without residuals the recordings themselves have to tell why.
    let mut found: Vec<Check> = match fit.is_met() {
        true => of_motion(trials).into_iter().filter(is_beside).collect(),
        false => recorded(trials),
    };
    if options.objective == Objective::Response {
        found.extend(of_vehicle(&options.vehicle, trials));
    }
    if fit.is_met() {
        found.extend(trials.iter().find_map(samples::target_outlier));
    }
    found.extend(moving(fit, trials, options));
    if found.contains(&Check::ConstantData) {
        found.retain(Check::is_fatal);
    }
    found.sort_by_key(|own| !own.is_fatal());
    let doubt = |own: Check| {
        Diagnostic::Beside(Doubt {
            code: own.code(),
            words: own.to_string(),
            is_fatal: own.is_fatal(),
        })
    };
    found.into_iter().map(doubt).collect()
}

/// Whether a fit does not look for it itself, in residuals or in any recording.
fn is_beside(check: &Check) -> bool {
    !matches!(check, Check::TimeScale { .. } | Check::Copy { .. })
}

/// A run that is fitted from rest but moves at its start, by more than the noise of its positions explains.
fn moving(fit: &Fit, trials: &[Trial], options: &FlightOptions) -> Option<Check> {
    if options.initial_state == InitialState::Free || options.objective != Objective::Response {
        return None;
    }
    let left = |(trial, run): (&Trial, &RunFit)| {
        let pairs = run.recorded[0].iter().zip(&run.predicted[0]);
        let residuals = match fit.is_met() {
            true => pairs.map(|(y, h)| y - h).collect(),
            false => trial.position.clone(),
        };
        samples::values(trial, residuals)
    };
    let left: Vec<Values> = trials.iter().zip(&fit.runs).map(left).collect();
    let noise = outliers::noise(&left);
    vehicle::moving(&options.vehicle, options.stick_limit, noise, trials)
}
