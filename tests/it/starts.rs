//! The default start against random ones, on a few data sets of the study `benches/starts`.

#[allow(dead_code)]
#[path = "../../benches/starts/pilots.rs"]
mod pilots;

use crate::fitted::{fitted, with};
use pilotage::collocation::Scheme;
use pilotage::flights::options::InitialState;
use pilotage::flights::{FlightOptions, Trial};
use pilotage::models::Quadcopter;
use pilotage::synthetic::{Flight, Flights, Human};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Uniform};

fn flights(name: &str, seed: u64) -> Vec<Trial> {
    let (_, human) = pilots::STUDY.iter().find(|(n, _)| *n == name).unwrap();
    pilots::flights(human, seed).unwrap()
}

/// The least objective of fits from starts around these θ, which know nothing of the data.
fn best_of_random(trials: &[Trial], seed: u64, count: usize) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let unit = Uniform::new(0.0, 1.0).unwrap();
    let mut between = |low: f64, high: f64| low * (high / low).powf(unit.sample(&mut random));
    let fits = (0..count).map(|_| {
        // A pair of lags and a real one, a gain, and two leads.
        let (w, a) = (between(0.5, 20.0), between(0.5, 20.0));
        let (gain, lead) = (between(0.01, 0.1), between(0.5, 5.0));
        let denominator = [w * w * a, w * w + 1.4 * w * a, a + 1.4 * w];
        let scale = -gain * denominator[0];
        let theta = [&denominator[..], &[scale, scale * lead, 0.1 * scale * lead]].concat();
        fitted(
            trials,
            &with(|own| {
                own.theta = Some(theta);
                own.fit.starts = Some(1);
            }),
        )
    });
    let converged = fits.filter(|fit| fit.status.as_str() == "converged");
    converged
        .map(|fit| fit.objective)
        .fold(f64::INFINITY, f64::min)
}

/// On the first, a pilot that integrates is an optimum 0.25 % above the best; on the second most starts
/// end where a pole runs away; on the third most end 0.13 % above the best, where one pole runs away so fast
/// that a solve may be cut short with its states far apart.
#[test]
fn the_default_start_is_as_good_as_the_best_of_random_ones() {
    for (name, seed, count) in [("plain", 1, 4), ("eager", 1, 4), ("eager", 6, 8)] {
        let trials = flights(name, seed);
        let fit = fitted(&trials, &FlightOptions::default());
        assert_eq!(fit.status.as_str(), "converged");
        let best = best_of_random(&trials, seed, count);
        assert!(best.is_finite(), "{name} {seed}: no random start converged");
        assert!(
            fit.objective <= best * 1.001,
            "{name} {seed}: {} {best}",
            fit.objective
        );
    }
}

/// With free initial states each run tumbles on its own, and there are as many optima as there are combinations. The best one that
/// is known, of many random starts and of tumbles that were cut for this vehicle, is 27.247340.
#[test]
fn free_runs_come_near_the_best_that_is_known() {
    let trials = flights("noisy", 3);
    let fit = fitted(&trials, &with(|own| own.initial_state = InitialState::Free));
    assert_eq!(fit.status.as_str(), "converged");
    assert!(fit.objective <= 1.15 * 27.247340, "{}", fit.objective);
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
        let options = with(|own| {
            own.fit.scheme = Some(Scheme::Euler);
            own.fit.starts = Some(1);
            own.theta = Some(start.to_vec());
        });
        let fit = fitted(&trials, &options);
        assert_eq!(fit.status.as_str(), "converged");
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
    let fit = fitted(&trials, &FlightOptions::default());
    assert_eq!(fit.status.as_str(), "converged");
    assert_eq!(fit.runs.len(), 30);
    let best = best_of_random(&trials, 1, 2);
    assert!(best.is_finite(), "no random start converged");
    assert!(fit.objective <= best * 1.001, "{} {best}", fit.objective);
}

#[test]
fn a_pilot_of_higher_order_never_fits_worse() {
    let trials = flights("precise", 2);
    let mut before = f64::INFINITY;
    // A first-order pilot has no lead: it cannot fly this vehicle.
    for order in 2..=3 {
        let fit = fitted(&trials, &with(|own| own.order = order));
        assert_eq!(fit.status.as_str(), "converged");
        assert!(
            fit.objective <= before * (1.0 + 1e-6),
            "order {order}: {} {before}",
            fit.objective
        );
        before = fit.objective;
    }
}
