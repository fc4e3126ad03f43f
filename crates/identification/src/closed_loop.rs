//! Closed loop of pilot and vehicle, linearised about hover: its poles, and its characteristic polynomial, which a fit
//! keeps stable.

use super::joint::Joint;
use super::linearised::Linear;
use nalgebra::Complex;
use pilotage_collocation::Differentiated;
use pilotage_linear::eigenvalues;
use pilotage_models::pilot::roots;
use pilotage_models::{Pilot, Quadcopter, Scalar, quadcopter::N_STATES};

/// Smallest decay rate of the closed loop in a fit [1/s]: the real part of each pole is at most minus this. A slow mode
/// then decays within a thousand seconds; flights of seconds cannot determine more.
pub const LOOP_MARGIN: f64 = 1e-3;
/// A pole within this factor of the bound lies on it.
const ON_BOUND: f64 = 1.01;

/// The closed loop of a pilot and a vehicle at hover.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosedLoop {
    /// Its poles [1/s], sorted by magnitude: one per state of pilot and vehicle.
    pub poles: Vec<Complex<f64>>,
}

impl ClosedLoop {
    /// Computes the eigenvalues of the Jacobian of the joint equations for the pilot `theta` with this vehicle;
    /// infinite if they cannot be found.
    pub fn of(vehicle: Quadcopter, pilot: Pilot, theta: &[f64]) -> Self {
        let joint = Joint { vehicle, pilot };
        let linear = Linear::of(&Differentiated::new(&joint.system()), theta);
        Self {
            poles: eigenvalues(&linear.a),
        }
    }

    /// Whether every pole lies in the left half-plane.
    pub fn is_stable(&self) -> bool {
        self.rightmost().is_some_and(|pole| pole.re < 0.0)
    }

    /// The pole of highest frequency among those on the bound [`LOOP_MARGIN`]; `None` if the loop is unstable or no
    /// pole is on the bound.
    pub fn on_bound(&self) -> Option<Complex<f64>> {
        let on_bound = |pole: &Complex<f64>| pole.re >= -ON_BOUND * LOOP_MARGIN;
        let poles = self.poles.iter().copied().filter(on_bound);
        let fastest = poles.max_by(|a, b| a.im.total_cmp(&b.im))?;
        self.is_stable().then_some(fastest)
    }

    /// The pole with the greatest real part.
    pub fn rightmost(&self) -> Option<Complex<f64>> {
        let poles = self.poles.iter().copied();
        poles.max_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)))
    }
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

    /// Open loop `L(s)` with a pilot `N/D`, cut at the stick: `-gain N / (D s² P)`. The closed loop is `1 + L = 0`.
    pub fn loop_at(&self, pilot: Pilot, theta: &[f64], s: Complex<f64>) -> Complex<f64> {
        let value = |p: &[f64]| {
            let zero = Complex::new(0.0, 0.0);
            p.iter().rev().fold(zero, |sum, c| sum * s + c)
        };
        let monic = |p: &[f64]| value(&[p, &[1.0]].concat());
        let (denominator, numerator) = theta.split_at(pilot.order);
        -self.gain * value(numerator) / (monic(denominator) * s * s * monic(&self.pitch))
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

/// First column of Routh's array of `p(s - margin)`, without its leading entry: all entries are positive exactly if
/// each root of `p` has a real part below `-margin` (Gantmacher, *The Theory of Matrices*, vol. 2, ch. XV, §3). `p` has
/// ascending coefficients and the leading one 1; `out` is as long as its degree.
///
/// When a path leaves the stable region, one of the last two entries vanishes first: a real root, or a pair, is on the
/// margin.
pub fn routh<T: Scalar>(p: &[T], margin: f64, out: &mut [T]) {
    let mut p = p.to_vec();
    shift(&mut p, -margin);
    p.reverse();
    let at = |row: &[T], k: usize| row.get(k).copied().unwrap_or_else(|| T::from(0.0));
    let mut upper: Vec<T> = p.iter().copied().step_by(2).collect();
    let mut lower: Vec<T> = p.iter().copied().skip(1).step_by(2).collect();
    for out in out.iter_mut() {
        *out = lower[0];
        let factor = upper[0] / lower[0];
        let next = (1..upper.len()).map(|k| upper[k] - factor * at(&lower, k));
        let next = next.collect();
        upper = std::mem::replace(&mut lower, next);
        if lower.is_empty() {
            break;
        }
    }
}

/// `p(s)` becomes `p(s + by)`, by Horner's scheme.
fn shift<T: Scalar>(p: &mut [T], by: f64) {
    for first in 0..p.len() - 1 {
        for k in (first..p.len() - 1).rev() {
            let above = p[k + 1];
            p[k] += above * by;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn polynomial(roots: &[Complex<f64>]) -> Vec<f64> {
        let mut p = super::super::start::denominator(roots.iter().copied());
        p.push(1.0);
        p
    }

    fn worst(roots: &[Complex<f64>]) -> f64 {
        roots.iter().map(|r| r.re).fold(f64::NEG_INFINITY, f64::max)
    }

    proptest! {
        /// The array agrees with the roots from which the polynomial was made.
        #[test]
        fn the_array_is_positive_where_all_roots_are_left_of_the_margin(
            real in prop::collection::vec(-4.0..0.5_f64, 0..4),
            pairs in prop::collection::vec((-4.0..0.5_f64, 0.1..5.0_f64), 0..4),
            margin in prop::sample::select(vec![0.0, 1e-3, 0.1]),
        ) {
            let pairs = pairs.iter().flat_map(|&(re, im)| [Complex::new(re, im), Complex::new(re, -im)]);
            let roots: Vec<_> = real.iter().map(|&re| Complex::new(re, 0.0)).chain(pairs).collect();
            prop_assume!(!roots.is_empty() && (worst(&roots) + margin).abs() > 1e-4);
            let mut out = vec![f64::NAN; roots.len()];
            routh(&polynomial(&roots), margin, &mut out);
            let stable = worst(&roots) < -margin;
            prop_assert_eq!(out.iter().all(|v| *v > 0.0), stable, "{:?}", out);
        }

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

    /// Position feedback alone on a double integrator: a pair in the right half-plane. With lead it is stable.
    #[test]
    fn a_pilot_without_lead_is_unstable() {
        let of = |theta: &[f64]| ClosedLoop::of(Quadcopter::default(), Pilot { order: 1 }, theta);
        assert!(!of(&[1.0, -0.03]).is_stable());
        assert!(of(&[1.0, -0.03]).rightmost().unwrap().im > 0.0);
        let lead = [216.0, 108.0, 18.0, -6.48, -16.2, -0.5];
        assert!(ClosedLoop::of(Quadcopter::default(), Pilot { order: 3 }, &lead).is_stable());
        assert!(
            !of(&[f64::NAN, -0.03]).is_stable(),
            "not known is not stable"
        );
    }
}
