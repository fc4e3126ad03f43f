//! The solution of a problem, and how it is solved again.

use pilotage_collocation::Collocation;
use pilotage_sqp::{Iterate, SqpOptions, Status};
use std::ops::ControlFlow;

/// A problem with its solution.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The problem.
    pub problem: Collocation,
    /// Its solution.
    pub at: Iterate,
    /// Options of refits.
    pub options: SqpOptions,
}

/// What is sought.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// A shared parameter.
    Shared(usize),
    /// The initial value of a state of a run, which is what a run's own parameter is.
    Initial {
        /// The run.
        run: usize,
        /// The state.
        state: usize,
    },
}

impl Coordinate {
    /// Whether it is that of one run.
    pub fn is_initial(self) -> bool {
        matches!(self, Self::Initial { .. })
    }

    /// Its value in units, by the variables of a problem.
    pub fn value(self, problem: &Collocation, z: &[f64]) -> f64 {
        let scales = &problem.model.scales;
        match self {
            Self::Shared(k) => problem.theta(z)[k] * scales.parameters[k],
            Self::Initial { run, state } => {
                problem.coefficients(z, run)[state] * scales.states[state]
            }
        }
    }
}

/// Who looks on. Both are called from several threads.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// Whether to stop.
    pub stops: &'a (dyn Fn() -> bool + Sync),
    /// Sees that another part of the work is done.
    pub done: &'a (dyn Fn() + Sync),
}

impl Default for Watch<'_> {
    /// Nobody.
    fn default() -> Self {
        Self {
            stops: &|| false,
            done: &|| (),
        }
    }
}

/// As [`solve`], from the solution of other data: on a coarser mesh first, where that is much smaller.
pub(crate) fn solve_from_afar(
    problem: &Collocation,
    z: Vec<f64>,
    options: &SqpOptions,
    watch: &Watch<'_>,
) -> Option<Iterate> {
    let mut see = |_: &pilotage_sqp::Iteration| match (watch.stops)() {
        true => ControlFlow::Break(Status::Stopped),
        false => ControlFlow::Continue(()),
    };
    let (z, _) = pilotage_collocation::nearer(problem, z, options, &mut see);
    solve(problem, z, options, watch)
}

/// Solves from these variables; none where that does not converge.
pub(crate) fn solve(
    problem: &Collocation,
    z: Vec<f64>,
    options: &SqpOptions,
    watch: &Watch<'_>,
) -> Option<Iterate> {
    let mut see = |_: &pilotage_sqp::Iteration| match (watch.stops)() {
        true => ControlFlow::Break(Status::Stopped),
        false => ControlFlow::Continue(()),
    };
    let solution = pilotage_collocation::solve(problem, z, options, &mut see);
    (solution.status == Status::Converged).then_some(solution.iterate)
}
