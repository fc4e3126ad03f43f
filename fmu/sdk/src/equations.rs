//! The interface that a model implements to become an FMU.

use crate::Table;
use crate::structure::Influences;

/// The number type of the models' equations: `f64`, or a dual number that carries derivatives.
///
/// Implemented for all types that satisfy the bounds; never implemented by hand.
pub trait Scalar: num_dual::DualNum<Primitive = f64> + Copy {}

impl<T: num_dual::DualNum<Primitive = f64> + Copy> Scalar for T {}

/// Point at which equations are evaluated. Each list has the order in which the table declares it.
#[derive(Debug, Clone, Copy)]
pub struct At<'a, T> {
    /// Time \[s\].
    pub time: T,
    /// The continuous states, then the modes, each 1 or 0.
    pub x: &'a [T],
    /// The inputs; after them, if delays are exact, the delayed signals.
    pub u: &'a [T],
    /// The parameters, without the states' start values.
    pub p: &'a [T],
}

/// A model: its table of variables, and equations `ẋ = f(t, x, u, p)`, `y = g(t, x, u, p)`.
///
/// The equations are generic over [`Scalar`], so that the same code gives values and, with dual numbers, exact
/// derivatives. They must depend on their arguments only: whatever is part of an FMU's state must be a state. A Boolean
/// that changes only at events is a [mode](Table::mode); a number that changes only at events is a state with
/// derivative 0.
pub trait Equations: Sized {
    /// The variables. It is called once per instance and must always return the same table.
    fn table(&self) -> Table;

    /// Writes the derivative of each continuous state, in its unit per second.
    fn derivative<T: Scalar>(&self, at: At<T>, dx: &mut [T]);

    /// Writes each output that the table declares neither as a state nor as a mode.
    fn output<T: Scalar>(&self, at: At<T>, y: &mut [T]) {
        let _ = (at, y);
    }

    /// Writes the event indicators that the table declares: an event occurs where one of them changes between positive
    /// and not positive.
    fn indicators<T: Scalar>(&self, at: At<T>, z: &mut [T]) {
        let _ = (at, z);
    }

    /// Adds the times \[s\] at which a condition on time alone changes, such as `time > start`, for these inputs and parameters:
    /// always the same conditions in the same order. Steps stop there, so that no pulse is too short to be seen, and an FMU
    /// tells its importer.
    fn time_events(&self, u: &[f64], p: &[f64], times: &mut Vec<f64>) {
        let _ = (u, p, times);
    }

    /// Adds the time of each delay \[s\], above 0, if signals of the model are delayed. Where the simulation knows them exactly,
    /// [`At::u`] has the delayed signals after the inputs; elsewhere, as in model exchange, the equations approximate them by states
    /// of their own, whose derivatives are otherwise 0.
    fn delays(&self, p: &[f64], times: &mut Vec<f64>) {
        let _ = (p, times);
    }

    /// Writes the signals that are delayed, in the order of [`delays`](Self::delays), where `at.u` has the delayed ones.
    fn signals<T: Scalar>(&self, at: At<T>, signals: &mut [T]) {
        let _ = (at, signals);
    }

    /// Handles an event: `x` holds states and modes and may be changed; a mode other than 0 is true. It is also called
    /// at the start of a simulation, and repeated until it changes nothing, so it must check the conditions itself. At
    /// a contact, the distance should be set to exactly 0: the next contact is then detected, however soon it occurs.
    fn event(&self, at: At<f64>, x: &mut [f64]) {
        let _ = (at, x);
    }

    /// Whether the derivative is linear in states and inputs, `ẋ = A(p) x + B(p) u`, without events or modes. Steps of
    /// co-simulation are then exact (a matrix exponential), whatever their size. A constant in a derivative makes it not
    /// linear, and a step panics.
    fn is_linear(&self) -> bool {
        false
    }

    /// Writes the start values of the states whose start values depend on parameters, over those that the table
    /// declares.
    fn start(&self, p: &[f64], x: &mut [f64]) {
        let _ = (p, x);
    }

    /// Why a derivative or an output at this point is not finite, for messages: the expression and its position.
    fn trouble(&self, at: At<f64>) -> Option<String> {
        let _ = at;
        None
    }

    /// Dependencies between the variables, if the equations know them; otherwise they are found by evaluating the
    /// equations.
    fn influences(&self) -> Option<Influences> {
        None
    }
}
