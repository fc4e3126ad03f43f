//! Constraints on the parameters alone.

use pilotage_models::Scalar;

/// Constraints `values(θ) ≥ 0`, such as the stability of an identified model.
pub trait ParameterConstraints: Sync {
    /// Number of constraints.
    fn count(&self) -> usize;

    /// Writes their values; each must be at least zero.
    fn values<T: Scalar>(&self, theta: &[T], out: &mut [T]);
}
