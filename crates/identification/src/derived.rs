//! Quantities derived from θ: the figures of the closed loop with the vehicle, each with its interval.

use super::{Fit, FitOptions};
use nalgebra::Complex;
use pilotage_flights::vehicle::LinearVehicle;
use pilotage_inference::Interval;
use pilotage_linear::{Figure, LoopFigures, OpenLoop};
use pilotage_models::{Pilot, Quadcopter};
use pilotage_refits::study::Derive;

/// The open loop of a pilot and a vehicle at hover, cut at the stick.
pub fn open_loop(
    vehicle: Quadcopter,
    pilot: Pilot,
    theta: &[f64],
) -> OpenLoop<impl Fn(f64) -> Complex<f64> + use<>> {
    let linear = LinearVehicle::of(&vehicle);
    let own = theta.to_vec();
    OpenLoop {
        response: move |omega| linear.loop_at(pilot, &own, omega),
        open: [pilot.poles(theta), linear.poles()].concat(),
        closed: linear.closed_poles(pilot, theta),
    }
}

/// The figures of a fit's closed loop, each with its interval (delta method): crossover frequency, phase and gain
/// margin, effective delay, poles ([`LoopFigures::named`]). Empty if the fit has no vehicle or no covariance.
pub fn derived(fit: &Fit, options: &FitOptions) -> Vec<(Figure, Interval)> {
    let (Some(sure), Some(vehicle)) = (&fit.uncertainty, options.loop_vehicle()) else {
        return Vec::new();
    };
    let of = |theta: &[f64]| open_loop(*vehicle, options.pilot, theta);
    let mut figures = of(&fit.theta).figures();
    if let Some(closed) = &fit.closed_loop {
        figures.poles.clone_from(&closed.poles);
    }
    let near = |theta: &[f64]| -> LoopFigures { of(theta).figures_near(&figures) };
    let named = figures.named();
    let values: Vec<f64> = named.iter().map(|figure| figure.value).collect();
    let moved = |theta: &[f64]| -> Vec<f64> {
        let moved = near(theta).named();
        named.iter().map(|own| own.value_in(&moved)).collect()
    };
    let intervals = sure.derived(&fit.theta, &values, moved);
    named.into_iter().zip(intervals).collect()
}

/// The names of the figures.
pub(super) fn names(fit: &Fit, options: &FitOptions) -> Vec<String> {
    derived(fit, options)
        .into_iter()
        .map(|(figure, _)| figure.name)
        .collect()
}

/// The same figures for the pilots of refits.
pub(super) fn again(fit: &Fit, options: &FitOptions) -> Box<Derive<'static>> {
    let (named, pilot) = (derived(fit, options), options.pilot);
    let Some(vehicle) = options.loop_vehicle().copied() else {
        return Box::new(|_| Vec::new());
    };
    let poles = fit
        .closed_loop
        .as_ref()
        .map_or(Vec::new(), |own| own.poles.clone());
    Box::new(move |theta| {
        let found = open_loop(vehicle, pilot, theta)
            .figures_with(&poles)
            .named();
        named
            .iter()
            .map(|(figure, _)| figure.value_in(&found))
            .collect()
    })
}
