//! The paper's problem from trials and options.

use super::closed_loop::LinearVehicle;
use super::constraints::{RouthHurwitz, Stability};
use super::{InitialPosition, InitialState, Mesh, Options, Trial};
use crate::transcription::{Collocation, Run, Scales};
use pilotage_models::{Dynamics, Joint, OpenLoopPilot, Quadcopter, quadcopter};

/// The problem of the response fit: pilot and vehicle in closed loop.
pub type ResponseProblem = Collocation<Joint, Stability>;
/// The problem of the stick fit: the pilot alone, driven by the recorded error.
pub type StickProblem = Collocation<OpenLoopPilot, Stability>;

impl Mesh {
    /// Interval boundaries [s] for samples at these times.
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

    /// How many intervals of about `step` seconds lie between the first and the last sample.
    pub fn intervals(time: &[f64], step: f64) -> f64 {
        ((time[time.len() - 1] - time[0]) / step).round().max(1.0)
    }
}

/// The response problem (paper, eq. 5).
pub fn response(trials: &[Trial], options: &Options, scales: Scales) -> ResponseProblem {
    let joint = Joint {
        vehicle: options.vehicle,
        pilot: options.pilot,
    };
    let runs = trials.iter().map(|trial| {
        let z0 = trial
            .position
            .iter()
            .copied()
            .find(|z| z.is_finite())
            .unwrap_or(0.0);
        let mut initial = vec![None; joint.n_states()];
        if options.initial_state != InitialState::Free {
            let hover = Quadcopter::hover(z0);
            initial
                .iter_mut()
                .zip(hover)
                .for_each(|(known, value)| *known = Some(value));
        }
        if options.initial_state == InitialState::AtRest {
            initial[quadcopter::N_STATES..].fill(Some(0.0));
        }
        if options.initial_position == InitialPosition::Estimated {
            initial[0] = None;
        }
        Run {
            mesh: options.mesh.boundaries(&trial.time),
            time: trial.time.clone(),
            inputs: trial.target.iter().map(|t| vec![*t]).collect(),
            measured: trial.position.clone(),
            weight: trial.weight,
            initial,
        }
    });
    let kept = Some(LinearVehicle::of(&options.vehicle)).filter(|_| options.stable_loop);
    collocation(joint, kept, runs.collect(), options, scales)
}

/// The stick problem: stick residuals of the pilot that sees the recorded error.
pub fn stick(trials: &[Trial], options: &Options, scales: Scales) -> StickProblem {
    let pilot = OpenLoopPilot {
        pilot: options.pilot,
    };
    let known = (options.initial_state == InitialState::AtRest).then_some(0.0);
    let runs = trials.iter().map(|trial| Run {
        mesh: options.mesh.boundaries(&trial.time),
        time: trial.time.clone(),
        inputs: recorded_error(trial).into_iter().map(|e| vec![e]).collect(),
        measured: trial
            .stick
            .clone()
            .unwrap_or_else(|| vec![f64::NAN; trial.time.len()]),
        weight: trial.weight,
        initial: vec![known; pilot.n_states()],
    });
    collocation(pilot, None, runs.collect(), options, scales)
}

fn collocation<D: Dynamics>(
    dynamics: D,
    vehicle: Option<LinearVehicle>,
    runs: Vec<Run>,
    options: &Options,
    scales: Scales,
) -> Collocation<D, Stability> {
    let pilot = RouthHurwitz {
        pilot: options.pilot,
    };
    let constraints = Stability { pilot, vehicle };
    Collocation::new(
        dynamics,
        constraints,
        options.scheme,
        runs,
        scales,
        options.stick_limit,
    )
}

/// The error ŷ - y_v that the pilot saw at each sample [m], gaps filled.
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
