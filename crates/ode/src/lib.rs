//! Ordinary differential equations with events, solved with error control.
//!
//! ```text
//! ẋ = f(t, x),   an event wherever a component of z(t, x) becomes positive or ceases to be
//! ```
//!
//! It is for right-hand sides that may fail, may be undefined in places and may turn stiff on the way, such as
//! FMUs for model exchange: [`Solver::advance`] does one step, up to the first event in it, and the caller
//! handles the event. States are `f64`; there is no mass matrix and no delay.
//!
//! A ball that falls from 1 m reaches the ground after `√(2/g)`:
//!
//! ```
//! use pilotage_ode::{Advance, Dynamics, Method, Options, Solver};
//!
//! struct Ball;
//!
//! impl Dynamics for Ball {
//!     type Error = std::convert::Infallible;
//!
//!     fn derivatives(&mut self, _t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, Self::Error> {
//!         (dx[0], dx[1]) = (x[1], -9.81);
//!         Ok(true)
//!     }
//!
//!     fn indicators(&mut self, _t: f64, x: &[f64], z: &mut [f64]) -> Result<bool, Self::Error> {
//!         z[0] = x[0];
//!         Ok(true)
//!     }
//! }
//!
//! let options = Options { relative: 1e-9, absolute: vec![1e-12; 2], method: Method::Automatic, longest_step: f64::INFINITY };
//! let mut solver = Solver::new(1, options);
//! solver.restart(0.0, &[1.0, 0.0], true);
//! while solver.advance(&mut Ball, 10.0)? != Advance::Event {}
//! let speed = (2.0 * 9.81f64).sqrt();
//! assert!((solver.time() - speed / 9.81).abs() < 1e-9);
//! assert!((solver.state()[1] + speed).abs() < 1e-8);
//! # Ok::<(), pilotage_ode::IntegrationError<std::convert::Infallible>>(())
//! ```
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`solver`] | steps of the right length, each up to the first event in it |
//! | `dormand_prince` | the explicit method, for most problems; its coefficients are [`tableau`] |
//! | `radau` | the implicit method, for stiff problems |
//! | `root` | where in a step an event is |

mod dormand_prince;
mod error;
mod radau;
mod root;
pub mod solver;
pub mod tableau;
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
