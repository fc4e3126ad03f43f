//! What a model must offer to be identified.

use crate::Scalar;

/// A system `ẋ = f(x, w; θ)` with one measured output and one bounded signal (paper, eqs. 1-3).
///
/// `x` are the states, `w` the known exogenous inputs (the target, or a recorded signal) and `θ` the
/// parameters to identify. The methods are generic over [`Scalar`] so that one set of equations
/// yields values and exact derivatives, at several points at once: they must not branch on their numbers.
///
/// The slices' lengths are [`n_states`](Self::n_states), [`n_inputs`](Self::n_inputs) and
/// [`n_parameters`](Self::n_parameters).
pub trait Dynamics: Sync {
    /// Number of states.
    fn n_states(&self) -> usize;

    /// Number of identified parameters θ.
    fn n_parameters(&self) -> usize;

    /// Number of exogenous inputs.
    fn n_inputs(&self) -> usize;

    /// Writes the state derivative `f(x, w; θ)` into `dx`, in the states' units per second.
    fn derivative<T: Scalar>(&self, x: &[T], w: &[T], theta: &[T], dx: &mut [T]);

    /// The output that is compared with the recording (paper: `h_v`; the stick in the stick fit).
    fn measured<T: Scalar>(&self, x: &[T], w: &[T], theta: &[T]) -> T;

    /// The signal held within limits at every node (paper: `y_p`, the joystick in [-1, 1]).
    fn bounded<T: Scalar>(&self, x: &[T], w: &[T], theta: &[T]) -> T;
}
