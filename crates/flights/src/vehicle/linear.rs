//! Transfer functions of pilot and vehicle about hover: the open loop, and the characteristic polynomial of the closed one.

use nalgebra::Complex;
use pilotage_models::pilot::roots;
use pilotage_models::{Pilot, Quadcopter, Scalar, quadcopter::N_STATES};

/// Response of a pilot from the error \[m\] to the stick at jω.
pub fn pilot_response(pilot: Pilot, theta: &[f64], omega: f64) -> Complex<f64> {
    let s = Complex::new(0.0, omega);
    let (denominator, numerator) = theta.split_at(pilot.order);
    polynomial(numerator, s) / monic(denominator, s)
}

/// The value of a polynomial with ascending coefficients.
fn polynomial(c: &[f64], s: Complex<f64>) -> Complex<f64> {
    let zero = Complex::new(0.0, 0.0);
    c.iter().rev().fold(zero, |value, c| value * s + c)
}

/// The same with 1 after these coefficients.
fn monic(c: &[f64], s: Complex<f64>) -> Complex<f64> {
    polynomial(&[c, &[1.0]].concat(), s)
}

/// Transfer function from stick to position: `-gain / (s² (s³ + c₂ s² + c₁ s + c₀))`, the vehicle about hover.
///
/// The sum of the two rotor speeds is omitted: no stick input excites it, and it decays with the propeller's lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearVehicle {
    gain: f64,
    pitch: [f64; 3],
    lag: f64,
}

impl LinearVehicle {
    /// Linearises a vehicle.
    pub fn of(vehicle: &Quadcopter) -> Self {
        let pitch = vehicle.pitch_polynomial();
        Self {
            gain: vehicle.gravity * vehicle.max_pitch * pitch[0],
            pitch,
            lag: vehicle.propeller_lag,
        }
    }

    /// Its poles [1/s], without that of the sum of the rotor speeds.
    pub fn poles(&self) -> Vec<Complex<f64>> {
        let zeros = [Complex::new(0.0, 0.0); 2];
        [&zeros[..], &roots(&self.pitch)].concat()
    }

    /// Poles of the closed loop with a pilot [1/s], including that of the sum of the rotor speeds.
    pub fn closed_poles(&self, pilot: Pilot, theta: &[f64]) -> Vec<Complex<f64>> {
        let polynomial = self.characteristic(pilot, theta);
        let mut poles = roots(&polynomial[..self.degree(pilot)]);
        poles.push(Complex::new(-self.lag, 0.0));
        poles
    }

    /// Open loop with a pilot `N/D` at s = jω, cut at the stick: `L = -gain N / (D s² P)`. The closed loop is
    /// `1 + L = 0`.
    pub fn loop_at(&self, pilot: Pilot, theta: &[f64], omega: f64) -> Complex<f64> {
        let s = Complex::new(0.0, omega);
        let (denominator, numerator) = theta.split_at(pilot.order);
        let rest = monic(denominator, s) * s * s * monic(&self.pitch, s);
        -self.gain * polynomial(numerator, s) / rest
    }

    /// Degree of the closed loop's characteristic polynomial with this pilot.
    pub fn degree(&self, pilot: Pilot) -> usize {
        N_STATES - 1 + pilot.order
    }

    /// The monic characteristic polynomial of the closed loop, in ascending coefficients including the leading 1:
    /// `D s² P - gain N` for the pilot `N/D` and the pitch loop's P.
    pub fn characteristic<T: Scalar>(&self, pilot: Pilot, theta: &[T]) -> Vec<T> {
        let n = pilot.order;
        let mut out = vec![T::from(0.0); self.degree(pilot) + 1];
        let [c0, c1, c2] = self.pitch;
        for (k, p) in [c0, c1, c2, 1.0].into_iter().enumerate() {
            for (i, d) in theta[..n].iter().enumerate() {
                out[i + k + 2] += *d * p;
            }
            out[n + k + 2] += T::from(p);
        }
        for (out, numerator) in out.iter_mut().zip(&theta[n..]) {
            *out -= *numerator * self.gain;
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::ClosedLoop;
    use pilotage_models::pilot::PAPER_THETA;
    use proptest::prelude::*;

    proptest! {
        /// The polynomial and the Jacobian yield the same poles.
        #[test]
        fn the_polynomial_has_the_poles_of_the_joint_equations(
            order in 1_usize..=6,
            theta in prop::collection::vec(0.1..5.0_f64, 12),
            mass in 0.5..5.0_f64,
            gain in 10.0..40.0_f64,
        ) {
            let vehicle = Quadcopter { mass, attitude_gain: gain, ..Quadcopter::default() };
            let pilot = Pilot { order };
            let theta: Vec<f64> = (0..2 * order).map(|i| if i < order { theta[i] } else { -0.1 * theta[i] }).collect();
            let p = LinearVehicle::of(&vehicle).characteristic(pilot, &theta);
            let poles = ClosedLoop::of(vehicle, pilot, &theta).poles;
            prop_assert_eq!(poles.len(), p.len(), "one pole more: the sum of the rotor speeds");
            for pole in poles.iter().filter(|pole| (*pole + vehicle.propeller_lag).norm() > 1e-6) {
                let value = p.iter().rev().fold(Complex::new(0.0, 0.0), |v, c| v * pole + c);
                let size = p.iter().rev().fold(0.0, |v, c| v * pole.norm() + c.abs());
                prop_assert!(value.norm() < 1e-8 * size, "{} at {}", value, pole);
            }
        }
    }

    /// The pilot: a first-order one computed by hand. The loop: by the eigenvalues of the joint equations, since
    /// `1 + L` is the product of the distances to the closed poles over that to the open ones.
    #[test]
    fn responses_are_those_of_the_equations() {
        let one = Pilot { order: 1 };
        let found = pilot_response(one, &[3.0, -2.0], 4.0);
        assert!((found - Complex::new(-2.0, 0.0) / Complex::new(3.0, 4.0)).norm() < 1e-15);
        let (order, vehicle) = (Pilot { order: 3 }, Quadcopter::default());
        let poles = |theta: &[f64]| ClosedLoop::of(vehicle, order, theta).poles;
        let mut idle = PAPER_THETA.to_vec();
        idle[3..].fill(0.0);
        let linear = LinearVehicle::of(&vehicle);
        for omega in [0.1, 0.5, 2.0, 20.0] {
            let s = Complex::new(0.0, omega);
            let product = |theta: &[f64]| {
                poles(theta)
                    .iter()
                    .map(|pole| s - pole)
                    .product::<Complex<f64>>()
            };
            let exact = product(&PAPER_THETA) / product(&idle) - 1.0;
            let found = linear.loop_at(order, &PAPER_THETA, omega);
            assert!(
                (found - exact).norm() < 1e-6 * (1.0 + exact.norm()),
                "{omega} {found} {exact}"
            );
        }
    }
}
