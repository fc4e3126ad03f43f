//! What pilots of known θ fly by the equations that are fitted.

use crate::posed;
use pilotage_estimation::evaluate::evaluate;
use pilotage_estimation::fit;
use pilotage_flights::options::{InitialState, Objective};
use pilotage_flights::{FlightOptions, Trial};
use pilotage_models::lti::Transition;
use pilotage_models::pilot::PAPER_THETA;
use pilotage_models::quadcopter::N_STATES;
use pilotage_models::{Pilot, Quadcopter};
use pilotage_sqp::Status;
use std::ops::ControlFlow;

/// Positions over 15 s, from rest to a target of 10 m.
fn flown(theta: &[f64]) -> Vec<f64> {
    let n = 301_u16;
    let trial = Trial {
        name: "10m".into(),
        origin: String::new(),
        sha256: String::new(),
        time_unit: "s".into(),
        note: None,
        time: (0..n).map(|k| f64::from(k) * 0.05).collect(),
        target: vec![10.0; n.into()],
        position: vec![0.0; n.into()],
        stick: None,
        weight: 1.0,
    };
    let options = FlightOptions {
        order: theta.len() / 2,
        theta: Some(theta.to_vec()),
        ..FlightOptions::default()
    };
    posed(&[trial], &options, |posed| {
        evaluate(posed).runs[0].predicted[0].clone()
    })
}

/// docs/method.md: the printed θ brings the vehicle to about 5 m for a 10 m target.
#[test]
fn the_published_parameters_never_reach_the_target() {
    let positions = flown(&PAPER_THETA);
    let greatest = positions.iter().copied().fold(0.0, f64::max);
    let last = positions[300];
    assert!(
        greatest < 8.0 && (4.0..6.0).contains(&last),
        "{greatest}, {last}"
    );
}

/// Pilot and vehicle as they are exported, by the Runge–Kutta method with steps of 1 ms, as a simple reference.
#[test]
fn the_equations_are_those_of_pilot_and_vehicle() {
    let theta = [216.0, 108.0, 18.0, -6.48, -16.2, -0.5];
    let (vehicle, pilot) = (Quadcopter::default(), Pilot { order: 3 });
    let slope = |x: &[f64]| {
        let mut dx = vec![0.0; x.len()];
        let (of_vehicle, of_pilot) = x.split_at(N_STATES);
        let (vehicle_slope, pilot_slope) = dx.split_at_mut(N_STATES);
        vehicle.derivative(of_vehicle, pilot.output(of_pilot, &theta), vehicle_slope);
        pilot.derivative(
            of_pilot,
            10.0 - vehicle.output(of_vehicle),
            &theta,
            pilot_slope,
        );
        dx
    };
    let along = |x: &[f64], dx: &[f64], h: f64| -> Vec<f64> {
        x.iter().zip(dx).map(|(x, dx)| x + h * dx).collect()
    };
    let mut x = vec![0.0; N_STATES + 3];
    for _ in 0..15_000 {
        let k1 = slope(&x);
        let k2 = slope(&along(&x, &k1, 5e-4));
        let k3 = slope(&along(&x, &k2, 5e-4));
        let k4 = slope(&along(&x, &k3, 1e-3));
        (0..x.len()).for_each(|i| x[i] += 1e-3 / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
    }
    let last = flown(&theta)[300];
    assert!((last - x[0]).abs() < 1e-5, "{last} {}", x[0]);
}

/// A pilot with an additional pole at -1e6 1/s behaves like the pilot without it.
#[test]
fn a_pole_that_ran_away_is_no_trouble() {
    let slow = [1.426, 1.771, -0.0003, -0.0713];
    let fast = 1e6;
    // The slow pilot times fast/(s + fast).
    let theta = [
        fast * slow[0],
        fast * slow[1] + slow[0],
        fast + slow[1],
        fast * slow[2],
        fast * slow[3],
        0.0,
    ];
    let (with, without) = (flown(&theta), flown(&slow));
    let difference = with.iter().zip(&without).map(|(a, b)| (a - b).abs());
    assert!(difference.fold(0.0, f64::max) < 1e-3);
}

/// A stick fit is linear: from flights of a known pilot whose states at the start are sought too, both are found, with zero
/// residual.
#[test]
fn a_stick_fit_finds_a_linear_pilot_and_its_states() {
    let (pilot, truth, begin) = (Pilot { order: 2 }, [2.0, 3.0, -0.4, -0.9], [0.7, -0.3]);
    let trial = |name: &str, target: f64| {
        let time: Vec<f64> = (0..200).map(|k| 0.05 * f64::from(k)).collect();
        // A straight line between samples, as the fit has its inputs.
        let error = |t: f64| target * (0.7 * t).cos();
        let derivative =
            |x: &[f64], u: &[f64], dx: &mut [f64]| pilot.derivative(x, u[0], &truth, dx);
        let step = Transition::new([2, 1], 0.05, derivative).unwrap();
        let mut x = begin.to_vec();
        let mut stick = Vec::new();
        for t in &time {
            stick.push(pilot.output(&x, &truth));
            let (u, next) = (error(*t), error(t + 0.05));
            let mut after = vec![0.0; 2];
            step.apply(&x, &[u], &[(next - u) / 0.05], &mut after);
            x = after;
        }
        Trial {
            name: name.into(),
            origin: name.into(),
            sha256: String::new(),
            time_unit: "s".into(),
            note: None,
            target: time.iter().map(|t| error(*t)).collect(),
            position: vec![0.0; time.len()],
            time,
            stick: Some(stick),
            weight: 1.0,
        }
    };
    let mut options = FlightOptions {
        order: 2,
        theta: Some(vec![5.0, 4.0, -1.0, 0.5]),
        initial_state: InitialState::Free,
        objective: Objective::Stick,
        stick_limit: 10.0,
        ..FlightOptions::default()
    };
    // The scheme's error is below what is asked for.
    options.fit.scheme = Some(pilotage_collocation::Scheme::Gauss(3));
    posed(&[trial("a", 1.0), trial("b", -2.0)], &options, |posed| {
        let found = fit(posed, &mut |_| ControlFlow::Continue(()));
        assert_eq!(found.status, Status::Converged);
        for (k, expected) in truth.into_iter().enumerate() {
            let found = found.value(&format!("pilot.theta{}", k + 1)).unwrap();
            assert!((found - expected).abs() < 1e-5, "theta{}: {found}", k + 1);
        }
        for run in &found.runs {
            // The stick, and what is behind it, in the observable form: b x, and b ẋ + a₂ b x - b₂ e.
            for (states, expected) in run.states.iter().zip([-0.01, 0.54]) {
                assert!((states[0] - expected).abs() < 1e-4, "{}", states[0]);
            }
        }
    });
}
