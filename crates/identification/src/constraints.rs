//! Stability of the identified pilot, and of its closed loop.

use super::closed_loop::{LOOP_MARGIN, routh};
use pilotage_collocation::ParameterConstraints;
use pilotage_flights::vehicle::LinearVehicle;
use pilotage_models::{Pilot, Scalar};

/// Smallest value of a coefficient or a Hurwitz minor, in its own unit: it makes the paper's strict inequalities (its
/// eq. for Routh–Hurwitz) closed.
pub const STABILITY_MARGIN: f64 = 1e-6;

/// Condition that the pilot's characteristic polynomial `s^n + θ_n s^{n-1} + ... + θ_1` is Hurwitz.
///
/// In the form of Liénard and Chipart (Gantmacher, *The Theory of Matrices*, vol. 2, ch. XV, §13): all coefficients
/// positive, and every second Hurwitz minor from the last but one down. For the third order these are the paper's four
/// conditions, θ1, θ2, θ3 > 0 and θ3 θ2 - θ1 > 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RouthHurwitz {
    /// The pilot's structure.
    pub pilot: Pilot,
}

impl RouthHurwitz {
    /// Sizes of the constrained minors, largest first.
    fn minors(&self) -> impl Iterator<Item = usize> + use<> {
        let n = self.pilot.order;
        (2..n).rev().step_by(2)
    }
}

impl RouthHurwitz {
    /// Number of constraints.
    pub fn count(&self) -> usize {
        self.pilot.order + self.minors().count()
    }

    /// Writes the constraint values; each must be at least zero.
    pub fn values<T: Scalar>(&self, theta: &[T], out: &mut [T]) {
        let n = self.pilot.order;
        for (out, theta) in out.iter_mut().zip(&theta[..n]) {
            *out = *theta - STABILITY_MARGIN;
        }
        for (out, size) in out[n..].iter_mut().zip(self.minors()) {
            *out = hurwitz_minor(&theta[..n], size) - STABILITY_MARGIN;
        }
    }
}

/// Conditions that the pilot is stable, and its closed loop with a vehicle, if given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stability {
    /// Conditions on the pilot.
    pub pilot: RouthHurwitz,
    /// The vehicle with which the closed loop decays at least as fast as [`LOOP_MARGIN`]; `None` for no condition on
    /// it.
    pub vehicle: Option<LinearVehicle>,
}

impl Stability {
    /// The conditions as constraints of a nonlinear program.
    pub fn constraints(&self) -> ParameterConstraints {
        let parameters = self.pilot.pilot.n_parameters();
        let traced = ParameterConstraints::trace(parameters, |theta| {
            let mut values = vec![theta[0]; self.count()];
            self.values(theta, &mut values);
            values
        });
        traced.expect("the conditions are expressions")
    }

    /// Whether θ fulfils every condition.
    pub fn holds(&self, theta: &[f64]) -> bool {
        let mut values = vec![0.0; self.count()];
        self.values(theta, &mut values);
        values.iter().all(|value| *value >= 0.0)
    }
}

impl Stability {
    /// Number of conditions.
    pub fn count(&self) -> usize {
        let closed_loop = self.vehicle.map_or(0, |v| v.degree(self.pilot.pilot));
        self.pilot.count() + closed_loop
    }

    /// Writes the values of the conditions; each must be at least zero.
    pub fn values<T: Scalar>(&self, theta: &[T], out: &mut [T]) {
        let (own, closed_loop) = out.split_at_mut(self.pilot.count());
        self.pilot.values(theta, own);
        if let Some(vehicle) = self.vehicle {
            let characteristic = vehicle.characteristic(self.pilot.pilot, theta);
            routh(&characteristic, LOOP_MARGIN, closed_loop);
        }
    }
}

/// Leading principal minor of the Hurwitz matrix of `s^n + c[n-1] s^{n-1} + ... + c[0]`.
fn hurwitz_minor<T: Scalar>(c: &[T], size: usize) -> T {
    let n = c.len();
    // a_k is the coefficient of s^(n-k); entry (i, j) of the matrix is a_(2(j+1)-(i+1)).
    let entry = |i: usize, j: usize| match (2 * (j + 1)).checked_sub(i + 1) {
        Some(0) => T::from(1.0),
        Some(k) if k <= n => c[n - k],
        _ => T::from(0.0),
    };
    let columns: Vec<usize> = (0..size).collect();
    determinant(&entry, 0, &columns)
}

/// Laplace expansion along row `row`; the minors are at most a few rows.
fn determinant<T: Scalar>(entry: &impl Fn(usize, usize) -> T, row: usize, columns: &[usize]) -> T {
    if columns.is_empty() {
        return T::from(1.0);
    }
    let mut sum = T::from(0.0);
    for (k, &column) in columns.iter().enumerate() {
        let others: Vec<usize> = columns.iter().copied().filter(|c| *c != column).collect();
        let term = entry(row, column) * determinant(entry, row + 1, &others);
        sum = if k % 2 == 0 { sum + term } else { sum - term };
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn third_order_gives_the_papers_conditions() {
        let mut out = [0.0; 4];
        RouthHurwitz {
            pilot: Pilot { order: 3 },
        }
        .values(&[2.0, 3.0, 5.0], &mut out);
        let expected = [2.0, 3.0, 5.0, 5.0 * 3.0 - 2.0].map(|v: f64| v - STABILITY_MARGIN);
        assert_eq!(out, expected);
    }

    proptest! {
        /// The conditions hold exactly when every root has a negative real part.
        #[test]
        fn conditions_agree_with_the_roots(order in 1_usize..=6, c in prop::collection::vec(-1.0..8.0_f64, 6)) {
            let pilot = Pilot { order };
            let constraints = RouthHurwitz { pilot };
            let mut out = vec![0.0; constraints.count()];
            constraints.values(&c[..order], &mut out);
            let worst = pilot.poles(&c[..order]).iter().map(|p| p.re).fold(f64::NEG_INFINITY, f64::max);
            prop_assume!(worst.abs() > 1e-3);
            prop_assert_eq!(out.iter().all(|v| *v >= 0.0), worst < 0.0);
        }
    }
}
