//! A run's equations solved with error control: Dormand–Prince, and Radau IIA where they are stiff.

use super::mesh::Run;
use super::node::Differentiated;
use nalgebra::DMatrix;
use pilotage_ode::{Method, Solver, SolverOptions, System};
use std::convert::Infallible;

/// Steps between two times before a solution is given up, unless [`Reference::patience`] says otherwise.
const MOST_STEPS: usize = 20_000;
/// Steps after which it is asked again whether to stop.
const ASKED: usize = 64;

/// Whether long work is to stop; what it has then is as good as nothing.
pub type Stop<'a> = dyn Fn() -> bool + Sync + 'a;

/// The flow of a model along a run's inputs, with a θ.
pub(super) struct Reference<'a> {
    flow: Flow<'a>,
    solver: Solver,
    /// Steps between two times before a solution is given up.
    pub patience: usize,
}

/// The right-hand side up to a sample, where inputs may jump.
struct Flow<'a> {
    model: &'a Differentiated,
    run: &'a Run,
    theta: &'a [f64],
    u: Vec<f64>,
    end: f64,
}

impl<'a> Reference<'a> {
    /// Of states with these typical magnitudes; a step may have an error of `tolerance` relative to them.
    pub fn new(
        (model, run): (&'a Differentiated, &'a Run),
        theta: &'a [f64],
        magnitudes: &[f64],
        tolerance: f64,
    ) -> Self {
        let options = SolverOptions {
            relative: tolerance,
            absolute: magnitudes.iter().map(|m| tolerance * m).collect(),
            method: Method::Automatic,
            longest_step: f64::INFINITY,
        };
        let flow = Flow {
            model,
            run,
            theta,
            u: vec![0.0; model.n_inputs()],
            end: 0.0,
        };
        Self {
            flow,
            solver: Solver::new(0, options),
            patience: MOST_STEPS,
        }
    }

    /// The states at the second time, from those at the first; no samples are in between. None where there is no
    /// such solution, or where it is to stop.
    pub fn between(&mut self, times: (f64, f64), x: &[f64], stop: &Stop<'_>) -> Option<Vec<f64>> {
        self.along(times, x, stop, |_, _| {})
    }

    /// The same, with each step's end shown.
    pub fn along(
        &mut self,
        (from, to): (f64, f64),
        x: &[f64],
        stop: &Stop<'_>,
        mut see: impl FnMut(f64, &[f64]),
    ) -> Option<Vec<f64>> {
        self.flow.end = to;
        self.solver.restart(from, x, false);
        for step in 0..self.patience {
            if self.solver.time() >= to {
                return Some(self.solver.state().to_vec());
            }
            if step % ASKED == 0 && stop() {
                return None;
            }
            self.solver.advance(&mut self.flow, to).ok()?;
            see(self.solver.time(), self.solver.state());
        }
        None
    }

    /// Whether the equations were stiff: the implicit method is in use.
    pub fn is_stiff(&self) -> bool {
        self.solver.is_implicit()
    }
}

impl Flow<'_> {
    fn take_inputs(&mut self, t: f64) {
        match t < self.end {
            true => self.run.inputs_at(t, &mut self.u),
            false => self.run.inputs_before(self.end, &mut self.u),
        }
    }
}

impl System for Flow<'_> {
    type Error = Infallible;

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, Infallible> {
        self.take_inputs(t);
        let rates = self.model.evaluate(t, x, &self.u, self.theta);
        dx.copy_from_slice(&rates[..x.len()]);
        Ok(dx.iter().all(|v| v.is_finite()))
    }

    fn jacobian(&mut self, t: f64, x: &[f64], out: &mut DMatrix<f64>) -> Result<bool, Infallible> {
        self.take_inputs(t);
        *out = self.model.jacobian(t, x, &self.u, self.theta);
        Ok(out.iter().all(|v| v.is_finite()))
    }
}
