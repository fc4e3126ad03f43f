//! What a caller may choose about a solve.

/// Which matrix stands for the Hessian of the Lagrangian in the QP.
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
    /// Limit on iterations. Default: 200.
    pub max_iterations: usize,
    /// First Levenberg–Marquardt parameter μ. Default: 1e-3.
    pub initial_damping: f64,
    /// Largest μ before the solve gives up. Default: 1e12.
    pub max_damping: f64,
    /// Fraction η of the predicted decrease of the merit that a step must bring (Armijo; Nocedal &
    /// Wright, *Numerical Optimization*, 2nd ed., eq. 18.28). Default: 1e-4.
    pub armijo: f64,
    /// Step length α down to which the line search goes before the damping is raised instead.
    /// Default: 0.2. Where the start is far from the constraints, as in collocation, shorter steps
    /// along a good direction serve better than damped ones.
    pub short_step: f64,
    /// Shortest step length α, when damping has not helped. Default: 1e-8.
    pub min_step: f64,
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
        }
    }
}
