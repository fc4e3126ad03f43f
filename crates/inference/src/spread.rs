//! How sure a fit is of its parameters, without its data: their covariance, and what follows for quantities that are
//! functions of them.

use crate::covariance::{Covariance, Method};
use crate::interval::Interval;
use crate::open::Open;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Step of finite differences, in standard deviations.
const STEP: f64 = 1e-3;

/// What intervals of functions of the parameters θ require.
#[derive(Debug, Clone, PartialEq)]
pub struct Spread {
    /// Method of the covariance.
    pub method: Method,
    /// Covariance of θ.
    pub covariance: DMatrix<f64>,
    /// Degrees of freedom of Student's t for each component.
    pub degrees: Vec<f64>,
    /// Directions of θ that the data leave open: what changes along them has no interval.
    pub open: Open,
}

impl Spread {
    /// That of a covariance.
    pub fn of(covariance: &Covariance, open: &Open) -> Self {
        Self {
            method: covariance.method,
            covariance: covariance.matrix.clone(),
            degrees: covariance.degrees.clone(),
            open: open.clone(),
        }
    }

    /// Intervals of quantities derived from θ, such as margins or poles, with these values at θ (delta method, by
    /// central differences of `of`). Differences are taken along the axes of the ellipsoid, not along each component:
    /// if a pole diverges, the components are individually far less certain than in combination, and their
    /// contributions would not cancel.
    pub fn derived(
        &self,
        theta: &[f64],
        values: &[f64],
        of: impl Fn(&[f64]) -> Vec<f64>,
    ) -> Vec<Interval> {
        let slopes = |axis: &DVector<f64>| {
            let moved = |by: f64| {
                let moved = DVector::from_column_slice(theta) + by * axis;
                DVector::from_vec(of(moved.as_slice()))
            };
            (moved(STEP) - moved(-STEP)) / (2.0 * STEP)
        };
        let mut variances = DVector::zeros(values.len());
        for axis in self.axes() {
            let slopes = slopes(&axis);
            variances += slopes.component_mul(&slopes);
        }
        for direction in &self.open.directions {
            let moved = slopes(direction);
            for (k, variance) in variances.iter_mut().enumerate() {
                if Open::is_moved(moved[k], variance.sqrt(), values[k].abs()) {
                    *variance = f64::INFINITY;
                }
            }
        }
        let interval = |(value, variance): (&f64, &f64)| {
            let open = [f64::NEG_INFINITY, f64::INFINITY];
            Interval::new(*value, variance.sqrt(), self.least_degrees(), open, None)
        };
        values.iter().zip(&variances).map(interval).collect()
    }

    /// Axes of the ellipsoid of one standard deviation: the sum of `a aᵀ` over them is the covariance.
    fn axes(&self) -> Vec<DVector<f64>> {
        let sd = self.covariance.diagonal().map(f64::sqrt);
        let n = sd.len();
        let correlation = DMatrix::from_fn(n, n, |i, j| match sd[i] * sd[j] > 0.0 {
            true => self.covariance[(i, j)] / (sd[i] * sd[j]),
            false => 0.0,
        });
        let eigen = SymmetricEigen::new(correlation);
        let pairs = eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter());
        let is_there = |own: &(&f64, _)| *own.0 > 0.0;
        pairs
            .filter(is_there)
            .map(|(value, vector)| value.sqrt() * vector.component_mul(&sd))
            .collect()
    }

    /// Degrees of freedom of a quantity that depends on all components.
    pub fn least_degrees(&self) -> f64 {
        self.degrees.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two components with an uncertainty of five times their size, whose ratio is certain to a hundredth.
    #[test]
    fn what_components_are_together_is_surer_than_they_are() {
        let half = 0.5_f64.sqrt();
        let along = 5e7 * DVector::from_vec(vec![half, half]);
        let across = 1e5 * DVector::from_vec(vec![half, -half]);
        let covariance = &along * along.transpose() + &across * across.transpose();
        let spread = Spread {
            method: Method::Plain,
            covariance,
            degrees: vec![1e9; 2],
            open: Open::default(),
        };
        let ratio = |theta: &[f64]| vec![theta[0] / theta[1], theta[0]];
        let theta = [1e7, 1e7];
        let found = spread.derived(&theta, &ratio(&theta), ratio);
        let expected = [2.0 * half * 1e5 / 1e7, half * (5e7_f64.hypot(1e5))];
        for (own, expected) in found.iter().zip(expected) {
            assert!(
                (own.sd / expected - 1.0).abs() < 1e-4,
                "{own:?}, {expected}"
            );
        }
    }

    /// Of two components the data determine the product alone.
    #[test]
    fn what_changes_along_an_open_direction_has_no_interval() {
        let theta = [2.0, 5.0];
        let across = DVector::from_vec(vec![0.02, 0.05]);
        let spread = Spread {
            method: Method::Plain,
            covariance: &across * across.transpose(),
            degrees: vec![1e9; 2],
            open: Open {
                directions: vec![DVector::from_vec(vec![2.0, -5.0])],
            },
        };
        let of = |theta: &[f64]| vec![theta[0] * theta[1], theta[0]];
        let found = spread.derived(&theta, &of(&theta), of);
        assert!((found[0].sd / 0.2 - 1.0).abs() < 1e-6, "{found:?}");
        assert!(found[1].sd.is_infinite(), "{found:?}");
    }
}
