//! The merit function: an augmented Lagrangian in the equalities (Gill, Murray & Saunders, *SNOPT*, SIAM Review 47,
//! 2005, section 2.3) and a weighted ℓ1 penalty on the inequalities (Powell 1978):
//!
//! ```text
//! φ(z, λ) = f + λᵀc + ½ ρ ‖c‖² + Σ σ_i viol(g_i)
//! ```
//!
//! The line search moves `(z, λ)` together. The QP has the Hessian of the same Lagrangian, so its model of φ is
//! accurate to second order and full steps are accepted early. An ℓ1 merit in the equalities would add up the curvature
//! of thousands of defects, of either sign, and reject full steps.

use super::iterate::violation;
use super::{Iterate, Problem, Step, vector};

/// Smallest ratio of ρ to its last accepted value: it may decrease as the multipliers improve. With a faster decrease
/// the steps may leave the equalities again.
const PENALTY_FALL: f64 = 0.2;

/// The merit function and its parameters.
#[derive(Debug, Clone, Default)]
pub struct Merit {
    penalty: f64,
    /// ρ of the last accepted step.
    kept: f64,
    inequality: Vec<f64>,
}

/// The QP's prediction of the merit along its step.
#[derive(Debug, Clone, Copy)]
pub struct Model {
    /// Derivative of φ along the step at its start.
    pub derivative: f64,
    /// Predicted decrease of φ for the full step.
    pub decrease: f64,
}

impl Merit {
    /// The merit at an iterate with its multipliers; infinite outside the problem's domain.
    pub fn value<P: Problem + ?Sized>(&self, problem: &P, at: &Iterate) -> f64 {
        if !at.is_finite() {
            return f64::INFINITY;
        }
        let term = |[c, l]: [f64; 2]| c * (l + 0.5 * self.penalty * c);
        at.f + vector::sum([&at.c, &at.lambda], term) + self.outside(problem, at)
    }

    /// Weighted violation of the inequalities.
    fn outside<P: Problem + ?Sized>(&self, problem: &P, at: &Iterate) -> f64 {
        let (lower, upper) = problem.limits();
        let rows =
            at.g.iter()
                .zip(lower.iter().zip(upper))
                .zip(&self.inequality);
        rows.map(|((&g, (&l, &u)), w)| w * violation(g, l, u)).sum()
    }

    /// Sets ρ and σ so that the step is a direction of descent: `φ' ≤ -½ dᵀHd`.
    pub fn prepare<P: Problem + ?Sized>(
        &mut self,
        problem: &P,
        at: &Iterate,
        step: &Step,
    ) -> Model {
        self.inequality.resize(step.eta.len(), 0.0);
        for (w, y) in self.inequality.iter_mut().zip(&step.eta) {
            *w = y.abs().max(0.5 * (*w + y.abs()));
        }
        let (squares, held) = (vector::dot(&at.c, &at.c), vector::dot(&at.c, &at.lambda));
        let change = vector::sum([&at.c, &at.lambda, &step.lambda], |[c, l, new]| {
            c * (new - l)
        });
        // An upper bound: relaxed rows are given the largest weight.
        let heaviest = self.inequality.iter().copied().fold(0.0, f64::max);
        let outside = self.outside(problem, at) - heaviest * step.violation;
        let left = |v: &[f64]| -> f64 { step.residual.iter().zip(v).map(|(r, v)| r * v).sum() };
        // With J d = r - c: φ' = slope - λᵀ(c - r) + (λ̂ - λ)ᵀc - ρ cᵀ(c - r) - outside
        let rest = step.slope - held + left(&at.lambda) + change - outside;
        let fall = squares - left(&at.c);
        let needed = (rest + 0.5 * step.curvature) / fall.max(f64::MIN_POSITIVE);
        self.penalty = match needed.is_finite() {
            true => (2.0 * needed).max(PENALTY_FALL * self.kept),
            false => self.kept,
        };
        Model {
            derivative: rest - self.penalty * fall,
            decrease: held - left(&step.lambda)
                + 0.5 * self.penalty * (squares - left(&step.residual))
                + outside
                - step.slope
                - 0.5 * step.curvature,
        }
    }

    /// Records that the step prepared last was accepted: ρ may decrease from its value.
    pub fn keep(&mut self) {
        self.kept = self.penalty;
    }

    /// The penalty ρ.
    pub fn penalty(&self) -> f64 {
        self.penalty
    }
}
