//! Interface to the solver of the QP in each SQP iteration: clarabel for any sparse problem ([`super::SparseQp`]), a
//! dedicated elimination for a structured one.

use super::curvature::Curvature;
use super::{Hessian, Iterate, Problem};

/// Step and multipliers from a QP.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Step {
    /// Step `d` in all variables.
    pub d: Vec<f64>,
    /// Multipliers of the linearised equalities.
    pub lambda: Vec<f64>,
    /// Multipliers of the linearised inequalities, signed as in [`Iterate::eta`].
    pub eta: Vec<f64>,
    /// `∇fᵀd`.
    pub slope: f64,
    /// `dᵀ(H + μ diag w) d`.
    pub curvature: f64,
    /// ℓ1 norm of the remaining violation of the linearised inequalities: zero unless the constraints are inconsistent
    /// and the QP was relaxed.
    pub violation: f64,
    /// Remaining residual of the linearised equalities, `c + J d`; empty if zero.
    pub residual: Vec<f64>,
    /// Number of active inequalities.
    pub active: usize,
}

/// Why a QP has no usable solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum QpFailure {
    /// The Hessian has negative curvature in the null space of the equalities; more damping helps.
    #[error("the QP is not convex")]
    NotConvex,
    /// The linearised constraints have no common point.
    #[error("the linearised constraints are inconsistent")]
    Infeasible,
    /// The QP solver stopped without a solution.
    #[error("the QP solver found no solution")]
    NoSolution,
}

/// Solves the quadratic programs of an SQP on problems of type `P`:
///
/// ```text
/// min ∇fᵀd + ½ dᵀ(H + μ diag w) d   subject to   c + J d = 0,   lower ≤ g + G d ≤ upper
/// ```
pub trait QpSolver<P: Problem + ?Sized> {
    /// Evaluates the derivatives at an iterate; `exact` requests the exact Hessian in addition to Gauss–Newton.
    fn linearise(&mut self, problem: &P, at: &Iterate, exact: bool);

    /// `∇f + Jᵀλ + Gᵀη` at the last linearisation, with its multipliers.
    fn lagrangian_gradient(&self) -> &[f64];

    /// Factor by which the elimination of the last linearisation amplifies a change of the remaining variables, and so
    /// a rounding error, in the eliminated ones. Default: one, for solvers that eliminate nothing without pivoting.
    fn growth(&self) -> f64 {
        1.0
    }

    /// Solves the QP of the last linearisation.
    fn solve(
        &mut self,
        problem: &P,
        hessian: Hessian,
        damping: f64,
        step: &mut Step,
    ) -> Result<(), QpFailure>;

    /// Second-order correction (Nocedal & Wright, section 18.3) of the step `d`, which led to `trial`: adds the
    /// smallest `δ` with `c(trial) + J δ = 0`, measured by `Σ w_i δ_i²` with the damping weights. Variables that the
    /// equalities do not determine stay unchanged.
    fn correct(&mut self, problem: &P, trial: &Iterate, d: &mut [f64]) -> Result<(), QpFailure>;

    /// The smallest curvature of the Lagrangian over the critical cone of the KKT point `at`, where the last
    /// linearisation was taken with the exact Hessian: of the reduced Hessian, projected on the null space of the
    /// active inequalities. None if it cannot be computed.
    fn curvature(&mut self, problem: &P, at: &Iterate) -> Option<Curvature>;
}
