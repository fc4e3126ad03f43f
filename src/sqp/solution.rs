//! What a solve returns.

use super::{Iterate, Kkt, Status};

/// Work that a solve did: what tests snapshot, since it does not depend on the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Accepted steps.
    pub iterations: usize,
    /// Evaluations of objective and constraints.
    pub evaluations: usize,
    /// Linearisations: evaluations of the derivatives.
    pub linearisations: usize,
    /// Quadratic programs solved, corrections included.
    pub qps: usize,
}

/// The outcome of a solve: the best iterate with how good it is.
#[derive(Debug, Clone)]
pub struct Solution {
    /// How it ended.
    pub status: Status,
    /// The last iterate, which is the best by the merit.
    pub iterate: Iterate,
    /// Its KKT residual.
    pub kkt: Kkt,
    /// What it took.
    pub work: Work,
}

/// One line of the iteration log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Counted from 0, the start.
    pub number: usize,
    /// Objective.
    pub objective: f64,
    /// KKT residual at the iterate.
    pub kkt: Kkt,
    /// Step length α of the step that led here.
    pub step: f64,
    /// Levenberg–Marquardt parameter μ of that step.
    pub damping: f64,
    /// Penalty ν of the merit.
    pub penalty: f64,
    /// Number of active inequalities in the QP.
    pub active: usize,
    /// True when that step used the exact Hessian.
    pub exact: bool,
}
