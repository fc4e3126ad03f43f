//! Options of a solve.

/// The Hessian of the Lagrangian used in the QP.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hessian {
    /// The exact Hessian of the Lagrangian: quadratic convergence, possibly indefinite.
    Exact,
    /// A positive semidefinite approximation, for least squares `2 JᵀJ`: safe far from a solution.
    GaussNewton,
}

/// Options of a solve.
#[derive(Debug, Clone)]
pub struct SqpOptions {
    /// Scaled KKT residual ([`super::convergence`]) at which the solve has converged. Default: 1e-8.
    pub tolerance: f64,
    /// Maximum number of iterations. Default: 200.
    pub max_iterations: usize,
    /// Initial Levenberg–Marquardt parameter μ. Default: 1e-3.
    pub initial_damping: f64,
    /// Largest μ before the solve stops without progress. Default: 1e12.
    pub max_damping: f64,
    /// Fraction η of the predicted decrease of the merit that a step must achieve (Armijo; Nocedal & Wright, *Numerical
    /// Optimization*, 2nd ed., eq. 18.28). Default: 1e-4.
    pub armijo: f64,
    /// Shortest step length α of the line search before the damping is raised instead. Default: 0.2. If the start is
    /// far from the constraints, as in collocation, shorter steps along a good direction work better than damped ones.
    pub short_step: f64,
    /// Shortest step length α if damping has not helped. Default: 1e-8.
    pub min_step: f64,
    /// Number of iterations after which the solve ends with [`Status::NoProgress`](super::Status::NoProgress) if all
    /// iterates are feasible and their objectives differ by rounding alone, or if for twice as many none was better than a
    /// feasible one whose KKT residual is below [a multiple](crate::ACCEPTABLE) of the tolerance. At the kinks of a problem
    /// that is not smooth the KKT residual does not vanish, and a variable may grow without end; whether such a point is an
    /// optimum is the caller's to judge. Default: none.
    pub stall: Option<usize>,
}

impl Default for SqpOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-8,
            max_iterations: 200,
            initial_damping: 1e-3,
            max_damping: 1e12,
            armijo: 1e-4,
            short_step: 0.2,
            min_step: 1e-8,
            stall: None,
        }
    }
}
