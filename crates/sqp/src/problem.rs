//! The nonlinear program that the SQP solves.

/// A nonlinear program
///
/// ```text
/// min f(z)   subject to   c(z) = 0,   lower ≤ g(z) ≤ upper
/// ```
///
/// Variables and constraints are expected to be scaled to the order of one: tolerances, the merit
/// function and the damping are absolute. Bounds on variables are rows of `g`.
pub trait Problem {
    /// Number of variables `z`.
    fn n_variables(&self) -> usize;

    /// Number of equality constraints `c`.
    fn n_equalities(&self) -> usize;

    /// Limits `(lower, upper)` of `g`, infinite if there is none. Their length is the number of inequality constraints.
    fn limits(&self) -> (&[f64], &[f64]);

    /// Returns `f(z)` and writes `c(z)` and `g(z)`. Values that are not finite mark a `z` outside the problem's domain.
    fn evaluate(&self, z: &[f64], c: &mut [f64], g: &mut [f64]) -> f64;

    /// Weight of each variable in the Levenberg–Marquardt term `½ μ Σ w_i d_i²` of a step; zero for
    /// variables that the equality constraints determine from the others.
    fn damping_weights(&self) -> &[f64];
}

/// Entries `(row, column)` of a sparse matrix in a fixed order; the values at each iterate follow this order.
pub type Pattern = Vec<(usize, usize)>;

/// A [`Problem`] with sparse derivatives, for the general QP path ([`super::SparseQp`]).
pub trait SparseProblem: Problem {
    /// Writes `∇f(z)`.
    fn gradient(&self, z: &[f64], gradient: &mut [f64]);

    /// Pattern `(row, column)` of the Jacobian of `c`; duplicates add.
    fn equality_pattern(&self) -> Pattern;

    /// Pattern `(row, column)` of the Jacobian of `g`; duplicates add.
    fn inequality_pattern(&self) -> Pattern;

    /// Writes the values of both Jacobians in the order of the patterns.
    fn jacobians(&self, z: &[f64], equality: &mut [f64], inequality: &mut [f64]);

    /// Pattern of the upper triangle (row ≤ column) of the Hessian of the Lagrangian; duplicates add.
    fn hessian_pattern(&self) -> Pattern;

    /// Writes the Hessian of `f + λᵀc + ηᵀg` in the order of the pattern, or, with
    /// [`Hessian::GaussNewton`](super::Hessian::GaussNewton), a positive semidefinite approximation.
    fn hessian(
        &self,
        z: &[f64],
        lambda: &[f64],
        eta: &[f64],
        kind: super::Hessian,
        values: &mut [f64],
    );
}
