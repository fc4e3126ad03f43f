//! Stability of human and vehicle by Nyquist's criterion, which needs no approximation of delays.

use super::{Hands, ModelVehicle, Vehicle};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::PI;

/// Growth rate that is allowed [1/s]: integrators have poles at 0.
const GROWTH: f64 = 1e-3;

/// Frequency range of the Nyquist contour [rad/s]; above it the loop gain is nearly 0.
const LOWEST: f64 = 1e-4;
const HIGHEST: f64 = 1e4;

/// Whether no mode of the linear loop grows by more than [`GROWTH`]: the number of turns of `det(I + L)` about 0 along
/// that line, upwards, is the number of the vehicle's poles to the right of it minus that of the closed loop.
pub fn is_stable(hands: &Hands, vehicle: &ModelVehicle) -> bool {
    let poles = vehicle.linear().poles();
    let unstable = poles.iter().filter(|pole| pole.re > GROWTH).count();
    let frequencies = (0..)
        .map(|k| LOWEST * 1.003_f64.powi(k))
        .take_while(|w| *w < HIGHEST);
    let mut last = return_difference(hands, vehicle, Complex::from(GROWTH));
    // Turns of the upper half; the lower one is its mirror image.
    let mut angle = 0.0;
    for frequency in frequencies {
        let next = return_difference(hands, vehicle, Complex::new(GROWTH, frequency));
        angle += (next / last).arg();
        last = next;
    }
    (angle / PI).round() == unstable as f64
}

/// `det(I + L(s))`, where L is the path from the errors through the hands to the positions.
fn return_difference(hands: &Hands, vehicle: &ModelVehicle, s: Complex<f64>) -> Complex<f64> {
    let n = hands.axes.len();
    let positions = DMatrix::from_fn(n, n, |i, j| vehicle.linear().transfer(i, j, s));
    let sticks = DMatrix::from_fn(n, n, |i, j| {
        let part = if i == j { 1.0 } else { hands.coupling };
        hands.axes[i].arm(s) * hands.axes[j].eye(s) * (part * vehicle.sign(j))
    });
    (DMatrix::identity(n, n) + positions * sticks).determinant()
}
