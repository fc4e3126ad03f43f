//! Simulation of a run with the identified pilot alone: the closed loop integrated from rest, without the optimiser. It
//! shows the quality of a fit, on the runs of the fit and on others.

use super::joint::Joint;
use super::{RunFit, Trial};
use pilotage_flights::vehicle::{MAX_STEP, fly};
use pilotage_models::lti::{Transition, TransitionError};
use pilotage_models::{Quadcopter, quadcopter::N_STATES};

/// Longest run that is simulated for display \[s\]: it takes some seconds.
pub const LONGEST: f64 = 1e4;

/// Maximum duration of a simulation in [`departure`] [s]: the slowest mode within the stability bound decays to a
/// third.
const LONG: f64 = 1000.0;
/// Time between checks of such a simulation [s].
const LOOK: f64 = 1.0;
/// It has settled if the error stays below this part of the step ...
const SETTLED: f64 = 0.05;
/// ... for this number of checks.
const STEADY: usize = 60;
/// It has left if the error exceeds this multiple of the step.
const GONE: f64 = 10.0;

/// Simulates the closed loop over a trial's times, from hover at the first recorded position with the pilot's states
/// zero. The target is linear between samples, as in the fit. The stick is not clipped, since the pilot is linear.
/// Residuals are positions \[m\].
///
/// A fitted pilot may have very fast poles, so its steps are exact (matrix exponential); those of the vehicle use the
/// classical Runge–Kutta method.
///
/// # Errors
/// If the pilot is so fast that its exponential has no correct digits.
pub fn simulate(joint: &Joint, theta: &[f64], trial: &Trial) -> Result<RunFit, TransitionError> {
    simulate_from(joint, theta, trial, &at_rest(joint, trial.origin()))
}

/// States of a vehicle that hovers at `position` \[m\] and of a pilot with zero states.
pub fn at_rest(joint: &Joint, position: f64) -> Vec<f64> {
    let mut x = Quadcopter::hover(position).to_vec();
    x.resize(joint.n_states(), 0.0);
    x
}

/// As [`simulate`], from these states of vehicle and pilot.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_from(
    joint: &Joint,
    theta: &[f64],
    trial: &Trial,
    states: &[f64],
) -> Result<RunFit, TransitionError> {
    let mut x = states.to_vec();
    let mut run = RunFit {
        name: trial.name.clone(),
        time: trial.time.clone(),
        target: trial.target.clone(),
        position: Vec::new(),
        stick: Vec::new(),
        residual: Vec::new(),
        states: Vec::new(),
    };
    for (k, &target) in trial.target.iter().enumerate() {
        run.position.push(joint.vehicle.output(&x));
        run.stick.push(joint.pilot.output(&x[N_STATES..], theta));
        run.residual.push(trial.position[k] - run.position[k]);
        run.states.push(x.clone());
        if let Some(next) = trial.time.get(k + 1) {
            let duration = next - trial.time[k];
            let task = Task {
                target,
                rate: (trial.target[k + 1] - target) / duration,
                limit: f64::INFINITY,
            };
            advance(joint, theta, task, duration, &mut x)?;
        }
    }
    Ok(run)
}

/// A loop that does not reach its target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Departure {
    /// Time at which the simulation was ended \[s\].
    pub time: f64,
    /// Largest distance from the target in the last third of that time \[m\].
    pub error: f64,
}

/// Simulates a step of `step` metres from rest until the loop settles, with the stick limited to ±`limit`. Returns the
/// departure if it leaves or does not settle within a thousand seconds. This may happen even with stable poles, since
/// the linear analysis does not include the limits of the stick.
///
/// # Errors
/// As [`simulate`].
pub fn departure(
    joint: &Joint,
    theta: &[f64],
    limit: f64,
    step: f64,
) -> Result<Option<Departure>, TransitionError> {
    let mut x = at_rest(joint, 0.0);
    let mut errors: Vec<f64> = Vec::new();
    let mut steady = 0;
    let task = Task {
        target: step,
        rate: 0.0,
        limit,
    };
    while steady < STEADY && (errors.len() as f64) * LOOK < LONG {
        advance(joint, theta, task, LOOK, &mut x)?;
        let error = (step - joint.vehicle.output(&x)).abs();
        errors.push(error);
        // NaN counts as far from the target.
        if error.is_nan() || error >= GONE * step.abs() {
            break;
        }
        steady = match error < SETTLED * step.abs() {
            true => steady + 1,
            false => 0,
        };
    }
    let last = &errors[2 * errors.len() / 3..];
    let error = last.iter().fold(0.0, |most: f64, e| most.max(*e));
    let time = errors.len() as f64 * LOOK;
    let near = errors[errors.len() - 1] < GONE * step.abs();
    let settles = near && (steady == STEADY || error < step.abs());
    Ok((!settles).then_some(Departure { time, error }))
}

/// Input of a pilot over some time.
#[derive(Clone, Copy)]
struct Task {
    /// The target at the start [m].
    target: f64,
    /// Its rate [m/s].
    rate: f64,
    /// Limit of the stick.
    limit: f64,
}

