//! A point with its multipliers and values.

use super::{Problem, vector};

/// A primal-dual point and the problem's values there.
#[derive(Debug, Clone, PartialEq)]
pub struct Iterate {
    /// Variables.
    pub z: Vec<f64>,
    /// Multipliers λ of `c(z) = 0`, in the Lagrangian `f + λᵀc + ηᵀg`.
    pub lambda: Vec<f64>,
    /// Multipliers η of `lower ≤ g ≤ upper`: positive at the upper, negative at the lower limit.
    pub eta: Vec<f64>,
    /// Objective.
    pub f: f64,
    /// Equality constraints.
    pub c: Vec<f64>,
    /// Inequality constraints.
    pub g: Vec<f64>,
}

impl Iterate {
    /// The point `z` with zero multipliers, evaluated.
    pub fn new<P: Problem + ?Sized>(problem: &P, z: Vec<f64>) -> Self {
        let n_inequalities = problem.limits().0.len();
        let mut iterate = Self {
            z,
            lambda: vec![0.0; problem.n_equalities()],
            eta: vec![0.0; n_inequalities],
            f: 0.0,
            c: vec![0.0; problem.n_equalities()],
            g: vec![0.0; n_inequalities],
        };
        iterate.evaluate(problem);
        iterate
    }

    /// Evaluates objective and constraints at `z`.
    pub fn evaluate<P: Problem + ?Sized>(&mut self, problem: &P) {
        self.f = problem.evaluate(&self.z, &mut self.c, &mut self.g);
    }

    /// True when every value is finite.
    pub fn is_finite(&self) -> bool {
        self.f.is_finite() && vector::is_finite(&self.c) && vector::is_finite(&self.g)
    }
}

/// Distance of `g` outside `[lower, upper]`; zero inside.
#[inline]
pub fn violation(g: f64, lower: f64, upper: f64) -> f64 {
    (lower - g).max(g - upper).max(0.0)
}
