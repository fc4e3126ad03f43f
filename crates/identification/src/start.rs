//! Starts from the data, so that the user need not give one.

use super::problem::{fill_gaps, recorded_error};
use super::{FitOptions, Trial};
use nalgebra::{Complex, DMatrix, DVector};
use pilotage_collocation::rk4;
use pilotage_flights::checks::implied::{self, Smoothed};
use pilotage_models::lti::Transition;
use pilotage_models::{Pilot, Quadcopter, quadcopter};

/// Poles of the regressions' filters [1/s]: about the bandwidth of a human who flies to a target.
const FILTERS: [f64; 2] = [0.5, 1.0];
/// Locations of a coinciding pole and zero, relative to the corner frequency.
const PAIRS: [f64; 3] = [1.5, 0.1, 10.0];
/// Relative difference below which two sampling steps are equal.
const SAME_STEP: f64 = 1e-9;
/// Magnitude of the fastest pole of a start [1/s].
const FASTEST: f64 = 30.0;
/// Reaction time of a pilot [s], for the estimate of gain and lead.
const REACTION: f64 = 0.2;

/// Smoothed position of a run.
fn smoothed(trial: &Trial) -> Smoothed {
    implied::smooth(&trial.time, &fill_gaps(&trial.time, &trial.position))
}

/// The stick of a run: the recorded one if available, else that of the inverted vehicle.
pub fn implied_stick(trial: &Trial, vehicle: &Quadcopter) -> Vec<f64> {
    match &trial.stick {
        // A stick that never moves was not recorded.
        Some(stick) if stick.iter().any(|u| u.is_finite() && *u != 0.0) => {
            fill_gaps(&trial.time, stick)
        }
        _ => {
            let position = fill_gaps(&trial.time, &trial.position);
            implied::implied_stick(&trial.time, &position, vehicle)
        }
    }
}

/// Selects trials at equal distances in order of their largest error, so that they represent all trials whatever their
/// original order.
pub fn spread(trials: &[Trial], count: usize) -> Vec<Trial> {
    let size = |trial: &Trial| {
        let errors = recorded_error(trial).into_iter();
        errors.fold(0.0, |most: f64, error| most.max(error.abs()))
    };
    let mut sorted: Vec<(f64, &Trial)> = trials.iter().map(|t| (size(t), t)).collect();
    sorted.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    (0..count)
        .map(|i| sorted[i * trials.len() / count].1.clone())
        .collect()
}

/// θ by linear regression of stick on error: the transfer function multiplied by its denominator, with every signal
/// filtered by `1/(s + ω)^n` (Young, *Recursive Estimation and Time-Series Analysis*, 2nd ed. 2011, ch. 8:
/// state-variable filters), ridge-regularised, then stabilised.
pub fn regression(trials: &[Trial], sticks: &[Vec<f64>], pilot: Pilot, filter: f64) -> Vec<f64> {
    let n = pilot.order;
    let mut normal = DMatrix::<f64>::zeros(2 * n, 2 * n);
    let mut right = DVector::<f64>::zeros(2 * n);
    for (trial, stick) in trials.iter().zip(sticks) {
        let error = recorded_error(trial);
        let u = filtered_derivatives(&trial.time, stick, n, filter);
        let e = filtered_derivatives(&trial.time, &error, n, filter);
        for k in 0..trial.time.len() {
            let row = DVector::from_fn(2 * n, |i, _| if i < n { -u[k][i] } else { e[k][i - n] });
            normal += &row * row.transpose() * trial.weight;
            right += row * (u[k][n] * trial.weight);
        }
    }
    let scale = DVector::from_fn(2 * n, |i, _| normal[(i, i)].sqrt().max(1e-12));
    let scaled = DMatrix::from_fn(2 * n, 2 * n, |i, j| {
        normal[(i, j)] / (scale[i] * scale[j]) + f64::from(i == j) * 1e-8
    });
    let solution = scaled.lu().solve(&right.component_div(&scale));
    let theta: Vec<f64> = solution.map_or(vec![0.0; 2 * n], |s| {
        s.component_div(&scale).as_slice().to_vec()
    });
    stabilised(pilot, &theta)
}

