//! What the solver knows of a method.

use super::System;
use super::solver::Work;

/// A step from `(t, x)` of length `h`, and where it leads.
pub struct Step<'a> {
    pub(super) t: f64,
    pub(super) h: f64,
    pub(super) x: &'a [f64],
    /// The derivative at the beginning.
    pub(super) f: &'a [f64],
    pub(super) x_end: &'a mut [f64],
    pub(super) f_end: &'a mut [f64],
    /// Whether a longer step from there was refused.
    pub(super) is_again: bool,
}

/// A one-step method that estimates its error and knows the state within its steps.
pub trait Scheme {
    /// Tries a step and writes the state at its end; its error, 1 being as large as allowed, and infinite where
    /// it cannot be done with this length.
    ///
    /// # Errors
    /// Those of the system.
    fn attempt<M: System>(
        &mut self,
        system: &mut M,
        step: &mut Step,
        scale: &Scale,
    ) -> Result<f64, M::Error>;

    /// Takes the attempted step as done and writes the derivative at its end; `false` if there is none.
    ///
    /// # Errors
    /// Those of the system.
    fn accept<M: System>(&mut self, system: &mut M, step: &mut Step) -> Result<bool, M::Error>;

    /// The state at the fraction `theta` of the step that was accepted.
    fn interpolate(&self, step: &Step, theta: f64, x: &mut [f64]);

    /// By how much the next length should differ from that of the last attempt, which had this error; `last` is the
    /// error of the step before.
    fn factor(&self, error: f64, last: Option<f64>) -> f64;

    /// Forgets the last step: the problem has jumped.
    fn restart(&mut self) {}

    /// Adds what the solver does not see of the method's work.
    fn count(&self, _work: &mut Work) {}
}

/// Root mean square of `error / (absolute + relative·|x|)`, with the larger of the two `|x|`.
#[derive(Debug, Clone)]
pub struct Scale {
    pub(super) relative: f64,
    pub(super) absolute: Vec<f64>,
}

impl Scale {
    /// What an error of component `i` is measured by.
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
