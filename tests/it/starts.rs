//! The default start against random ones, on a few data sets of the study `benches/starts`.

#[allow(dead_code)]
#[path = "../../benches/starts/pilots.rs"]
mod pilots;

use pilotage::collocation::Scheme;
use pilotage::identification::solve::SPARE_STARTS;
use pilotage::identification::{Fit, FitOptions, InitialState, Trial, fit, random_starts, start};
use pilotage::models::{Pilot, Quadcopter};
use pilotage::synthetic::{Flight, Flights, Human};
use std::ops::ControlFlow;

fn flights(name: &str, seed: u64) -> Vec<Trial> {
    let (_, human) = pilots::STUDY.iter().find(|(n, _)| *n == name).unwrap();
    pilots::flights(human, seed).unwrap()
}

fn fitted(trials: &[Trial], options: &FitOptions) -> Fit {
    fit(trials, options, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// The least objective of converged fits from random starts, others than those that the fit itself draws.
fn best_of_random(trials: &[Trial], seed: u64, count: usize) -> f64 {
    let from = |start| {
        let options = FitOptions {
            start: Some(start),
            ..FitOptions::default()
        };
        fitted(trials, &options)
    };
    let fits = random_starts::draw(&FitOptions::default(), seed, count)
        .into_iter()
        .map(from);
    let converged = fits.filter(|fit| fit.converged).map(|fit| fit.objective);
    converged.fold(f64::INFINITY, f64::min)
}

/// On the first, a pilot that integrates is an optimum 0.25 % above the best; on the second most starts
/// end where a pole runs away; on the third most end 0.13 % above the best, where one pole runs away so fast
/// that a solve may be cut short with its states far apart.
#[test]
fn the_default_start_is_as_good_as_the_best_of_random_ones() {
    for (name, seed, count) in [("plain", 1, 4), ("eager", 1, 4), ("eager", 6, 8)] {
        let trials = flights(name, seed);
        let fit = fitted(&trials, &FitOptions::default());
        assert!(fit.converged, "{name} {seed}: {}", fit.status);
        let best = best_of_random(&trials, seed, count);
        assert!(best.is_finite(), "{name} {seed}: no random start converged");
        assert!(
            fit.objective <= best * 1.001,
            "{name} {seed}: {} {best}",
            fit.objective
        );
    }
}

/// With free initial states each run tumbles on its own. The figure is the best known before the runs were
/// looked at one by one: of the bench's random starts, of which the default fit fell 1.8 % short.
#[test]
fn free_runs_find_better_tumbles_than_any_start_of_all() {
    let best = 27.247340;
    let trials = flights("noisy", 3);
    let options = FitOptions {
        initial_state: InitialState::Free,
        ..FitOptions::default()
    };
    let fit = fitted(&trials, &options);
    assert!(fit.converged, "{}", fit.status);
    assert!(fit.is_feasible(), "{}", fit.violation);
    assert!(fit.objective <= best, "{} {best}", fit.objective);
    let first = &fit.starts[0];
    assert_eq!(first.number, fit.starts.len(), "the start that came last");
    assert_eq!(fit.agreeing(), 1, "it is alone, which the fit says");
}

/// Beyond a pole of -2/h forward Euler is unstable, here by the power of 300 samples: there the elimination
/// of the states has no digit left. IPOPT finds 286.7807567, 479.5437779 and 129.8378660, with the pole on
/// either side of -40 1/s.
#[test]
fn a_pole_that_runs_to_the_edge_of_eulers_stability_stays_at_it() {
    let human = |gain, lead, delay, frequency| Human {
        gain,
        lead,
        delay,
        frequency,
        ..Human::default()
    };
    let cases = [
        (
            (human(0.03, 2.5, 0.15, 10.0), 1),
            [13.536, 18.364, 10.741, -0.0032725, -0.67406, -0.07624],
            286.7807567,
        ),
        (
            (human(0.04, 2.0, 0.10, 14.0), 3),
            [24.766, 32.202, 13.119, -0.014896, -1.5705, -0.15382],
            479.5437779,
        ),
        (
            (human(0.035, 3.2, 0.18, 12.0), 5),
            [2.8865, 4.0758, 2.8556, -0.00064799, -0.11694, -0.082214],
            129.8378660,
        ),
    ];
    for ((human, seed), start, optimum) in cases {
        let trials = pilots::flights(&human, seed).unwrap();
        let options = FitOptions {
            scheme: Scheme::Euler,
            start: Some(start.to_vec()),
            ..FitOptions::default()
        };
        let fit = fitted(&trials, &options);
        assert!(fit.converged, "{seed}: {}", fit.status);
        assert!(
            fit.objective <= optimum * (1.0 + 1e-6),
            "{seed}: {} {optimum}",
            fit.objective
        );
    }
}

/// More trials than the fits that only give starts take: every start sees all of them in the end.
#[test]
fn of_many_trials_all_count() {
    let flights = Flights {
        runs: 15,
        duration: 10.0,
        ..Flights::default()
    };
    let flown = flights.fly(&Human::default(), &Quadcopter::default());
    let trial = |flight: &Flight| {
        let csv = flight.series.to_csv();
        Trial::parse(csv.as_bytes(), &flight.name).unwrap()
    };
    let trials: Vec<Trial> = flown.unwrap().iter().map(trial).collect();
    let fit = fitted(&trials, &FitOptions::default());
    assert!(fit.converged, "{}", fit.status);
    assert_eq!(fit.runs.len(), 30);
    let best = best_of_random(&trials, 1, 2);
    assert!(best.is_finite(), "no random start converged");
    assert!(fit.objective <= best * 1.001, "{} {best}", fit.objective);
    assert_eq!(
        fit.starts.len(),
        3,
        "a pair at each of its places, with all of the trials"
    );
}

/// Among the starts from the data one alone ends at the best, so that random ones join until another does.
#[test]
fn random_starts_join_where_one_start_is_alone() {
    let trials = flights("eager", 8);
    let with = |count| {
        let options = FitOptions {
            random_starts: count,
            ..FitOptions::default()
        };
        fitted(&trials, &options)
    };
    let without = with(Some(0));
    assert_eq!((without.starts.len(), without.agreeing()), (3, 1));
    let joined = with(None);
    assert!(joined.starts.len() > 3 && joined.starts.len() <= 3 + SPARE_STARTS);
    assert_eq!(joined.agreeing(), 2);
    let asked = with(Some(2));
    assert_eq!(asked.starts.len(), 5);
    for fit in [&joined, &asked] {
        assert!(fit.converged, "{}", fit.status);
        assert!(fit.objective <= without.objective * (1.0 + 1e-6));
    }
}

#[test]
fn a_pilot_of_higher_order_never_fits_worse() {
    let trials = flights("precise", 2);
    let mut before = f64::INFINITY;
    // A first-order pilot has no lead: it cannot fly this vehicle.
    for order in 2..=3 {
        let options = FitOptions {
            pilot: Pilot { order },
            ..FitOptions::default()
        };
        let fit = fitted(&trials, &options);
        assert!(fit.converged, "order {order}: {}", fit.status);
        assert!(
            fit.objective <= before * (1.0 + 1e-6),
            "order {order}: {} {before}",
            fit.objective
        );
        before = fit.objective;
    }
}

#[test]
fn a_pair_leaves_the_transfer_function_as_it_is() {
    let trials = flights("plain", 1);
    let options = FitOptions::default();
    let sticks: Vec<Vec<f64>> = trials.iter().filter_map(|t| t.stick.clone()).collect();
    let theta = [1.1, 1.8, -2e-4, -0.06];
    // At s = 0.7 1/s; ascending coefficients, the denominator without its leading one.
    let value = |theta: &[f64]| {
        let (den, num) = theta.split_at(theta.len() / 2);
        let at = |c: &[f64]| c.iter().rev().fold(0.0, |sum, c| sum * 0.7 + c);
        at(num) / at(&[den, &[1.0]].concat())
    };
    let raised = start::with_pair(&theta, &trials, &sticks, &options);
    assert!(raised.len() > 1);
    for raised in raised {
        assert_eq!(raised.len(), 6);
        assert!(
            (value(&raised) / value(&theta) - 1.0).abs() < 1e-12,
            "{raised:?}"
        );
    }
}