/// Starts for a pilot of first or second order: one with gain and lead estimated from the stick, and a regression of
/// the stick on the error for each filter.
///
/// With `u ≈ k_p e + k_d ė` the closed loop's bandwidth is about `√(|k_p| g φ_max)`. The first start has poles at twice
/// this frequency and a tenth of the gain, since the recorded humans rely mainly on the rate.
pub fn low_order(trials: &[Trial], sticks: &[Vec<f64>], options: &FitOptions) -> Vec<Vec<f64>> {
    let (k_p, k_d) = proportional_derivative(trials, sticks);
    let w = corner(k_p, options);
    let shape = match options.pilot.order {
        1 => vec![w, k_p * w],
        _ => vec![w * w, 1.4 * w, 0.1 * k_p * w * w, k_d * w * w],
    };
    [shape]
        .into_iter()
        .chain(regressions(trials, sticks, options))
        .collect()
}

/// Regressions of the stick on the error, one for each filter.
pub fn regressions(trials: &[Trial], sticks: &[Vec<f64>], options: &FitOptions) -> Vec<Vec<f64>> {
    FILTERS
        .iter()
        .map(|filter| regression(trials, sticks, options.pilot, *filter))
        .collect()
}

/// Starts for a pilot of one order more than the fitted `theta`: the same transfer function with a coinciding pole and
/// zero that are slow, in the middle, or fast. All of them behave as `theta` does, and moving the pair apart can only
/// improve the fit.
///
/// A cancelling pair contains no information for the solver about its best location, and each of the three locations
/// leads to optima that the others miss: an integrating pilot, an interior one, and one whose fastest pole diverges.
pub fn with_pair(
    theta: &[f64],
    trials: &[Trial],
    sticks: &[Vec<f64>],
    options: &FitOptions,
) -> Vec<Vec<f64>> {
    let w = corner(proportional_derivative(trials, sticks).0, options);
    let (den, num) = theta.split_at(theta.len() / 2);
    let monic: Vec<f64> = den.iter().copied().chain([1.0]).collect();
    let pair = |place: &f64| -> Vec<f64> {
        let mut raised = times(&monic, place * w);
        raised.pop();
        raised.into_iter().chain(times(num, place * w)).collect()
    };
    PAIRS.iter().map(pair).collect()
}

/// Coefficients, in ascending order, of a polynomial times `(s + root)`.
fn times(c: &[f64], root: f64) -> Vec<f64> {
    let at = |i: usize| c.get(i).copied().unwrap_or(0.0);
    (0..=c.len())
        .map(|i| root * at(i) + if i > 0 { at(i - 1) } else { 0.0 })
        .collect()
}

/// Twice the closed loop's bandwidth for the gain `k_p` [1/s].
fn corner(k_p: f64, options: &FitOptions) -> f64 {
    let plant = options.vehicle.gravity * options.vehicle.max_pitch;
    (2.0 * (k_p.abs() * plant).sqrt()).clamp(0.05, 10.0)
}

/// Gains of `u(t) ≈ k_p e(t - τ) + k_d ė(t - τ)` by least squares, with τ = [`REACTION`].
fn proportional_derivative(trials: &[Trial], sticks: &[Vec<f64>]) -> (f64, f64) {
    let (mut normal, mut right) = (
        nalgebra::Matrix2::<f64>::zeros(),
        nalgebra::Vector2::<f64>::zeros(),
    );
    for (trial, stick) in trials.iter().zip(sticks) {
        let smoothed = smoothed(trial);
        for (k, t) in trial.time.iter().enumerate() {
            let seen = trial.time.partition_point(|s| *s < t - REACTION);
            let row =
                nalgebra::Vector2::new(trial.target[seen] - smoothed.z[seen], -smoothed.v[seen]);
            normal += row * row.transpose() * trial.weight;
            right += row * (stick[k] * trial.weight);
        }
    }
    normal.try_inverse().map_or((0.0, 0.0), |inverse| {
        let gains = inverse * right;
        (gains[0], gains[1])
    })
}

