//! Ordinary differential equations with events, solved with error control.
//!
//! ```text
//! ẋ = f(t, x),   an event wherever a component of z(t, x) comes to be positive or ceases to be
//! ```
//!
//! The example is a ball that falls from 1 m; the solver stops when it touches the ground:
//!
//! ```
//! use pilotage_ode::{Advance, DormandPrince, Solver, System};
//!
//! struct Ball;
//!
//! impl System for Ball {
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
//! let mut solver = Solver::with(DormandPrince::new(2), 1, 1e-9, &[1e-9, 1e-9]);
//! solver.restart(0.0, &[1.0, 0.0], true);
//! while solver.advance(&mut Ball, 1.0).expect("it falls") == Advance::Step {}
//! assert!((solver.time() - (2.0 / 9.81_f64).sqrt()).abs() < 1e-12);
//! ```
//!
//! | module | content |
//! | --- | --- |
//! | [`solver`] | step size control and events |
//! | `automatic` | Dormand–Prince, and Radau IIA for stiff problems |
//! | `dormand_prince` | the explicit method, for most problems |
//! | `radau` | the implicit method, for stiff problems |
//! | `root` | location of events within a step |
//! | `error` | why a solution ends |
//! | `scheme` | interface of the methods |

mod automatic;
mod dormand_prince;
mod error;
mod radau;
mod root;
mod scheme;
pub mod solver;
#[cfg(test)]
mod tests;

pub use automatic::{Automatic, Method, SolverOptions};
pub use dormand_prince::DormandPrince;
pub use error::IntegrationError;
pub use solver::{Advance, Solver, Work};

use nalgebra::DMatrix;

/// The problem to be solved: the right-hand side and the event indicators.
pub trait System {
    /// Error of an evaluation that ends the solution.
    type Error: std::error::Error + 'static;

    /// Writes `dx = f(t, x)`. `false` if it is not defined there; the solver then tries a shorter step.
    ///
    /// # Errors
    /// An error that ends the solution.
    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<bool, Self::Error>;

    /// Writes `z(t, x)`, with the number of indicators passed to the solver. The default is for systems without
    /// indicators. `false` if it is not defined there.
    ///
    /// # Errors
    /// An error that ends the solution.
    fn indicators(&mut self, _t: f64, _x: &[f64], _z: &mut [f64]) -> Result<bool, Self::Error> {
        Ok(true)
    }

    /// Writes `∂f/∂x` at `(t, x)`. `false` if it is not available; the solver then uses finite differences.
    ///
    /// # Errors
    /// An error that ends the solution.
    fn jacobian(
        &mut self,
        _t: f64,
        _x: &[f64],
        _jacobian: &mut DMatrix<f64>,
    ) -> Result<bool, Self::Error> {
        Ok(false)
    }
}
