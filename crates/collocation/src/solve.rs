//! From a problem to its solution: what the solver starts from, and with which QP it goes on.

use super::node::{Differentiated, Scales};
use super::{Collocation, Condensed, Run};
use pilotage_sqp::{Iteration, Solution, SparseQp, SqpOptions, Status};
use std::ops::ControlFlow;

/// Steps of the simulation between two samples, at least, and the longest one [s].
const LEAST_STEPS: f64 = 4.0;
const LONGEST_STEP: f64 = 0.01;

/// Runs the SQP from these variables, with the fast QP where it [takes](Condensed::takes) the problem.
pub fn solve(
    problem: &Collocation,
    z: Vec<f64>,
    options: &SqpOptions,
    observer: &mut dyn FnMut(&Iteration) -> ControlFlow<Status>,
) -> Solution {
    match Condensed::takes(problem) {
        true => pilotage_sqp::solve(problem, &mut Condensed::default(), z, options, observer),
        false => pilotage_sqp::solve(problem, &mut SparseQp::default(), z, options, observer),
    }
}

impl Scales {
    /// The largest magnitude of each state over all runs, and that of each parameter; `states` are those of
    /// each run at its samples.
    pub fn of(states: &[Vec<Vec<f64>>], theta: &[f64]) -> Self {
        let n = states[0][0].len();
        let largest = |i: usize| {
            let all = states.iter().flatten();
            all.fold(1e-3_f64, |m, x| m.max(x[i].abs()))
        };
        let typical = theta.iter().map(|t| t.abs()).fold(0.0, f64::max);
        let parameters = theta.iter();
        Self {
            states: (0..n).map(largest).collect(),
            parameters: parameters
                .map(|t| t.abs().max(1e-6 * typical).max(1e-9))
                .collect(),
        }
    }
}

impl Collocation {
    /// The NLP's variables from states at the samples (linear in between) and θ, both in their units.
    pub fn variables(&self, states: &[Vec<Vec<f64>>], theta: &[f64]) -> Vec<f64> {
        let scales = &self.model.scales;
        let mut z = Vec::with_capacity(self.layout.theta + theta.len());
        for (j, states) in states.iter().enumerate() {
            let time = &self.runs[j].time;
            for t in &self.grids[j].times {
                let to = time.partition_point(|s| s < t).clamp(1, time.len() - 1);
                let span = time[to] - time[to - 1];
                let c = if span > 0.0 {
                    (t - time[to - 1]) / span
                } else {
                    0.0
                };
                let (from, to) = (&states[to - 1], &states[to]);
                let between = from.iter().zip(to).map(|(a, b)| a + c * (b - a));
                z.extend(between.zip(&scales.states).map(|(x, s)| x / s));
            }
        }
        z.extend(theta.iter().zip(&scales.parameters).map(|(t, s)| t / s));
        self.set_known(&mut z);
        z
    }

    /// Puts the known initial states into the variables.
    pub(super) fn set_known(&self, z: &mut [f64]) {
        for (run, at) in self.runs.iter().zip(&self.layout.runs) {
            for (i, known) in run.initial.iter().enumerate() {
                if let Some(value) = known {
                    z[at.z + i] = value / self.model.scales.states[i];
                }
            }
        }
    }
}

impl Differentiated {
    /// States of a run at its samples, simulated with this θ from these initial states: classical Runge–Kutta
    /// steps of 10 ms at most, and four at least between two samples. They are a start for the solver; a
    /// state that grows beyond all bounds stays where it was.
    pub fn simulate(&self, run: &Run, theta: &[f64], initial: &[f64]) -> Vec<Vec<f64>> {
        let mut u = vec![0.0; self.n_inputs()];
        let mut states = vec![initial.to_vec()];
        for times in run.time.windows(2) {
            let mut x = states[states.len() - 1].clone();
            let duration = times[1] - times[0];
            let steps = (duration / LONGEST_STEP).ceil().max(LEAST_STEPS);
            for k in 0..steps as usize {
                let mut next = x.clone();
                rk4(&mut next, duration / steps, 1, |x, c| {
                    let part = (k as f64 + c) / steps;
                    // The end to the last bit: inputs may jump there.
                    if part == 1.0 {
                        run.inputs_before(times[1], &mut u);
                        return self.evaluate(times[1], x, &u, theta);
                    }
                    let time = times[0] + duration * part;
                    run.inputs_at(time, &mut u);
                    self.evaluate(time, x, &u, theta)
                });
                if next.iter().all(|v| v.is_finite()) {
                    x = next;
                }
            }
            states.push(x);
        }
        states
    }
}

/// Classical Runge–Kutta over `h` in `substeps`; `f(x, c)` at the fraction `c` of `h`.
///
/// `f` may give more than the derivatives: what stands behind them is left.
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
