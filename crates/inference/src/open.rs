//! Directions of the unknowns that the data leave open, and whether a quantity changes along them.

use nalgebra::{DMatrix, DVector};

/// Change of a quantity, in its standard deviations, from which on it depends on an open direction: while unknowns change by
/// their whole size.
const DEPENDS: f64 = 1e-3;
/// Sum of a gradient's terms, relative to their sizes, that is rounding, also in finite differences.
const ROUNDING: f64 = 1e-6;

/// Directions in which the predictions do not change.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Open {
    /// One for each: along it an unknown changes by its typical magnitude, and the others by less.
    pub directions: Vec<DVector<f64>>,
}

impl Open {
    /// From changes of the unknowns, one direction per column, and their typical magnitudes.
    pub(crate) fn new(columns: &DMatrix<f64>, scales: &DVector<f64>) -> Self {
        let directions = columns.column_iter().filter_map(|column| {
            let largest = column.component_div(scales).amax();
            (largest > 0.0).then(|| column / largest)
        });
        Self {
            directions: directions.collect(),
        }
    }

    /// Whether a quantity with this gradient, and this standard deviation from what the data determine, is undetermined: its
    /// gradient is not orthogonal to the open directions.
    pub fn moves(&self, gradient: &DVector<f64>, sd: f64) -> bool {
        self.directions.iter().any(|own| {
            let terms = gradient.component_mul(own);
            let size = terms.iter().map(|term| term.abs()).sum::<f64>();
            Self::is_moved(terms.sum(), sd, size)
        })
    }

    /// Whether a change along an open direction is more than nothing for a quantity with this standard deviation and this size.
    pub fn is_moved(change: f64, sd: f64, size: f64) -> bool {
        change.is_nan() || change.abs() > (DEPENDS * sd).max(ROUNDING * size)
    }
}
