//! Simulated states as a start of a solve.

use super::mesh::Run;
use super::node::Differentiated;
use super::reference::Reference;
use nalgebra::{Complex, DMatrix, Schur};

/// Minimum and maximum number of steps of the explicit method between two samples, and its longest step \[s\] within
/// these limits.
const LEAST_STEPS: f64 = 4.0;
const MOST_STEPS: f64 = 100.0;
const LONGEST_STEP: f64 = 0.01;
/// Relative error of a step of the implicit method.
const TOLERANCE: f64 = 1e-6;
/// Smallest magnitude of a state to which the error is relative, as in [`Scales::of`](super::Scales::of).
const LEAST_MAGNITUDE: f64 = 1e-3;
/// Radius of a disc in whose left half the classical Runge–Kutta method is stable.
const STABLE_RADIUS: f64 = 2.6;
/// Maximum number of iterations for eigenvalues.
const MOST_ITERATIONS: usize = 1000;

impl Differentiated {
    /// States of a run at its samples, simulated with this θ from these initial states, as a start for the solver.
    ///
    /// Between two samples the classical Runge–Kutta method is used, in 4 to 100 steps of at most 10 ms where possible,
    /// if it is stable for every stable mode of the model. Otherwise a method with error control is used, Radau IIA for
    /// stiff models. A state that diverges keeps its last finite value.
    pub fn simulate(&self, run: &Run, theta: &[f64], initial: &[f64]) -> Vec<Vec<f64>> {
        let sizes = initial.iter().map(|x| x.abs().max(LEAST_MAGNITUDE));
        let sizes: Vec<f64> = sizes.collect();
        let mut implicit = Reference::new((self, run), theta, &sizes, TOLERANCE);
        let mut states = vec![initial.to_vec()];
        for times in run.time.windows(2) {
            let ends = run.steps.within(times[0], times[1]).iter();
            let (mut from, mut x) = (times[0], states[states.len() - 1].clone());
            for to in ends.chain([&times[1]]) {
                let times = (from, *to);
                let (explicit, is_finite) = self.explicit(run, theta, times, &x);
                x = match is_finite && self.is_stable(run, theta, times, &x) {
                    true => explicit,
                    false => (implicit.between(times, &x, &|| false)).unwrap_or(explicit),
                };
                from = *to;
            }
            states.push(x);
        }
        states
    }

    /// States at the second time by the explicit method, and whether all steps were finite.
    fn explicit(&self, run: &Run, theta: &[f64], times: (f64, f64), x: &[f64]) -> (Vec<f64>, bool) {
        let mut u = vec![0.0; self.n_inputs()];
        let (mut x, mut is_finite) = (x.to_vec(), true);
        let (steps, step) = steps(times);
        for k in 0..steps as usize {
            let mut next = x.clone();
            rk4(&mut next, step, 1, |x, c| {
                let part = (k as f64 + c) / steps;
                // The exact end of the interval, since inputs may jump there.
                if part == 1.0 {
                    run.inputs_before(times.1, &mut u);
                    return self.evaluate(times.1, x, &u, theta);
                }
                let time = times.0 + (times.1 - times.0) * part;
                run.inputs_at(time, &mut u);
                self.evaluate(time, x, &u, theta)
            });
            match next.iter().all(|v| v.is_finite()) {
                true => x = next,
                false => is_finite = false,
            }
        }
        (x, is_finite)
    }

    /// True if the explicit method is stable for every stable mode of the model at the first time.
    fn is_stable(&self, run: &Run, theta: &[f64], times: (f64, f64), x: &[f64]) -> bool {
        let mut u = vec![0.0; self.n_inputs()];
        run.inputs_at(times.0, &mut u);
        let matrix = self.jacobian(times.0, x, &u, theta) * steps(times).1;
        // The norm bounds all eigenvalues.
        let size = matrix.norm();
        size < STABLE_RADIUS || (size.is_finite() && keeps_stable_modes(matrix))
    }
}

/// Number and length \[s\] of the steps of the explicit method between two times.
fn steps((from, to): (f64, f64)) -> (f64, f64) {
    let duration = to - from;
    let steps = (duration / LONGEST_STEP)
        .ceil()
        .clamp(LEAST_STEPS, MOST_STEPS);
    (steps, duration / steps)
}

/// True if `|R(z)| ≤ 1` for all eigenvalues z in the left half-plane, with `R(z) = Σ zᵏ/k!`, k = 0..4, of the classical
/// method (Hairer & Wanner II, section IV.2).
fn keeps_stable_modes(matrix: DMatrix<f64>) -> bool {
    let grows = |z: &Complex<f64>| {
        let horner = |sum: Complex<f64>, k: f64| sum * z / k + 1.0;
        let growth = [4.0, 3.0, 2.0, 1.0]
            .into_iter()
            .fold(Complex::from(1.0), horner);
        z.re < 0.0 && growth.norm() > 1.0
    };
    match Schur::try_new(matrix, f64::EPSILON, MOST_ITERATIONS) {
        Some(schur) => !schur.complex_eigenvalues().iter().any(grows),
        None => false,
    }
}

/// Classical Runge–Kutta over `h` in `substeps`; `f(x, c)` is evaluated at the fraction `c` of `h`.
///
/// `f` may return more values than the derivatives; they are ignored.
pub fn rk4(x: &mut [f64], h: f64, substeps: usize, mut f: impl FnMut(&[f64], f64) -> Vec<f64>) {
    let dt = h / substeps as f64;
    let shifted = |x: &[f64], k: &[f64], s: f64| -> Vec<f64> {
        x.iter().zip(k).map(|(x, k)| x + s * k).collect()
    };
    for step in 0..substeps {
        let c = |part: f64| (step as f64 + part) / substeps as f64;
        let k1 = f(x, c(0.0));
        let k2 = f(&shifted(x, &k1, dt / 2.0), c(0.5));
        let k3 = f(&shifted(x, &k2, dt / 2.0), c(0.5));
        let k4 = f(&shifted(x, &k3, dt), c(1.0));
        for (i, x) in x.iter_mut().enumerate() {
            *x += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
}
