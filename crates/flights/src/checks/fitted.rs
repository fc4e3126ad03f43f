//! What flights and their vehicle let doubt of a fit, beside what the fit finds in any recording.

use super::{Check, of_vehicle, recorded, samples, vehicle};
use crate::FlightOptions;
use crate::options::{InitialState, Objective};
use crate::trials::Trial;
use crate::vehicle::ClosedLoop;
use pilotage_estimation::result::RunFit;
use pilotage_estimation::{Diagnostic, Doubt, Fit};
use pilotage_inference::outliers::{self, Values};
use pilotage_models::Pilot;

/// The diagnostics of fitted flights, those that make the result meaningless first. Where nothing moves, they alone.
pub fn doubts(fit: &Fit, trials: &[Trial], options: &FlightOptions) -> Vec<Diagnostic> {
    let told = |own: &Check| {
        let mut known = fit.diagnostics.iter();
        known.any(|known| known.code() == own.code())
    };
    let mut found = recorded(trials);
    // Without residuals the recordings themselves have to tell why.
    found.retain(|own| (is_beside(own) || !fit.is_met()) && !told(own));
    if options.objective == Objective::Response || options.vehicle_file.is_some() {
        // That the motion contradicts the stick is told by more than its sign, if it was looked at.
        let is_told = fit
            .diagnostics
            .iter()
            .any(|own| matches!(own, Diagnostic::Contradicting(_)));
        let of_vehicle = of_vehicle(&options.vehicle, trials).into_iter();
        found.extend(of_vehicle.filter(|own| !(is_told && matches!(own, Check::StickSign { .. }))));
    }
    found.extend(moving(fit, trials, options));
    if found.contains(&Check::ConstantData) {
        found.retain(Check::is_fatal);
    }
    let doubt = |own: Check| Doubt {
        code: own.code(),
        words: own.to_string(),
        is_fatal: own.is_fatal(),
    };
    let found = found.into_iter().map(doubt);
    let mut all: Vec<Doubt> = unstable(fit, options).into_iter().chain(found).collect();
    all.sort_by_key(|own| !own.is_fatal);
    all.into_iter().map(Diagnostic::Beside).collect()
}

/// A pilot fitted to the stick, who would leave the target with the vehicle that is named.
fn unstable(fit: &Fit, options: &FlightOptions) -> Option<Doubt> {
    let is_known = options.objective == Objective::Stick && options.vehicle_file.is_some();
    let order = options.order;
    let theta = (1..=2 * order).map(|k| fit.value(&format!("pilot.theta{k}")));
    let theta: Vec<f64> = theta.collect::<Option<_>>().filter(|_| is_known)?;
    let closed_loop = ClosedLoop::of(options.vehicle, Pilot { order }, &theta);
    let pole = closed_loop.rightmost()?.re;
    (!closed_loop.is_stable()).then(|| Doubt {
        code: "unstable-loop",
        words: format!(
            "with this vehicle the pilot has a pole at {pole:+.2e} 1/s, so it leaves the target when it is flown; a fit of the \
             response keeps the loop stable"
        ),
        is_fatal: options.stable_loop,
    })
}

/// Whether a fit does not look for it in residuals, which tell more.
fn is_beside(check: &Check) -> bool {
    !matches!(check, Check::Outlier { .. } | Check::Jump { .. })
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
