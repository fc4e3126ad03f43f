//! Solution of the equations of a run with error control: Dormand–Prince, and Radau IIA if they are stiff.

use super::mesh::Run;
use super::node::Differentiated;
use nalgebra::DMatrix;
use pilotage_expression::Registers;
use pilotage_ode::{Method, Solver, SolverOptions, System};
use std::convert::Infallible;

/// Maximum number of steps between two times, unless [`Reference::patience`] is set.
pub(super) const MOST_STEPS: usize = 20_000;
/// Number of steps between two queries of the stop condition.
const ASKED: usize = 64;

/// Stop condition of long computations; their results are then discarded.
pub type Stop<'a> = dyn Fn() -> bool + Sync + 'a;

/// The flow of a model with a given θ and the inputs of a run.
pub(super) struct Reference<'a> {
    flow: Flow<'a>,
    solver: Solver,
    /// Maximum number of steps between two times.
    pub patience: usize,
}

/// The right-hand side between two samples, at which inputs may jump.
struct Flow<'a> {
    model: &'a Differentiated,
    run: &'a Run,
    theta: &'a [f64],
    /// Registers of the model's values, in which what depends on θ alone is known.
    registers: Registers<1>,
    u: Vec<f64>,
    /// Sample at the end, and number of jumps of inputs before.
    after: usize,
    jumps: usize,
}

impl<'a> Reference<'a> {
    /// For states with these typical magnitudes and a permitted step error of `tolerance` relative to them.
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
        let mut registers = model.values.registers();
        for (k, value) in theta.iter().enumerate() {
            registers.set(model.system.parameter(k), [*value]);
        }
        model.values.run(0, &mut registers);
        let flow = Flow {
            model,
            run,
            theta,
            registers,
            u: vec![0.0; model.n_inputs()],
            after: 0,
            jumps: 0,
        };
        Self {
            flow,
            solver: Solver::new(0, options),
            patience: MOST_STEPS,
        }
    }

    /// The states at the second time, from those at the first, without samples in between. None if there is no solution
    /// or the computation is stopped.
    pub fn between(&mut self, times: (f64, f64), x: &[f64], stop: &Stop<'_>) -> Option<Vec<f64>> {
        self.along(times, x, stop, |_, _| {})
    }

    /// The same, calling `see` at the end of each step. It stops where inputs jump.
    pub fn along(
        &mut self,
        (from, to): (f64, f64),
        x: &[f64],
        stop: &Stop<'_>,
        mut see: impl FnMut(f64, &[f64]),
    ) -> Option<Vec<f64>> {
        let run = self.flow.run;
        let ends = run.steps.within(from, to).iter().copied().chain([to]);
        let (mut from, mut x, mut left) = (from, x.to_vec(), self.patience);
        for end in ends {
            x = self.smoothly((from, end), &x, &mut left, stop, &mut see)?;
            from = end;
        }
        Some(x)
    }

    /// The same where inputs do not jump, with at most `left` steps, which are counted down.
    fn smoothly(
        &mut self,
        (from, to): (f64, f64),
        x: &[f64],
        left: &mut usize,
        stop: &Stop<'_>,
        see: &mut impl FnMut(f64, &[f64]),
    ) -> Option<Vec<f64>> {
        self.flow.begin(from);
        self.solver.restart(from, x, false);
        while self.solver.time() < to {
            if *left == 0 || ((self.patience - *left).is_multiple_of(ASKED) && stop()) {
                return None;
            }
            *left -= 1;
            self.solver.advance(&mut self.flow, to).ok()?;
            see(self.solver.time(), self.solver.state());
        }
        Some(self.solver.state().to_vec())
    }

    /// True if the equations were stiff, so that the implicit method is in use.
    pub fn is_stiff(&self) -> bool {
        self.solver.is_implicit()
    }
}

impl Flow<'_> {
    /// From here to the next sample or jump.
    fn begin(&mut self, from: f64) {
        let run = self.run;
        self.after = run.time.partition_point(|t| *t <= from);
        self.jumps = run.steps.time.partition_point(|t| *t <= from);
    }

    fn take_inputs(&mut self, t: f64) {
        self.run.inputs_between(self.after, t, &mut self.u);
        self.run.steps.write(self.jumps, &mut self.u);
    }
}

impl System for Flow<'_> {
    type Error = Infallible;

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, Infallible> {
        self.take_inputs(t);
        let Self {
            model, registers, ..
        } = self;
        registers.set(0, [t]);
        for (i, value) in x.iter().enumerate() {
            registers.set(model.system.state(i), [*value]);
        }
        for (i, value) in self.u.iter().enumerate() {
            registers.set(model.system.input(i), [*value]);
        }
        model.values.run(1, registers);
        for (rate, register) in dx.iter_mut().zip(model.values.outputs(0)) {
            [*rate] = registers.get(*register);
        }
        Ok(dx.iter().all(|v| v.is_finite()))
    }

    fn jacobian(&mut self, t: f64, x: &[f64], out: &mut DMatrix<f64>) -> Result<bool, Infallible> {
        self.take_inputs(t);
        *out = self.model.jacobian(t, x, &self.u, self.theta);
        Ok(out.iter().all(|v| v.is_finite()))
    }
}
