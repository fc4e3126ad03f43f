//! A point: variables, slacks, and the values there.

use super::Solver;
use crate::evaluation::Values;
use crate::program::Row;

const KAPPA_1: f64 = 1e-2;

/// A point.
#[derive(Debug, Clone, Default)]
pub(super) struct Point {
    pub z: Vec<f64>,
    pub values: Values,
    /// Limited quantities, their slacks, and the equations at the ends.
    pub g: Vec<f64>,
    pub s: Vec<f64>,
    pub e: Vec<f64>,
}

impl Point {
    fn residuals(&self) -> impl Iterator<Item = f64> {
        let limited = self.g.iter().zip(&self.s).map(|(g, s)| (g - s).abs());
        let defects = self.values.c.as_flattened().iter();
        limited.chain(defects.chain(&self.e).map(|c| c.abs()))
    }

    /// ℓ1 norm of the constraints, with the slacks.
    pub fn violation(&self) -> f64 {
        self.residuals().sum()
    }

    /// Largest violation of the constraints, with the slacks.
    pub fn infeasibility(&self) -> f64 {
        self.residuals().fold(0.0, f64::max)
    }

    pub fn is_finite(&self) -> bool {
        self.values.f.is_finite() && self.residuals().sum::<f64>().is_finite()
    }
}

/// A slack within the limits of a row, off them.
pub(super) fn inside(value: f64, row: &Row) -> f64 {
    let value = if value.is_finite() { value } else { 0.0 };
    let range = row.upper - row.lower;
    let room = |limit: f64| {
        let least = KAPPA_1 * limit.abs().max(1.0);
        match range.is_finite() {
            true => least.min(KAPPA_1 * range),
            false => least,
        }
    };
    let (low, high) = (row.lower + room(row.lower), row.upper - room(row.upper));
    match (row.lower.is_finite(), row.upper.is_finite()) {
        (true, true) => value.clamp(low, high),
        (true, false) => value.max(low),
        _ => value.min(high),
    }
}

impl Solver<'_> {
    /// The barrier objective.
    pub(super) fn barrier(&self, at: &Point) -> f64 {
        // Logarithms of products: of few factors, which stay far from the least number.
        const FACTORS: usize = 4;
        let mut sum = 0.0;
        for (rows, slacks) in self.rows.0.chunks(FACTORS).zip(at.s.chunks(FACTORS)) {
            let mut product = 1.0;
            for (row, s) in rows.iter().zip(slacks) {
                let (below, above) = (s - row.lower, row.upper - s);
                product *= if row.lower.is_finite() { below } else { 1.0 };
                product *= if row.upper.is_finite() { above } else { 1.0 };
            }
            sum += f64::ln(product);
        }
        self.factor * at.values.f - self.mu * sum
    }
}