/// Derivatives 0..=n of a signal filtered by `1/(s + ω)^n`, at each sample; the signal is zero before the first.
fn filtered_derivatives(time: &[f64], signal: &[f64], n: usize, omega: f64) -> Vec<Vec<f64>> {
    // Controllable canonical form: x_1 is the filtered signal, x_{i+1} its i-th derivative.
    let binomial = |i: usize| (0..i).fold(1.0, |b, j| b * (n - j) as f64 / (j + 1) as f64);
    let coefficients: Vec<f64> = (0..n)
        .map(|i| binomial(i) * omega.powi((n - i) as i32))
        .collect();
    let derivative = |x: &[f64], u: f64| -> Vec<f64> {
        let top = u - x.iter().zip(&coefficients).map(|(x, c)| x * c).sum::<f64>();
        x[1..].iter().copied().chain([top]).collect()
    };
    let mut x = vec![0.0; n];
    let mut out = Vec::with_capacity(time.len());
    for k in 0..time.len() {
        let top = *derivative(&x, signal[k]).last().unwrap_or(&0.0);
        out.push(x.iter().copied().chain([top]).collect());
        if k + 1 < time.len() {
            rk4(&mut x, time[k + 1] - time[k], 8, |x, c| {
                derivative(x, signal[k] + c * (signal[k + 1] - signal[k]))
            });
        }
    }
    out
}

/// θ with its unstable poles mirrored into the left half-plane, none slower than 0.05 1/s or faster than 30 1/s.
pub fn stabilised(pilot: Pilot, theta: &[f64]) -> Vec<f64> {
    let damped = |pole: Complex<f64>| {
        let re = -pole.re.abs().clamp(0.05, FASTEST);
        Complex::new(re, pole.im.clamp(-FASTEST, FASTEST))
    };
    let denominator = denominator(pilot.poles(theta).into_iter().map(damped));
    (denominator.into_iter())
        .chain(theta[pilot.order..].iter().copied())
        .collect()
}

/// θ with poles faster than 30 1/s moved to 30 1/s, with the same gain at low frequencies.
///
/// A selection of trials may drive a pole to infinity although all trials together would not. From such a start the
/// problem is scaled so that its solution cannot be distinguished from others.
pub fn restrained(pilot: Pilot, theta: &[f64]) -> Vec<f64> {
    let slowed = |pole: Complex<f64>| pole * (FASTEST / pole.norm()).min(1.0);
    let denominator = denominator(pilot.poles(theta).into_iter().map(slowed));
    let gain = denominator[0] / theta[0];
    let numerator = theta[pilot.order..].iter().map(|c| gain * c);
    denominator.iter().copied().chain(numerator).collect()
}

/// Coefficients, in ascending order and without the leading one, of the polynomial with these roots.
pub(super) fn denominator(poles: impl Iterator<Item = Complex<f64>>) -> Vec<f64> {
    let mut polynomial = vec![Complex::new(1.0, 0.0)];
    for pole in poles {
        let mut next = vec![Complex::new(0.0, 0.0); polynomial.len() + 1];
        for (i, c) in polynomial.iter().enumerate() {
            next[i + 1] += c;
            next[i] -= c * pole;
        }
        polynomial = next;
    }
    polynomial.pop();
    polynomial.iter().map(|c| c.re).collect()
}

/// The pilot's states with the recorded error as input, from rest, by exact steps for poles of any speed; zero from
/// where they cannot be computed.
fn pilot_states(trial: &Trial, pilot: Pilot, theta: &[f64]) -> Vec<Vec<f64>> {
    let (time, error) = (&trial.time, recorded_error(trial));
    let mut out = vec![vec![0.0; pilot.order]; time.len()];
    let mut last: Option<(f64, Transition)> = None;
    for k in 1..time.len() {
        let h = time[k] - time[k - 1];
        let known = last.take_if(|(step, _)| (*step - h).abs() < SAME_STEP * h);
        let step = known.map(|(_, step)| step).or_else(|| {
            let derivative = |x: &[f64], u: &[f64], dx: &mut [f64]| {
                pilot.derivative(x, u[0], theta, dx);
            };
            Transition::new([pilot.order, 1], h, derivative).ok()
        });
        let Some(step) = step else {
            break;
        };
        let (done, next) = out.split_at_mut(k);
        step.apply(
            &done[k - 1],
            &[error[k - 1]],
            &[(error[k] - error[k - 1]) / h],
            &mut next[0],
        );
        last = Some((h, step));
    }
    out
}

