//! The stick that the motion of a flight implies, and its smoothed position.

use nalgebra::{Matrix4, Vector4};
use pilotage_models::Quadcopter;

/// Half width of the window of the local polynomials that smooth a recorded position [s].
const WINDOW: f64 = 0.35;

/// Smoothed position of a run with its derivatives, before any fit.
#[derive(Debug, Clone)]
pub struct Smoothed {
    /// Position \[m\].
    pub z: Vec<f64>,
    /// Velocity [m/s].
    pub v: Vec<f64>,
    /// Acceleration [m/s²].
    pub a: Vec<f64>,
}

/// Fits local cubic polynomials to the samples within 0.35 s (Savitzky & Golay 1964); no position is missing.
pub fn smooth(time: &[f64], position: &[f64]) -> Smoothed {
    let n = time.len();
    let mut out = Smoothed {
        z: position.to_vec(),
        v: vec![0.0; n],
        a: vec![0.0; n],
    };
    for k in 0..n {
        let t0 = time[k];
        let first = time.partition_point(|t| *t < t0 - WINDOW);
        let end = time.partition_point(|t| *t <= t0 + WINDOW);
        let near = match end - first < 5 {
            true => k.saturating_sub(2)..(k + 3).min(n),
            false => first..end,
        };
        if let Some(c) = local_cubic(&time[near.clone()], &position[near], t0) {
            out.z[k] = c[0];
            out.v[k] = c[1] / WINDOW;
            out.a[k] = 2.0 * c[2] / (WINDOW * WINDOW);
        }
    }
    out
}

/// Coefficients of the least-squares cubic in `(t - t0)/WINDOW`, of lower degree if there are too few values; the
/// others are zero.
fn local_cubic(time: &[f64], values: &[f64], t0: f64) -> Option<Vector4<f64>> {
    let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
    for (t, value) in time.iter().zip(values) {
        let x = (t - t0) / WINDOW;
        let mut row = Vector4::new(1.0, x, x * x, x * x * x);
        (time.len()..4).for_each(|unused| row[unused] = 0.0);
        normal += row * row.transpose();
        right += row * *value;
    }
    (time.len()..4).for_each(|unused| normal[(unused, unused)] = 1.0);
    normal.cholesky().map(|factor| factor.solve(&right))
}

/// The stick of the inverted vehicle: `sin φ = -v̇/g` with an attitude loop that follows the stick instantly. No position
/// is missing.
pub fn implied_stick(time: &[f64], position: &[f64], vehicle: &Quadcopter) -> Vec<f64> {
    let pitch = |a: &f64| -(a / vehicle.gravity).clamp(-0.95, 0.95).asin();
    let stick = |a: &f64| (pitch(a) / vehicle.max_pitch).clamp(-1.0, 1.0);
    smooth(time, position).a.iter().map(stick).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_keeps_its_derivatives() {
        let time: Vec<f64> = (0..40).map(|k| 0.05 * f64::from(k)).collect();
        let position = time.iter().map(|t| 1.0 + 2.0 * t - t * t + 0.5 * t.powi(3));
        let smoothed = smooth(&time, &position.collect::<Vec<_>>());
        for (k, t) in (0..40).map(|k| (k, 0.05 * k as f64)) {
            assert!((smoothed.z[k] - (1.0 + 2.0 * t - t * t + 0.5 * t.powi(3))).abs() < 1e-9);
            assert!((smoothed.v[k] - (2.0 - 2.0 * t + 1.5 * t * t)).abs() < 1e-9);
            assert!((smoothed.a[k] - (-2.0 + 3.0 * t)).abs() < 1e-9);
        }
    }

    /// Only two samples are near each other: the fit is a line without acceleration.
    #[test]
    fn two_samples_make_a_line() {
        let smoothed = smooth(&[0.0, 1.0], &[0.0, 3.0]);
        assert!((smoothed.z[1] - 3.0).abs() < 1e-9 && (smoothed.v[0] - 3.0).abs() < 1e-9);
        assert_eq!(smoothed.a, [0.0, 0.0]);
    }
}
