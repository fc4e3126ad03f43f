//! Interface of the integration methods.

use super::System;
use super::solver::Work;

/// A step from `(t, x)` of length `h`, and its end.
pub struct Step<'a> {
    pub(super) t: f64,
    pub(super) h: f64,
    pub(super) x: &'a [f64],
    /// The derivative at the start.
    pub(super) f: &'a [f64],
    pub(super) x_end: &'a mut [f64],
    pub(super) f_end: &'a mut [f64],
    /// Whether a longer step from the same point was rejected.
    pub(super) is_again: bool,
}

/// A one-step method with an error estimate and dense output.
pub trait Scheme {
    /// Attempts a step and writes the state at its end. Returns its error relative to the permitted one, infinite if
    /// the step fails with this length.
    ///
    /// # Errors
    /// Those of the system.
    fn attempt<M: System>(
        &mut self,
        system: &mut M,
        step: &mut Step,
        scale: &Scale,
    ) -> Result<f64, M::Error>;

    /// Accepts the attempted step and writes the derivative at its end; `false` if it is not defined.
    ///
    /// # Errors
    /// Those of the system.
    fn accept<M: System>(&mut self, system: &mut M, step: &mut Step) -> Result<bool, M::Error>;

    /// The state at the fraction `theta` of the accepted step.
    fn interpolate(&self, step: &Step, theta: f64, x: &mut [f64]);

    /// Ratio of the next step size to that of the last attempt, which had this error; `last` is the error of the
    /// previous step.
    fn factor(&self, error: f64, last: Option<f64>) -> f64;

    /// Discards the last step, since the solution is discontinuous.
    fn restart(&mut self) {}

    /// Adds the work of the method that the solver does not count.
    fn count(&self, _work: &mut Work) {}
}

/// Root mean square of `error / (absolute + relative·|x|)`, with the larger of the two `|x|`.
#[derive(Debug, Clone)]
pub struct Scale {
    pub(super) relative: f64,
    pub(super) absolute: Vec<f64>,
}

impl Scale {
    /// The permitted error of component `i`.
    pub(super) fn of(&self, i: usize, x: f64) -> f64 {
        self.absolute[i] + self.relative * x.abs()
    }

    #[inline(always)]
    pub(super) fn norm(&self, error: impl Fn(usize) -> f64, from: &[f64], to: &[f64]) -> f64 {
        let n = from.len();
        let (absolute, to) = (&self.absolute[..n], &to[..n]);
        let mut sum = 0.0;
        for i in 0..n {
            let size = from[i].abs().max(to[i].abs());
            sum += (error(i) / (absolute[i] + self.relative * size)).powi(2);
        }
        match n {
            0 => 0.0,
            n => (sum / n as f64).sqrt(),
        }
    }
}
