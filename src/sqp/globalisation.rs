//! The ℓ1 exact penalty merit `φ(z; ν) = f + ν (‖c‖₁ + ‖violation of g‖₁)` with Armijo backtracking
//! (Nocedal & Wright, *Numerical Optimization*, 2nd ed., section 18.3).

use super::iterate::violation;
use super::{Iterate, Problem};

/// Margin ρ of the penalty update (Nocedal & Wright, eq. 18.36).
const PENALTY_MARGIN: f64 = 0.5;

/// The merit function; its penalty only grows.
#[derive(Debug, Clone, Copy, Default)]
pub struct Merit {
    penalty: f64,
}

impl Merit {
    /// The value at an iterate; infinite outside the problem's domain.
    pub fn value<P: Problem + ?Sized>(&self, problem: &P, at: &Iterate) -> f64 {
        match at.is_finite() {
            true => at.f + self.penalty * infeasibility(problem, at),
            false => f64::INFINITY,
        }
    }

    /// Raises the penalty so that a step of the QP is a descent direction by a margin (Nocedal &
    /// Wright, eq. 18.36), and returns the merit's directional derivative along it.
    ///
    /// `slope` is `∇fᵀd`, `curvature` is `dᵀHd`, `decrease` how much of the ℓ1 violation the step takes
    /// away in the linear model.
    pub fn prepare(&mut self, slope: f64, curvature: f64, decrease: f64) -> f64 {
        let model = slope + 0.5 * curvature.max(0.0);
        let needed = model / ((1.0 - PENALTY_MARGIN) * decrease);
        if decrease > 0.0 && needed > self.penalty {
            self.penalty = 1.5 * needed;
        }
        slope - self.penalty * decrease
    }

    /// The penalty ν.
    pub fn penalty(&self) -> f64 {
        self.penalty
    }
}

/// ℓ1 norm of all constraint violations.
pub fn infeasibility<P: Problem + ?Sized>(problem: &P, at: &Iterate) -> f64 {
    let (lower, upper) = problem.limits();
    let outside =
        at.g.iter()
            .zip(lower.iter().zip(upper))
            .map(|(&g, (&l, &u))| violation(g, l, u));
    at.c.iter().map(|c| c.abs()).sum::<f64>() + outside.sum::<f64>()
}
