//! Ordinary differential equations with events, solved with error control.
//!
//! ```text
//! ẋ = f(t, x),   an event wherever a component of z(t, x) comes to be positive or ceases to be
//! ```
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`solver`] | steps of the right length, each up to the first event in it |
//! | `dormand_prince` | the explicit method, for most problems |
//! | `radau` | the implicit method, for stiff problems |
//! | `root` | where in a step an event is |

mod dormand_prince;
mod error;
mod radau;
mod root;
pub mod solver;
#[cfg(test)]
mod tests;

pub use error::IntegrationError;
pub use solver::{Advance, Method, Options, Solver, Work};

use nalgebra::DMatrix;

/// What is to be solved.
pub trait Dynamics {
    /// What an evaluation can fail with, for good.
    type Error;

    /// `dx = f(t, x)`. `false` if it is not defined there: the solver tries a shorter step.
    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, Self::Error>;

    /// `z(t, x)`, as many as the solver was told. `false` if it is not defined there.
    fn indicators(&mut self, t: f64, x: &[f64], z: &mut [f64]) -> Result<bool, Self::Error>;

    /// `∂f/∂x` at `(t, x)`. `false` if there is none: the solver takes differences.
    fn jacobian(
        &mut self,
        _t: f64,
        _x: &[f64],
        _jacobian: &mut DMatrix<f64>,
    ) -> Result<bool, Self::Error> {
        Ok(false)
    }
}

/// How an attempt at a step went.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Attempt {
    /// Its error, 1 being as large as allowed.
    Error(f64),
    /// It cannot be done with this length.
    Impossible,
}

/// Root mean square of `error / (absolute + relative·|x|)`, with the larger of the two `|x|`.
#[derive(Debug, Clone)]
struct Scale {
    relative: f64,
    absolute: Vec<f64>,
}

impl Scale {
    /// What an error of component `i` is measured by.
    fn of(&self, i: usize, x: f64) -> f64 {
        self.absolute[i] + self.relative * x.abs()
    }

    fn norm(&self, error: impl Iterator<Item = f64>, from: &[f64], to: &[f64]) -> f64 {
        if from.is_empty() {
            return 0.0;
        }
        let ends = from.iter().zip(to).map(|(a, b)| a.abs().max(b.abs()));
        let parts = error.zip(ends).enumerate();
        let sum: f64 = parts.map(|(i, (e, x))| (e / self.of(i, x)).powi(2)).sum();
        (sum / from.len() as f64).sqrt()
    }
}