/// States of the closed loop at the samples, from the data: position and velocity as recorded; attitude loop and pilot
/// simulated (each is stable by itself), the pilot with the recorded error as input.
pub fn joint_states(trial: &Trial, options: &FitOptions, theta: &[f64]) -> Vec<Vec<f64>> {
    let smoothed = smoothed(trial);
    let pilot = pilot_states(trial, options.pilot, theta);
    let stick = |k: usize| {
        options
            .pilot
            .output(&pilot[k], theta)
            .clamp(-options.stick_limit, options.stick_limit)
    };
    let mut x = Quadcopter::hover(0.0);
    let mut out = Vec::with_capacity(trial.time.len());
    for (k, pilot_state) in pilot.iter().enumerate() {
        x[0] = smoothed.z[k];
        x[2] = smoothed.v[k];
        out.push(x.iter().chain(pilot_state).copied().collect());
        if k + 1 < trial.time.len() {
            let (u0, u1) = (stick(k), stick(k + 1));
            rk4(&mut x, trial.time[k + 1] - trial.time[k], 8, |x, c| {
                let mut dx = vec![0.0; quadcopter::N_STATES];
                options.vehicle.derivative(x, u0 + c * (u1 - u0), &mut dx);
                dx
            });
        }
    }
    out
}

/// States of the pilot alone at the samples.
pub fn stick_states(trial: &Trial, options: &FitOptions, theta: &[f64]) -> Vec<Vec<f64>> {
    pilot_states(trial, options.pilot, theta)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(time: Vec<f64>, position: impl Fn(f64) -> f64) -> Trial {
        Trial {
            name: "run".into(),
            origin: String::new(),
            sha256: String::new(),
            target: vec![0.0; time.len()],
            position: time.iter().map(|t| position(*t)).collect(),
            time,
            stick: None,
            weight: 1.0,
        }
    }

    /// Runs to two alternating targets, as an experiment may record them: every second run would contain only one
    /// target.
    #[test]
    fn some_of_the_trials_show_what_all_show() {
        let run = |k: u8| {
            let mut trial = trial(vec![0.0, 1.0, 2.0], |t| t);
            trial.target = vec![if k.is_multiple_of(2) { 10.0 } else { 20.0 }; 3];
            trial.name = k.to_string();
            trial
        };
        let trials: Vec<Trial> = (0..48).map(run).collect();
        let some = spread(&trials, 24);
        let far = some.iter().filter(|t| t.target[0] == 20.0).count();
        assert_eq!((some.len(), far), (24, 12));
        let names: std::collections::BTreeSet<&str> = some.iter().map(|t| &*t.name).collect();
        assert_eq!(names.len(), 24, "no trial twice");
        assert_eq!(spread(&trials[..30], 24).len(), 24);
    }

    #[test]
    fn a_restrained_pilot_keeps_its_slow_poles_and_its_gain() {
        let pilot = Pilot { order: 3 };
        // Poles at -1, -2 and -1e6; gain 0.03.
        let (theta, gain) = ([2e6, 3e6 + 2.0, 1e6 + 3.0, 6e4, 5e4, 1e4], 0.03);
        let restrained = restrained(pilot, &theta);
        let mut poles: Vec<f64> = pilot.poles(&restrained).iter().map(|p| p.re).collect();
        poles.sort_by(f64::total_cmp);
        for (pole, expected) in poles.iter().zip([-30.0, -2.0, -1.0]) {
            assert!((pole - expected).abs() < 1e-6, "{poles:?}");
        }
        assert!((restrained[3] / restrained[0] - gain).abs() < 1e-12);
        assert!((restrained[4] / restrained[3] - theta[4] / theta[3]).abs() < 1e-12);
    }

    /// Poles at -3 and -1 ± 2i.
    #[test]
    fn a_slow_pilot_needs_no_restraint() {
        let theta = [15.0, 11.0, 5.0, -0.4, -1.1, -0.1];
        let restrained = restrained(Pilot { order: 3 }, &theta);
        for (a, b) in restrained.iter().zip(&theta) {
            assert!((a / b - 1.0).abs() < 1e-9, "{restrained:?}");
        }
    }
}
