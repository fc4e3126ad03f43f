//! Result of a solve.

use super::{Iterate, Kkt, Status};

/// Work of a solve. Tests snapshot it, since it does not depend on the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Accepted steps.
    pub iterations: usize,
    /// Evaluations of objective and constraints.
    pub evaluations: usize,
    /// Linearisations: evaluations of the derivatives.
    pub linearisations: usize,
    /// Quadratic programs solved.
    pub qps: usize,
    /// Second-order corrections of a full step.
    pub corrections: usize,
    /// Steps along a direction of negative curvature, away from a saddle.
    pub curvature_steps: usize,
}

impl std::ops::AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.iterations += other.iterations;
        self.evaluations += other.evaluations;
        self.linearisations += other.linearisations;
        self.qps += other.qps;
        self.corrections += other.corrections;
        self.curvature_steps += other.curvature_steps;
    }
}

/// The outcome of a solve: the best iterate and its quality.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Why the solve ended.
    pub status: Status,
    /// The last iterate, which is the best by the merit.
    pub iterate: Iterate,
    /// Its KKT residual.
    pub kkt: Kkt,
    /// The smallest curvature of the Lagrangian over the critical cone, scaled
    /// ([`Curvature::smallest`](super::Curvature::smallest)): at least minus [`TOLERANCE`](super::curvature::TOLERANCE)
    /// if the solve converged. None if the second-order condition was not checked, because the iterate is no KKT point
    /// or the problem is too large for the check of its QP solver.
    pub curvature: Option<f64>,
    /// Work of the solve.
    pub work: Work,
}

/// One line of the iteration log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Number of the iteration; 0 is the start.
    pub number: usize,
    /// Objective.
    pub objective: f64,
    /// KKT residual at the iterate.
    pub kkt: Kkt,
    /// Step length α of the step that led here.
    pub step: f64,
    /// Largest change of a variable by that step.
    pub length: f64,
    /// Levenberg–Marquardt parameter μ of that step.
    pub damping: f64,
    /// Penalty ρ of the merit.
    pub penalty: f64,
    /// Number of active inequalities in the QP.
    pub active: usize,
    /// Model from which that step was computed.
    pub model: StepModel,
}

/// The model that led to an iterate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepModel {
    /// None: the iterate is the start.
    Start,
    /// A QP with the exact Hessian of the Lagrangian.
    Exact,
    /// A QP with the Gauss–Newton Hessian.
    GaussNewton,
    /// A direction of negative curvature, from a saddle point.
    Curvature,
}

impl StepModel {
    /// The name as one word, as in log files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Exact => "exact",
            Self::GaussNewton => "gauss-newton",
            Self::Curvature => "curvature",
        }
    }
}
