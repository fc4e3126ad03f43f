//! The paper's problem, built from trials and options.

use super::constraints::{RouthHurwitz, Stability};
use super::joint::{Joint, open_loop};
use super::{FitOptions, InitialPosition, InitialState, Mesh, Objective, Trial};
use pilotage_collocation::{Bound, Collocation, Differentiated, ParameterConstraints};
use pilotage_collocation::{Loss, Recording, Run, Scales};
use pilotage_expression::System;
use pilotage_flights::vehicle::LinearVehicle;
use pilotage_models::Quadcopter;
use std::sync::Arc;

impl Mesh {
    /// Interval boundaries \[s\] for samples at these times.
    pub fn boundaries(self, time: &[f64]) -> Vec<f64> {
        let (start, end) = (time[0], time[time.len() - 1]);
        match self {
            Self::Samples => time.to_vec(),
            Self::Step(h) => {
                let intervals = Self::intervals(time, h) as usize;
                let at = |k: usize| start + (end - start) * (k as f64 / intervals as f64);
                (0..intervals).map(at).chain([end]).collect()
            }
        }
    }

    /// Number of intervals of about `step` seconds between the first and the last sample.
    pub fn intervals(time: &[f64], step: f64) -> f64 {
        ((time[time.len() - 1] - time[0]) / step).round().max(1.0)
    }
}

/// A fit problem before its discretisation.
pub struct Posed {
    /// The model: its first output is measured, the second is bounded.
    pub model: Arc<Differentiated>,
    /// Conditions on θ.
    pub stability: Stability,
    constraints: ParameterConstraints,
    /// The runs.
    pub runs: Vec<Run>,
}

impl Posed {
    fn new(system: &System, stability: Stability, runs: Vec<Run>) -> Self {
        Self {
            model: Arc::new(Differentiated::new(system)),
            constraints: stability.constraints(),
            stability,
            runs,
        }
    }

    /// The nonlinear program.
    pub fn discretised(&self, options: &FitOptions, scales: Scales) -> Collocation {
        Collocation::new(
            self.model.clone(),
            self.constraints.clone(),
            options.scheme,
            self.runs.clone(),
            scales,
            &[Bound::at_samples(-options.stick_limit, options.stick_limit)],
        )
    }
}

/// The response problem (paper, eq. 5), discretised.
pub fn response(trials: &[Trial], options: &FitOptions, scales: Scales) -> Collocation {
    pose_response(trials, options).discretised(options, scales)
}

/// The stick problem, discretised: stick residuals of the pilot with the recorded error as input.
pub fn stick(trials: &[Trial], options: &FitOptions, scales: Scales) -> Collocation {
    pose_stick(trials, options).discretised(options, scales)
}

/// The response problem (paper, eq. 5).
pub fn pose_response(trials: &[Trial], options: &FitOptions) -> Posed {
    let joint = Joint {
        vehicle: options.vehicle,
        pilot: options.pilot,
    };
    let runs = trials.iter().map(|trial| Run {
        mesh: options.mesh.boundaries(&trial.time),
        time: trial.time.clone(),
        inputs: trial.target.iter().map(|t| vec![*t]).collect(),
        measured: recording(trial, trial.position.clone()),
        initial: known_states(trial, options),
    });
    let stability = Stability {
        pilot: RouthHurwitz {
            pilot: options.pilot,
        },
        vehicle: options.kept_vehicle().map(LinearVehicle::of),
    };
    Posed::new(&joint.system(), stability, runs.collect())
}

/// The recording of a trial's only measured output.
fn recording(trial: &Trial, values: Vec<f64>) -> Vec<Recording> {
    let weight = trial.weight;
    vec![Recording {
        values,
        weight,
        loss: Loss::Square,
    }]
}

/// Known states of vehicle and pilot at the first sample.
fn known_states(trial: &Trial, options: &FitOptions) -> Vec<Option<f64>> {
    let vehicle = Quadcopter::hover(trial.origin());
    let vehicle_known = options.initial_state != InitialState::Free;
    let mut known: Vec<Option<f64>> = vehicle.map(|x| vehicle_known.then_some(x)).to_vec();
    if options.initial_position == InitialPosition::Estimated {
        known[0] = None;
    }
    known.into_iter().chain(known_pilot(options)).collect()
}

/// Known states of the pilot at the first sample.
fn known_pilot(options: &FitOptions) -> Vec<Option<f64>> {
    let known = (options.initial_state == InitialState::AtRest).then_some(0.0);
    vec![known; options.pilot.order]
}

/// Number of unknown initial states of all trials.
pub fn free_initial_states(trials: &[Trial], options: &FitOptions) -> usize {
    let known = |trial: &Trial| match options.objective {
        Objective::Response => known_states(trial, options),
        Objective::Stick => known_pilot(options),
    };
    let unknown = |trial: &Trial| known(trial).iter().filter(|state| state.is_none()).count();
    trials.iter().map(unknown).sum()
}

/// The stick problem.
pub fn pose_stick(trials: &[Trial], options: &FitOptions) -> Posed {
    let runs = trials.iter().map(|trial| Run {
        mesh: options.mesh.boundaries(&trial.time),
        time: trial.time.clone(),
        inputs: recorded_error(trial).into_iter().map(|e| vec![e]).collect(),
        measured: recording(
            trial,
            (trial.stick.clone()).unwrap_or_else(|| vec![f64::NAN; trial.time.len()]),
        ),
        initial: known_pilot(options),
    });
    let stability = Stability {
        pilot: RouthHurwitz {
            pilot: options.pilot,
        },
        vehicle: None,
    };
    Posed::new(&open_loop(options.pilot), stability, runs.collect())
}

/// The error ŷ - y_v seen by the pilot at each sample \[m\], with gaps filled.
pub fn recorded_error(trial: &Trial) -> Vec<f64> {
    let position = fill_gaps(&trial.time, &trial.position);
    trial
        .target
        .iter()
        .zip(position)
        .map(|(t, z)| t - z)
        .collect()
}

/// The signal with missing samples (NaN) filled by linear interpolation, constant at the ends.
pub fn fill_gaps(time: &[f64], values: &[f64]) -> Vec<f64> {
    let known: Vec<usize> = (0..values.len())
        .filter(|&k| values[k].is_finite())
        .collect();
    let fill = |k: usize| {
        let after = known.partition_point(|&i| i < k);
        match (
            after.checked_sub(1).map(|i| known[i]),
            known.get(after).copied(),
        ) {
            (_, Some(b)) if b == k => values[k],
            (Some(a), Some(b)) => {
                values[a] + (values[b] - values[a]) * (time[k] - time[a]) / (time[b] - time[a])
            }
            (Some(a), None) => values[a],
            (None, Some(b)) => values[b],
            (None, None) => 0.0,
        }
    };
    (0..values.len()).map(fill).collect()
}