/// Advances the states by `duration` [s].
fn advance(
    joint: &Joint,
    theta: &[f64],
    task: Task,
    duration: f64,
    x: &mut [f64],
) -> Result<(), TransitionError> {
    let pilot = joint.pilot;
    let steps = (duration / MAX_STEP).ceil().max(1.0);
    let h = duration / steps;
    let transition = Transition::new([pilot.order, 1], h, |x, u, dx| {
        pilot.derivative(x, u[0], theta, dx);
    })?;
    let mut next = vec![0.0; pilot.order];
    let (x_v, x_p) = x.split_at_mut(N_STATES);
    let stick = |x_p: &[f64]| pilot.output(x_p, theta).clamp(-task.limit, task.limit);
    for i in 0..steps as usize {
        let before = stick(x_p);
        let target = task.target + task.rate * h * i as f64;
        let (error, slope) = error_ahead(&joint.vehicle, target, x_v, before, h);
        transition.apply(x_p, &[error], &[task.rate + slope], &mut next);
        x_p.copy_from_slice(&next);
        fly(&joint.vehicle, x_v, before, stick(x_p), h);
    }
    Ok(())
}

/// Current error [m], and its mean rate over the next `h` seconds [m/s]: the stick reaches the position through four
/// integrations, so velocity and acceleration predict it to third order.
fn error_ahead(vehicle: &Quadcopter, target: f64, x_v: &[f64], stick: f64, h: f64) -> (f64, f64) {
    let mut dx = [0.0; N_STATES];
    vehicle.derivative(x_v, stick, &mut dx);
    let (velocity, acceleration) = (dx[0], dx[2]);
    (
        target - vehicle.output(x_v),
        -(velocity + 0.5 * h * acceleration),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use pilotage_models::Pilot;
    use pilotage_models::pilot::PAPER_THETA;

    fn trial() -> Trial {
        let n = 301;
        Trial {
            name: "10m".into(),
            origin: String::new(),
            sha256: String::new(),
            time: (0..n).map(|k| k as f64 * 0.05).collect(),
            target: vec![10.0; n],
            position: vec![0.0; n],
            stick: None,
            weight: 1.0,
        }
    }

    fn joint(order: usize) -> Joint {
        Joint {
            vehicle: Quadcopter::default(),
            pilot: Pilot { order },
        }
    }

    /// docs/method.md: the printed θ brings the vehicle to about 5 m for a 10 m target.
    #[test]
    fn the_published_parameters_never_reach_the_target() {
        let run = simulate(&joint(3), &PAPER_THETA, &trial()).unwrap();
        let greatest = run.position.iter().copied().fold(0.0, f64::max);
        let last = run.position[300];
        assert!(
            greatest < 8.0 && (4.0..6.0).contains(&last),
            "{greatest}, {last}"
        );
    }

    /// The joint ODE by the Runge–Kutta method with steps of 1 ms, as a simple reference.
    #[test]
    fn the_coupled_steps_follow_the_joint_ode() {
        let (joint, theta) = (joint(3), [216.0, 108.0, 18.0, -6.48, -16.2, -0.5]);
        let run = simulate(&joint, &theta, &trial()).unwrap();
        let mut x = vec![0.0; 9];
        let model = pilotage_collocation::Differentiated::new(&joint.system());
        let slope = |x: &[f64]| {
            let all = model.evaluate(0.0, x, &[10.0], &theta);
            all[..9].to_vec()
        };
        let along = |x: &[f64], dx: &[f64], h: f64| -> Vec<f64> {
            x.iter().zip(dx).map(|(x, dx)| x + h * dx).collect()
        };
        for _ in 0..15_000 {
            let k1 = slope(&x);
            let k2 = slope(&along(&x, &k1, 5e-4));
            let k3 = slope(&along(&x, &k2, 5e-4));
            let k4 = slope(&along(&x, &k3, 1e-3));
            (0..9).for_each(|i| x[i] += 1e-3 / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        }
        assert!(
            (run.position[300] - x[0]).abs() < 1e-5,
            "{} {}",
            run.position[300],
            x[0]
        );
    }

    /// The fit to a human whose own loop is unstable: its slowest pair is at -0.001 ± 0.55i 1/s. From 18 m the stick
    /// reaches its stops; without them the same loop settles.
    #[test]
    fn a_loop_may_leave_though_its_poles_are_stable() {
        let theta = [1.66473, 3.67618, 5.13526, -0.0703582, -0.130389, -0.280807];
        let of = |limit, step| departure(&joint(3), &theta, limit, step).unwrap();
        let left = of(1.0, 18.0).unwrap();
        assert!(left.error > 100.0 && left.time < LONG, "{left:?}");
        assert_eq!([of(1.0, 1.0), of(f64::INFINITY, 1.0)], [None, None]);
    }

    /// A pilot with an additional pole at -1e6 1/s behaves like the pilot without it.
    #[test]
    fn a_pole_that_ran_away_is_no_trouble() {
        let slow = [1.426, 1.771, -0.0003, -0.0713];
        let fast = 1e6;
        // The slow pilot times fast/(s + fast).
        let theta = [
            fast * slow[0],
            fast * slow[1] + slow[0],
            fast + slow[1],
            fast * slow[2],
            fast * slow[3],
            0.0,
        ];
        let with = simulate(&joint(3), &theta, &trial()).unwrap();
        let without = simulate(&joint(2), &slow, &trial()).unwrap();
        let difference = (with.position.iter().zip(&without.position)).map(|(a, b)| (a - b).abs());
        assert!(difference.fold(0.0, f64::max) < 1e-3);
    }
}
