//! What flights and their vehicle let doubt of a fit, beside what a fit finds in any recording.

mod vehicle;

use crate::FlightOptions;
use crate::options::{InitialState, Objective};
use crate::trials::{Trial, TrialSet};
use crate::vehicle::ClosedLoop;
use pilotage_estimation::result::RunFit;
use pilotage_estimation::result::through::contradicting;
use pilotage_estimation::{Diagnostic, Doubt, Fit, Posed};
use pilotage_inference::outliers::{self, Values};
use pilotage_models::Pilot;

/// Codes of what is asked of flights alone.
pub const CODES: [&str; 3] = [
    vehicle::MOVING_START,
    vehicle::VEHICLE_SIZE,
    vehicle::VEHICLE_UNSTABLE,
];

/// The diagnostics of fitted flights, those that make the result meaningless first.
pub fn doubts(fit: &Fit, trials: &TrialSet, options: &FlightOptions) -> Vec<Diagnostic> {
    let mut found: Vec<Doubt> = unstable(fit, options).into_iter().collect();
    if options.objective == Objective::Response || options.vehicle_file.is_some() {
        found.extend(vehicle::doubts(&options.vehicle));
    }
    found.extend(moving(fit, &trials.fit, options));
    found.sort_by_key(|own| !own.is_fatal);
    let found = found.into_iter().map(Diagnostic::Beside);
    found.chain(open_loop(trials, options)).collect()
}

/// The named vehicle does not answer the fitted stick as recorded. It is no part of the problem.
fn open_loop(trials: &TrialSet, options: &FlightOptions) -> Vec<Diagnostic> {
    let is_known = options.objective == Objective::Stick && options.vehicle_file.is_some();
    let response = FlightOptions {
        objective: Objective::Response,
        ..options.clone()
    };
    let Some(file) = response.problem(trials).ok().filter(|_| is_known) else {
        return Vec::new();
    };
    let posed = Posed::new(&file, &crate::open).ok();
    let all = posed.iter().flat_map(contradicting);
    all.map(Diagnostic::Contradicting).collect()
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

/// A run that is fitted from rest but moves at its start, by more than the noise of its positions explains.
fn moving(fit: &Fit, trials: &[Trial], options: &FlightOptions) -> Option<Doubt> {
    if options.initial_state == InitialState::Free || options.objective != Objective::Response {
        return None;
    }
    let left = |(trial, run): (&Trial, &RunFit)| {
        let pairs = run.recorded[0].iter().zip(&run.predicted[0]);
        let residuals = match fit.is_met() {
            true => pairs.map(|(y, h)| y - h).collect(),
            false => trial.position.clone(),
        };
        Values {
            time: trial.time.clone(),
            values: outliers::of_fresh(residuals, &trial.position),
            resolution: 0.0,
            modelled: Vec::new(),
        }
    };
    let left: Vec<Values> = trials.iter().zip(&fit.runs).map(left).collect();
    let noise = outliers::noise(&left);
    vehicle::moving(&options.vehicle, options.stick_limit, noise, trials)
}
