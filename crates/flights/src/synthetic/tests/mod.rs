//! Tests of the synthetic human.

mod moving;

use super::*;
use pilotage_models::Quadcopter;

/// Maximum and last value of a column.
fn peak_and_last(values: &[f64]) -> (f64, f64) {
    let peak = values.iter().copied().fold(f64::MIN, f64::max);
    (peak, values[values.len() - 1])
}

#[test]
fn the_default_flights_are_credible() {
    for flight in Flights::default()
        .fly(&Human::default(), &Quadcopter::default())
        .unwrap()
    {
        let values = |name| &flight.series.column(name).unwrap().values;
        let target = values("target")[0];
        let (peak, last) = peak_and_last(values("position"));
        assert!(
            (1.1..1.3).contains(&(peak / target)),
            "{}: {peak}",
            flight.name
        );
        assert!(
            (last / target - 1.0).abs() < 0.04,
            "{}: {last}",
            flight.name
        );
        let stick = values("stick")
            .iter()
            .fold(0.0, |peak: f64, s| peak.max(s.abs()));
        assert!(
            (0.02..0.035).contains(&(stick / target)),
            "{}: {stick}",
            flight.name
        );
        assert_eq!(flight.series.time.len(), 301);
    }
}

#[test]
fn a_run_does_not_depend_on_the_runs_after_it_and_differs_from_its_neighbours() {
    let all = Flights::default()
        .fly(&Human::default(), &Quadcopter::default())
        .unwrap();
    let one = Flights {
        targets: vec![10.0],
        runs: 1,
        ..Flights::default()
    };
    let alone = one.fly(&Human::default(), &Quadcopter::default()).unwrap();
    assert_eq!(alone[0], all[0]);
    assert_ne!(all[0].series, all[1].series);
}

#[test]
fn without_remnant_and_variation_the_step_size_does_not_matter() {
    let human = Human {
        remnant: 0.0,
        ..Human::default()
    };
    let at_rate = |rate| {
        let flights = Flights {
            targets: vec![10.0],
            runs: 1,
            rate,
            variation: 0.0,
            ..Flights::default()
        };
        let series = flights
            .fly(&human, &Quadcopter::default())
            .unwrap()
            .remove(0)
            .series;
        series.column("position").unwrap().values.clone()
    };
    // 1000 and 3000 integration steps per second, compared once per second. The target is first perceived somewhere
    // within a step, so the positions differ by at most half a coarse step.
    let (coarse, fine) = (at_rate(1000.0), at_rate(3000.0));
    for second in 0..=15 {
        let difference = coarse[1000 * second] - fine[3000 * second];
        assert!(difference.abs() < 2e-3, "{second} s: {difference}");
    }
}

#[test]
fn what_cannot_be_flown_is_refused() {
    let unstable = Quadcopter {
        attitude_gain: 76.37,
        rate_gain: 1.02,
        ..Quadcopter::default()
    };
    let error = Flights::default().fly(&Human::default(), &unstable).err();
    assert!(
        matches!(error, Some(SyntheticError::Diverged { .. })),
        "{error:?}"
    );
    let wild = Human {
        gain: f64::NAN,
        ..Human::default()
    };
    let error = Flights::default().fly(&wild, &Quadcopter::default()).err();
    assert_eq!(
        error.map(|error| error.to_string()).as_deref(),
        Some("gain = NaN is out of range; expected 0.000001 to 1000000")
    );
}

#[test]
fn the_stick_ends_at_its_stops() {
    let flights = Flights {
        targets: vec![60.0],
        runs: 1,
        ..Flights::default()
    };
    let flight = flights
        .fly(&Human::default(), &Quadcopter::default())
        .unwrap()
        .remove(0);
    let stick = &flight.series.column("stick").unwrap().values;
    assert!(stick.contains(&-1.0) && stick.iter().all(|s| s.abs() <= 1.0));
}
