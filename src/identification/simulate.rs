//! A run flown by the identified pilot alone: the closed loop integrated from rest, without the
//! optimiser. What a fit is worth shows here, on the runs that it saw and on those that it did not.

use super::{RunFit, Trial};
use crate::models::{Dynamics, Joint, Quadcopter};

/// Integration step [s], at most.
const MAX_STEP: f64 = 5e-3;

/// The closed loop over a trial's times, from hover at the first recorded position with the pilot at
/// zero, by the classical Runge–Kutta method; the target is held from sample to sample. The stick is
/// not clipped: the model is linear. Residuals are positions [m].
pub fn simulate(joint: &Joint, theta: &[f64], trial: &Trial) -> RunFit {
    let start = trial.position.iter().copied().find(|z| z.is_finite());
    let mut x = Quadcopter::hover(start.unwrap_or(0.0)).to_vec();
    x.resize(joint.n_states(), 0.0);
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
        run.position.push(joint.measured(&x, &[target], theta));
        run.states.push(x.clone());
        run.stick.push(joint.bounded(&x, &[target], theta));
        run.residual.push(trial.position[k] - run.position[k]);
        if let Some(next) = trial.time.get(k + 1) {
            advance(joint, theta, target, next - trial.time[k], &mut x);
        }
    }
    run
}

/// Advances the states by `duration` [s].
fn advance(joint: &Joint, theta: &[f64], target: f64, duration: f64, x: &mut [f64]) {
    let steps = (duration / MAX_STEP).ceil().max(1.0);
    let h = duration / steps;
    let derivative = |x: &[f64]| {
        let mut dx = vec![0.0; x.len()];
        joint.derivative(x, &[target], theta, &mut dx);
        dx
    };
    let along = |x: &[f64], dx: &[f64], h: f64| -> Vec<f64> {
        x.iter().zip(dx).map(|(x, dx)| x + h * dx).collect()
    };
    for _ in 0..steps as usize {
        let k1 = derivative(x);
        let k2 = derivative(&along(x, &k1, h / 2.0));
        let k3 = derivative(&along(x, &k2, h / 2.0));
        let k4 = derivative(&along(x, &k3, h));
        for i in 0..x.len() {
            x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::Pilot;
    use crate::models::pilot::PAPER_THETA;

    /// docs/method.md: the printed θ brings the vehicle to about 5 m for a 10 m target.
    #[test]
    fn the_published_parameters_never_reach_the_target() {
        let n = 301;
        let trial = Trial {
            name: "10m".into(),
            origin: String::new(),
            sha256: String::new(),
            time: (0..n).map(|k| k as f64 * 0.05).collect(),
            target: vec![10.0; n],
            position: vec![0.0; n],
            stick: None,
            weight: 1.0,
        };
        let run = simulate(
            &Joint {
                vehicle: Quadcopter::default(),
                pilot: Pilot::default(),
            },
            &PAPER_THETA,
            &trial,
        );
        let greatest = run.position.iter().copied().fold(0.0, f64::max);
        let last = run.position[n - 1];
        assert!(
            greatest < 8.0 && (4.0..6.0).contains(&last),
            "{greatest}, {last}"
        );
    }
}
