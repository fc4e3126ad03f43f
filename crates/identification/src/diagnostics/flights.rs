//! Diagnostics of the recorded flights, the vehicle and the options.

use super::{Diagnostic, Fit, FitOptions, Trial};
use crate::{Mesh, Objective};
use pilotage_flights::checks;
use pilotage_flights::trials::{SATURATED, at_stop};
use pilotage_inference::is_stepped;

/// Longest mesh interval relative to the run.
const COARSE: f64 = 0.1;

/// The diagnostics of the flights.
pub fn diagnostics(fit: &Fit, options: &FitOptions, trials: &[Trial]) -> Vec<Diagnostic> {
    let mut checks = checks::of_motion(trials);
    if let Some(vehicle) = options.loop_vehicle() {
        checks.extend(checks::of_vehicle(vehicle, trials));
    }
    let with_fit = [
        stepped(options, trials),
        coarse_mesh(options, trials),
        saturated(fit, options, trials),
    ];
    let checks = checks.into_iter().map(Diagnostic::from);
    checks.chain(with_fit.into_iter().flatten()).collect()
}

/// Targets that jump within a run.
fn stepped(options: &FitOptions, trials: &[Trial]) -> Option<Diagnostic> {
    let mut trials = trials.iter();
    let own = trials.find(|own| is_stepped(&own.time, &own.target))?;
    (options.objective == Objective::Response).then(|| Diagnostic::SteppedTarget {
        run: own.name.clone(),
    })
}

fn coarse_mesh(options: &FitOptions, trials: &[Trial]) -> Option<Diagnostic> {
    let Mesh::Step(step) = options.mesh else {
        return None;
    };
    let duration = trials
        .iter()
        .map(Trial::duration)
        .fold(f64::INFINITY, f64::min);
    (step > COARSE * duration).then_some(Diagnostic::CoarseMesh { step, duration })
}

fn saturated(fit: &Fit, options: &FitOptions, trials: &[Trial]) -> Option<Diagnostic> {
    let sticks = trials.iter().filter_map(|trial| trial.stick.as_deref());
    // A human's stick stops at full deflection, whatever the limit of the fit is.
    let recorded = at_stop(&sticks.flatten().copied().collect::<Vec<_>>(), 1.0);
    let model: Vec<f64> = fit
        .runs
        .iter()
        .flat_map(|run| run.stick.iter().copied().filter(|u| u.is_finite()))
        .collect();
    let fitted = at_stop(&model, options.stick_limit).unwrap_or(0.0);
    let most = recorded.unwrap_or(0.0).max(fitted);
    (most >= SATURATED).then_some(Diagnostic::SaturatedStick { recorded, fitted })
}
