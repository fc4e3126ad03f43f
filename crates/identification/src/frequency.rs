//! Describing functions of pilot and loop from flights whose target is a sum of sines
//! ([`pilotage_inference::spectrum`]).

use super::{Fit, FitOptions, Trial};
use nalgebra::Complex;
use pilotage_flights::trials::driven;
use pilotage_flights::vehicle::{LinearVehicle, pilot_response};
use pilotage_inference::Spread;
use pilotage_inference::spectrum::{Describing, Model};

/// Describing functions of pilot and loop, compared with a fitted θ. The loop has no fitted values if the vehicle is
/// not known.
pub fn describing(fit: &Fit, trials: &[Trial], options: &FitOptions) -> Describing {
    let (theta, vehicle) = (&fit.theta, options.loop_vehicle().map(LinearVehicle::of));
    let of_pilot = |theta: &[f64], omega: f64| pilot_response(options.pilot, theta, omega);
    let of_loop = |theta: &[f64], omega: f64| match &vehicle {
        Some(vehicle) => vehicle.loop_at(options.pilot, theta, omega),
        None => Complex::new(f64::NAN, f64::NAN),
    };
    let [fitted_pilot, fitted_loop] = [&|omega| of_pilot(theta, omega), &|omega| {
        of_loop(theta, omega)
    }] as [Model<'_>; 2];
    let mut own = Describing::of(&driven(trials), [fitted_pilot, fitted_loop]);
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
