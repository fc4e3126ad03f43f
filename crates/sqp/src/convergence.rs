//! The scaled KKT residual, as IPOPT defines it (Wächter & Biegler, Math. Program. 106, 2006, eq. 5),
//! with two-sided inequalities.

use super::iterate::violation;
use super::{Iterate, Problem, vector};

/// Mean magnitude of the multipliers above which the dual residual is scaled down (Wächter & Biegler: s_max).
const MULTIPLIER_SCALE: f64 = 100.0;

/// The parts of the KKT residual at a point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Kkt {
    /// `‖∇f + Jᵀλ + Gᵀη‖∞ / s_d`.
    pub dual: f64,
    /// Largest violation of a constraint.
    pub primal: f64,
    /// Largest product of a multiplier and the distance from its limit, divided by `s_c`.
    pub complementarity: f64,
}

impl Kkt {
    /// Value at a point outside the problem's domain.
    pub const UNDEFINED: Self = Self {
        dual: f64::NAN,
        primal: f64::NAN,
        complementarity: f64::NAN,
    };

    /// The KKT residual at an iterate, given the gradient of its Lagrangian.
    pub fn at<P: Problem + ?Sized>(problem: &P, at: &Iterate, lagrangian_gradient: &[f64]) -> Self {
        let (lower, upper) = problem.limits();
        let mean = |sum: f64, n: usize| sum / n.max(1) as f64;
        let magnitude = |[v]: [f64; 1]| v.abs();
        let sum_eta = vector::sum([&at.eta], magnitude);
        let sum_lambda = vector::sum([&at.lambda], magnitude);
        let scale = |mean: f64| mean.max(MULTIPLIER_SCALE) / MULTIPLIER_SCALE;
        let s_d = scale(mean(sum_eta + sum_lambda, at.eta.len() + at.lambda.len()));
        let s_c = scale(mean(sum_eta, at.eta.len()));
        let rows = at.g.iter().zip(lower.iter().zip(upper));
        let outside = rows.clone().map(|(&g, (&l, &u))| violation(g, l, u));
        let products = rows.zip(&at.eta).map(|((&g, (&l, &u)), &eta)| match eta {
            e if e > 0.0 => e * (u - g).abs(),
            e if e < 0.0 => -e * (g - l).abs(),
            _ => 0.0,
        });
        Self {
            dual: vector::largest(lagrangian_gradient) / s_d,
            primal: outside.fold(vector::largest(&at.c), f64::max),
            complementarity: products.fold(0.0, f64::max) / s_c,
        }
    }

    /// The scaled KKT residual: the largest part; NaN if any part is NaN.
    pub fn residual(&self) -> f64 {
        let sum = self.dual + self.primal + self.complementarity;
        if sum.is_nan() {
            f64::NAN
        } else {
            self.dual.max(self.primal).max(self.complementarity)
        }
    }
}
