//! What a model must say to become an FMU.

use crate::Table;
use crate::structure::Influences;

/// The number type of the models' equations: `f64`, or a dual number that carries derivatives.
///
/// Implemented for everything that satisfies the bounds; never implemented by hand.
pub trait Scalar: num_dual::DualNum<Primitive = f64> + Copy {}

impl<T: num_dual::DualNum<Primitive = f64> + Copy> Scalar for T {}

/// Where equations are evaluated. Each list is in the order in which the table declares it.
#[derive(Debug, Clone, Copy)]
pub struct At<'a, T> {
    /// Time \[s\].
    pub time: T,
    /// The continuous states, then the modes, each 1 or 0.
    pub x: &'a [T],
    /// The inputs.
    pub u: &'a [T],
    /// The parameters, without the states' start values.
    pub p: &'a [T],
}

/// A model: its table of variables, and equations `ẋ = f(t, x, u, p)`, `y = g(t, x, u, p)`.
///
/// The equations are generic over [`Scalar`], so that one set of lines gives values and, with dual
/// numbers, exact derivatives. They must depend on their arguments alone: what is to be part of an FMU's
/// state must be a state. What is true or false and changes at events only is a [mode](Table::mode); a
/// number that does so is a state whose derivative is 0.
pub trait Equations: Sized {
    /// The variables. It is asked for once an instance and must always be the same.
    fn table(&self) -> Table;

    /// Writes the derivative of each continuous state, in its unit per second.
    fn derivative<T: Scalar>(&self, at: At<T>, dx: &mut [T]);

    /// Writes each output that the table declares neither as a state nor as a mode.
    fn output<T: Scalar>(&self, at: At<T>, y: &mut [T]) {
        let _ = (at, y);
    }

    /// Writes as many event indicators as the table declares: an event is where one of them changes
    /// between positive and not positive.
    fn indicators<T: Scalar>(&self, at: At<T>, z: &mut [T]) {
        let _ = (at, z);
    }

    /// Handles an event: `x` holds states and modes and may be changed; a mode that is not 0 is true. It is called at the start of a
    /// simulation too, and again until it changes nothing; so it must itself look at what holds. What
    /// touches should be put at exactly 0: then its next touch is seen, however soon it comes.
    fn event(&self, at: At<f64>, x: &mut [f64]) {
        let _ = (at, x);
    }

    /// Whether the derivative is linear in states and inputs, `ẋ = A(p) x + B(p) u`, without events or modes:
    /// then steps of co-simulation are exact (a matrix exponential), whatever their size.
    fn is_linear(&self) -> bool {
        false
    }

    /// Writes the start values of those states for which they depend on parameters, over those that the table
    /// declares.
    fn start(&self, p: &[f64], x: &mut [f64]) {
        let _ = (p, x);
    }

    /// What makes a derivative or an output at this point no finite number, for messages: the expression and where
    /// it stands.
    fn trouble(&self, at: At<f64>) -> Option<String> {
        let _ = at;
        None
    }

    /// What depends on what, where the equations know it; else it is found by running them.
    fn influences(&self) -> Option<Influences> {
        None
    }
}
