//! The line search: backtracking on the merit, with second-order corrections of the full step.

use super::Problem;
use super::globalisation::Model;
use super::qp::QpSolver;
use super::solver::Sqp;
use super::vector::{each, largest, largest_of};

/// Longest second-order correction, relative to the step or the correction before it.
const CORRECTION_RATE: f64 = 0.35;
/// Fraction of the predicted length at which a shorter step is tried.
const SAFETY: f64 = 0.6;
/// Ratio of the equalities after and before a full step below which its correction need not be measured.
const CONTRACTION: f64 = 0.35;
/// Fraction of the predicted decrease above which the correction of a full step need not be measured either.
const GOOD: f64 = 0.5;
/// Maximum number of second-order corrections of one step.
const MAX_CORRECTIONS: usize = 3;

impl<P: Problem + ?Sized, Q: QpSolver<P>> Sqp<'_, P, Q> {
    /// The step length at which the merit decreases enough, and the ratio of the actual to the predicted decrease.
    /// Leaves the accepted point in `trial`.
    pub(super) fn search(&mut self, shortest: f64) -> Option<(f64, f64)> {
        let model = self.merit.prepare(self.problem, &self.current, &self.step);
        let start = self.merit.value(self.problem, &self.current);
        let test = Descent {
            start,
            model,
            armijo: self.options.armijo,
        };
        let mut alpha = match self.full_step(&test) {
            Ok(ratio) => return Some((1.0, ratio)),
            Err(value) => test.shortened(value),
        };
        while alpha >= shortest {
            self.try_step(alpha);
            let value = self.merit.value(self.problem, &self.trial);
            if test.passes(value, alpha) {
                return Some((alpha, test.ratio(value)));
            }
            alpha *= 0.5;
        }
        None
    }

    /// The full step, unchanged or with a second-order correction, if either passes and the correction is short;
    /// otherwise the merit of the unchanged step.
    fn full_step(&mut self, test: &Descent) -> Result<f64, f64> {
        self.try_step(1.0);
        let value = self.merit.value(self.problem, &self.trial);
        if test.is_rounding() && test.passes(value, 1.0) {
            // The merit is dominated by rounding; a Newton step still improves the residual.
            return Ok(1.0);
        }
        if !value.is_finite() {
            return Err(value);
        }
        let ratio = test.ratio(value);
        if test.passes(value, 1.0) && (ratio > GOOD || self.contracts()) {
            return Ok(ratio);
        }
        self.corrected(test, value).ok_or(value)
    }

    /// Second-order corrections of the full step, which led to `trial` with this merit.
    fn corrected(&mut self, test: &Descent, value: f64) -> Option<f64> {
        let mut d = self.step.d.clone();
        let mut length = largest(&d);
        for round in 0..MAX_CORRECTIONS {
            let moved = self.correct(&mut d)?;
            if moved > CORRECTION_RATE * length {
                return None;
            }
            if round == 0 && test.passes(value, 1.0) {
                return Some(test.ratio(value));
            }
            // Without equalities there is nothing to correct.
            if moved == 0.0 {
                return None;
            }
            self.take_corrected(&d)?;
            let corrected = self.merit.value(self.problem, &self.trial);
            if test.passes(corrected, 1.0) {
                return Some(test.ratio(corrected));
            }
            length = moved;
        }
        None
    }

    /// True if the trial's equalities are so small relative to those at the iterate that its correction is certainly
    /// short.
    fn contracts(&self) -> bool {
        largest(&self.trial.c) <= CONTRACTION * largest(&self.current.c)
    }

    /// Second-order correction of the step `d`, which led to `trial`. Returns by how much it would move the trial: a
    /// simplified Newton step, short relative to the previous one where the linearisation holds (Deuflhard, *Newton
    /// Methods for Nonlinear Problems*, 2004, section 3.3).
    fn correct(&mut self, d: &mut [f64]) -> Option<f64> {
        self.work.corrections += 1;
        self.qp.correct(self.problem, &self.trial, d).ok()?;
        let change = |[trial, z, d]: [f64; 3]| z + d - trial;
        Some(largest_of([&self.trial.z, &self.current.z, d], change))
    }

    /// Moves the trial to the end of the step `d`. None outside the problem's domain.
    fn take_corrected(&mut self, d: &[f64]) -> Option<()> {
        each(&mut self.trial.z, [&self.current.z, d], |[z, d]| z + d);
        self.trial.evaluate(self.problem);
        self.work.evaluations += 1;
        self.trial.is_finite().then_some(())
    }

    fn try_step(&mut self, alpha: f64) {
        let step = [&self.current.z[..], &self.step.d];
        each(&mut self.trial.z, step, |[z, d]| z + alpha * d);
        self.trial.evaluate(self.problem);
        blend(
            &mut self.trial.lambda,
            &self.current.lambda,
            &self.step.lambda,
            alpha,
        );
        blend(
            &mut self.trial.eta,
            &self.current.eta,
            &self.step.eta,
            alpha,
        );
        self.work.evaluations += 1;
    }
}

/// Sufficient decrease of a trial point's merit (Armijo; Nocedal & Wright, eq. 3.6a), insensitive to rounding.
struct Descent {
    start: f64,
    model: Model,
    armijo: f64,
}

impl Descent {
    /// Differences below this are indistinguishable from rounding.
    fn rounding(&self) -> f64 {
        100.0 * f64::EPSILON * self.start.abs()
    }

    fn is_rounding(&self) -> bool {
        self.model.decrease.abs() <= 10.0 * self.rounding()
    }

    fn passes(&self, value: f64, alpha: f64) -> bool {
        value <= self.start + self.armijo * alpha * self.model.derivative.min(0.0) + self.rounding()
    }

    /// The step length at which the search starts after the full step, with this merit, was rejected. Far from where
    /// the linearisation holds, the equalities grow with the square of the step, and their part of the merit with its
    /// fourth power.
    fn shortened(&self, value: f64) -> f64 {
        let (rise, slope) = (value - self.start, -self.model.derivative.min(0.0));
        match rise.is_finite() && rise > 0.0 {
            true => (SAFETY * slope / (rise + slope)).cbrt().min(0.5),
            false => 0.5,
        }
    }

    /// Actual decrease divided by the decrease that the model predicts for the full step.
    fn ratio(&self, value: f64) -> f64 {
        (self.start - value + self.rounding()) / (self.model.decrease + self.rounding())
    }
}

/// `out = from + alpha (to - from)`.
fn blend(out: &mut [f64], from: &[f64], to: &[f64], alpha: f64) {
    each(out, [from, to], |[f, t]| f + alpha * (t - f));
}
