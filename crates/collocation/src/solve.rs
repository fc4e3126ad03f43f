//! Start variables and solution of a problem, and the choice of the QP solver.

use super::node::Scales;
use super::{Collocation, Condensed};
use pilotage_sqp::{Iteration, Solution, SparseQp, SqpOptions, Status};
use std::ops::ControlFlow;

/// Runs the SQP from these variables, with the condensed QP if it [supports](Condensed::takes) the problem.
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
    /// The largest magnitude of each state over all runs, and the magnitude of each parameter; `states` holds the
    /// states of each run at its samples. A state has a scale of at least 1e-3, a parameter of at least a millionth of the
    /// largest; if all are 0, they have 1. A start near 0 says nothing of a parameter's size, and with a scale far too small
    /// a wrong point counts as converged: set [`Scales::parameters`] where that may be, and the states' in other units.
    ///
    /// # Panics
    /// If there is no run, or one without samples.
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
                .map(|t| match typical > 0.0 {
                    true => t.abs().max(1e-6 * typical).max(1e-9),
                    false => 1.0,
                })
                .collect(),
        }
    }
}

impl Collocation {
    /// The variables of the NLP from states at the samples (linear in between) and θ, both in their units.
    pub fn variables(&self, states: &[Vec<Vec<f64>>], theta: &[f64]) -> Vec<f64> {
        let runs = self.runs.iter().zip(states);
        self.variables_along(runs.map(|(run, own)| (&run.time[..], &own[..])), theta)
    }

    /// The same from the states of each run at given times.
    pub fn variables_along<'s>(
        &self,
        runs: impl Iterator<Item = (&'s [f64], &'s [Vec<f64>])>,
        theta: &[f64],
    ) -> Vec<f64> {
        let scales = &self.model.scales;
        let mut z = Vec::with_capacity(self.layout.theta + theta.len());
        for (grid, (time, states)) in self.grids.iter().zip(runs) {
            let mut after = 0;
            for t in &grid.times {
                // Most times follow each other.
                if after > 0 && time[after - 1] >= *t {
                    after = time.partition_point(|s| s < t);
                }
                while after < time.len() && time[after] < *t {
                    after += 1;
                }
                let to = after.clamp(1, time.len() - 1);
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

    /// Sets the known initial states in the variables.
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
