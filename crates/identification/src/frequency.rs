//! Frequency responses of pilot and loop, and their describing functions from flights whose target is a sum of sines
//! ([`pilotage_inference::spectrum`]).

use super::closed_loop::LinearVehicle;
use super::{Fit, FitOptions, Trial};
use nalgebra::Complex;
use pilotage_inference::Spread;
use pilotage_inference::spectrum::{Describing, Flight, Model};
use pilotage_models::Pilot;

/// The value of a polynomial with ascending coefficients.
fn polynomial(c: &[f64], s: Complex<f64>) -> Complex<f64> {
    let zero = Complex::new(0.0, 0.0);
    c.iter().rev().fold(zero, |value, c| value * s + *c)
}

/// Response from the error \[m\] to the stick at jω.
pub fn pilot(pilot: Pilot, theta: &[f64], omega: f64) -> Complex<f64> {
    let s = Complex::new(0.0, omega);
    let (denominator, numerator) = theta.split_at(pilot.order);
    polynomial(numerator, s) / (polynomial(denominator, s) + s.powu(pilot.order as u32))
}

/// Open loop of pilot and vehicle, cut at the stick, at jω: `L = p/p₀ - 1`, where `p` is the closed loop's
/// characteristic polynomial, and `p₀` that with a pilot of zero gain.
pub fn open_loop(vehicle: &LinearVehicle, pilot: Pilot, theta: &[f64], omega: f64) -> Complex<f64> {
    let s = Complex::new(0.0, omega);
    let mut idle = theta.to_vec();
    idle[pilot.order..].fill(0.0);
    let [closed, open] = [theta, &idle].map(|theta| vehicle.characteristic(pilot, theta));
    let difference: Vec<f64> = closed.iter().zip(&open).map(|(a, b)| a - b).collect();
    polynomial(&difference, s) / polynomial(&open, s)
}

/// Describing functions of pilot and loop, compared with a fitted θ. The loop has no fitted values if the vehicle is
/// not known.
pub fn describing(fit: &Fit, trials: &[Trial], options: &FitOptions) -> Describing {
    let (theta, vehicle) = (&fit.theta, options.loop_vehicle().map(LinearVehicle::of));
    let of_pilot = |theta: &[f64], omega: f64| pilot(options.pilot, theta, omega);
    let of_loop = |theta: &[f64], omega: f64| match &vehicle {
        Some(vehicle) => open_loop(vehicle, options.pilot, theta, omega),
        None => Complex::new(f64::NAN, f64::NAN),
    };
    let [fitted_pilot, fitted_loop] = [&|omega| of_pilot(theta, omega), &|omega| {
        of_loop(theta, omega)
    }] as [Model<'_>; 2];
    let mut own = Describing::of(&flights(trials), [fitted_pilot, fitted_loop]);
    if let Some(sure) = &fit.uncertainty {
        let variance = |of: &dyn Fn(&[f64], f64) -> Complex<f64>, omega: f64| {
            variance(&sure.spread, theta, |theta| of(theta, omega))
        };
        own.pilot = own.pilot.known_as(|omega| variance(&of_pilot, omega));
        own.open_loop = own.open_loop.known_as(|omega| variance(&of_loop, omega));
    }
    own
}

/// Mean square error of a response that depends on θ (delta method); 0 if not known.
fn variance(spread: &Spread, theta: &[f64], of: impl Fn(&[f64]) -> Complex<f64>) -> f64 {
    let parts = |theta: &[f64]| {
        let value = of(theta);
        vec![value.re, value.im]
    };
    let ends = spread.derived(theta, &parts(theta), parts);
    let variance: f64 = ends.iter().map(|own| own.sd.powi(2)).sum();
    if variance.is_finite() { variance } else { 0.0 }
}

/// Trials as flights driven only by their target.
pub fn flights(trials: &[Trial]) -> Vec<Flight<'_>> {
    let error = |own: &Trial| {
        let pairs = own.target.iter().zip(&own.position);
        pairs.map(|(target, position)| target - position).collect()
    };
    let all = trials.iter().map(|trial| Flight {
        name: &trial.name,
        time: &trial.time,
        forcing: vec![&trial.target],
        error: error(trial),
        stick: trial.stick.as_deref(),
        position: &trial.position,
    });
    all.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pilotage_models::Quadcopter;
    use pilotage_models::pilot::PAPER_THETA;

    /// The pilot: a first-order one computed by hand. The loop: by the eigenvalues of the joint equations, since
    /// `1 + L` is the product of the distances to the closed poles over that to the open ones.
    #[test]
    fn responses_are_those_of_the_equations() {
        let one = Pilot { order: 1 };
        let found = pilot(one, &[3.0, -2.0], 4.0);
        assert!((found - Complex::new(-2.0, 0.0) / Complex::new(3.0, 4.0)).norm() < 1e-15);
        let (order, vehicle) = (Pilot { order: 3 }, Quadcopter::default());
        let poles = |theta: &[f64]| crate::ClosedLoop::of(vehicle, order, theta).poles;
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
            let found = open_loop(&linear, order, &PAPER_THETA, omega);
            assert!(
                (found - exact).norm() < 1e-6 * (1.0 + exact.norm()),
                "{omega} {found} {exact}"
            );
        }
    }
}
