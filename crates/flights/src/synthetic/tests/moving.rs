//! Tests of moving targets and of vehicles from model files.

use super::super::*;
use nalgebra::Complex;
use pilotage_models::{TextModel, library};
use std::f64::consts::{FRAC_PI_4, PI, TAU};

fn library_vehicle(name: &str) -> ModelVehicle {
    model_vehicle(library::find(name).unwrap().text)
}

fn model_vehicle(text: &str) -> ModelVehicle {
    ModelVehicle::new(TextModel::parse(text, "vehicle.toml").unwrap(), &[]).unwrap()
}

fn moving(shape: Shape) -> Flights {
    let moving = Moving {
        shape,
        count: 6,
        amplitude: 2.0,
        bandwidth: 1.0,
    };
    Flights {
        moving: Some(moving),
        runs: 2,
        duration: 40.0,
        ..Flights::default()
    }
}

fn values<'a>(flight: &'a Flight, name: &str) -> &'a [f64] {
    &flight.series.column(name).unwrap().values
}

/// Amplitudes of the sines at integer multiples of one period per record, up to half the sampling rate.
fn spectrum(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let line = |k: usize| {
        let turn = |i: usize| Complex::from_polar(1.0, -TAU * ((k * i) % n) as f64 / n as f64);
        let sum: Complex<f64> = values.iter().enumerate().map(|(i, v)| turn(i) * *v).sum();
        2.0 * sum.norm() / n as f64
    };
    (0..n / 2).map(line).collect()
}

/// Lines of a spectrum above the rounding to 0.1 mm.
fn lines(spectrum: &[f64]) -> Vec<usize> {
    (0..spectrum.len())
        .filter(|k| spectrum[*k] > 1e-4)
        .collect()
}

#[test]
fn sines_have_lines_at_prime_multiples_alone_with_falling_amplitudes() {
    let hover = library_vehicle("hover");
    let human = Human::default()
        .suited(&hover, 0, Given::default())
        .unwrap();
    let flights = moving(Shape::Sines).fly(&human, &hover).unwrap();
    let of = |flight: &Flight, name| spectrum(&values(flight, name)[..800]);
    let first = of(&flights[0], "target");
    let both = [lines(&first), lines(&of(&flights[0], "target2"))];
    assert!(both.iter().all(|axis| axis.len() == 6), "{both:?}");
    let all = both.concat();
    for (k, line) in all.iter().enumerate() {
        let gcd = |other: &usize| {
            let (mut a, mut b) = (*line, *other);
            while b > 0 {
                (a, b) = (b, a % b);
            }
            a
        };
        assert!(all[k + 1..].iter().all(|other| gcd(other) == 1), "{all:?}");
    }
    for line in &both[0] {
        let frequency = TAU * *line as f64 / 40.0;
        let expected = if frequency > 1.0 {
            2.0 / frequency.powi(2)
        } else {
            2.0
        };
        assert!(
            (first[*line] - expected).abs() < 1e-4,
            "{line}: {} {expected}",
            first[*line]
        );
    }
    assert_eq!(values(&flights[0], "target")[0], 0.0);
    // The next run has the same lines with other phases.
    assert_eq!(lines(&of(&flights[1], "target")), both[0]);
    assert_ne!(values(&flights[0], "target"), values(&flights[1], "target"));
}

#[test]
fn steps_are_of_one_size_and_ramps_straight() {
    let vehicle = library_vehicle("integrator");
    let human = Human::default()
        .suited(&vehicle, 0, Given::default())
        .unwrap();
    for flight in moving(Shape::Steps).fly(&human, &vehicle).unwrap() {
        let target = values(&flight, "target");
        let jumps = target.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let jumps: Vec<f64> = jumps
            .chain([target[0].abs()])
            .filter(|jump| *jump > 0.0)
            .collect();
        assert_eq!(jumps, [2.0; 6]);
        assert!(target.iter().all(|place| place.abs() <= 4.0));
    }
    for flight in moving(Shape::Ramps).fly(&human, &vehicle).unwrap() {
        let target = values(&flight, "target");
        let bends = target
            .windows(3)
            .filter(|three| (three[0] - 2.0 * three[1] + three[2]).abs() > 3e-4);
        assert_eq!((target[0], bends.count()), (0.0, 6));
        assert!(target.iter().all(|place| place.abs() <= 2.0));
    }
}

#[test]
fn the_target_does_not_depend_on_who_flies() {
    let vehicle = library_vehicle("integrator");
    let flown = |gain, variation| {
        let human = Human {
            gain,
            lead: 0.0,
            ..Human::default()
        };
        let flights = Flights {
            variation,
            ..moving(Shape::Sines)
        };
        flights.fly(&human, &vehicle).unwrap().remove(0)
    };
    let (one, other) = (flown(0.2, 0.05), flown(0.1, 0.0));
    assert_eq!(values(&one, "target"), values(&other, "target"));
    assert_ne!(values(&one, "position"), values(&other, "position"));
}

/// The loop of K/s in closed form: `k K / (jω) e^{-jωτ} ω_n² / (ω_n² - ω² + 2jζω_n ω)`.
#[test]
fn a_vehicle_like_k_over_s_is_flown_with_a_crossover_of_two_and_a_half() {
    let human = Human::default();
    let suited = human
        .suited(&library_vehicle("integrator"), 0, Given::default())
        .unwrap();
    assert_eq!((suited.lead < 0.1, suited.lag), (true, 0.0), "{suited:?}");
    let (w, wn) = (2.5, human.frequency);
    let arm = Complex::new(wn * wn - w * w, 2.0 * human.damping * wn * w);
    let lead = Complex::new(1.0, w * suited.lead);
    let open =
        lead * Complex::from_polar(1.0, -w * human.delay) / Complex::new(0.0, w) * wn * wn / arm;
    let open = open * 10.0 * suited.gain;
    assert!((open.norm() - 1.0).abs() < 5e-3, "{open}");
    assert!(PI + open.arg() > FRAC_PI_4 - 5e-3, "{open}");
}

/// With a suited human every vehicle reaches its target and stays there.
#[test]
fn every_vehicle_of_the_library_is_flown() {
    let vehicles = library::all()
        .iter()
        .filter(|model| model.kind == library::Kind::Vehicle);
    for built_in in vehicles.filter(|model| model.name != "quadcopter") {
        let vehicle = library_vehicle(built_in.name);
        let human = Human::default()
            .suited(&vehicle, 0, Given::default())
            .unwrap_or_else(|error| panic!("{}: {error:?}", built_in.name));
        let flights = Flights {
            targets: vec![0.5],
            runs: 1,
            duration: 60.0,
            ..Flights::default()
        };
        let flight = flights.fly(&human, &vehicle).unwrap().remove(0);
        let late = &values(&flight, "position")[600..];
        let farthest = late.iter().map(|p| (p - 0.5).abs()).fold(0.0, f64::max);
        assert!(farthest < 0.25, "{}: {human:?} {farthest}", built_in.name);
    }
}

/// Two identical axes with the same target: cross-coupling is equivalent to a higher gain.
#[test]
fn what_leaks_between_like_axes_is_as_good_as_gain() {
    let both = model_vehicle(
        r#"
        [model]
        name = "both"
        [inputs]
        stick = {}
        stick2 = {}
        [states]
        position = { der = "10 * stick" }
        position2 = { der = "10 * stick2" }
        [outputs]
        position = {}
        position2 = {}
        "#,
    );
    let one = library_vehicle("integrator");
    let human = |gain| Human {
        gain,
        lead: 0.1,
        remnant: 0.0,
        ..Human::default()
    };
    let flights = Flights {
        targets: vec![2.0],
        runs: 1,
        variation: 0.0,
        ..Flights::default()
    };
    let hands = Hands {
        axes: vec![human(0.1); 2],
        coupling: 0.3,
    };
    let coupled = flights.fly_hands(&hands, &both).unwrap().remove(0);
    let alone = flights.fly(&human(0.13), &one).unwrap().remove(0);
    for (name, other) in [
        ("position", "position"),
        ("position2", "position"),
        ("stick2", "stick"),
    ] {
        let pairs = values(&coupled, name).iter().zip(values(&alone, other));
        let farthest = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // One unit of the recording's last digit.
        assert!(farthest < 1.1e-4, "{name}: {farthest}");
    }
}

#[test]
fn a_hand_with_a_greatest_speed_moves_no_faster_and_at_that_speed() {
    let vehicle = library_vehicle("integrator");
    let human = Human {
        stick_rate: 2.0,
        ..Human::default()
    };
    let human = human.suited(&vehicle, 0, Given::default()).unwrap();
    let flight = moving(Shape::Steps)
        .fly(&human, &vehicle)
        .unwrap()
        .remove(0);
    let speeds = values(&flight, "stick")
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs() * 20.0);
    let fastest = speeds.fold(0.0, f64::max);
    assert!((fastest - 2.0).abs() < 5e-3, "{fastest}");
}

#[test]
fn models_that_cannot_be_flown_are_refused() {
    let message = |text: &str, measured: &[String]| {
        let model = TextModel::parse(text, "vehicle.toml").unwrap();
        ModelVehicle::new(model, measured).unwrap_err().to_string()
    };
    let crossover = library::find("crossover").unwrap().text;
    assert_eq!(
        message(crossover, &[]),
        "`crossover` has no input `stick`, by which a vehicle is flown"
    );
    let quadcopter = library::find("quadcopter").unwrap().text;
    assert_eq!(
        message(quadcopter, &[]),
        "`quadcopter` has no output `position`; its outputs are z, phi, v, q, omega_f, omega_b"
    );
    let names = ["position".to_owned()];
    assert!(
        message(library::find("hover").unwrap().text, &names)
            .contains("2 stick(s), and 1 position(s)")
    );
    // No human stabilises three integrators with so little lead.
    let far = "[model]\nname = \"far\"\n[inputs]\nstick = {}\n[states]\nposition = { der = \"v\" }\n\
               v = { der = \"a\" }\na = { der = \"stick\" }\n[outputs]\nposition = {}\n";
    let error = Human::default().suited(&model_vehicle(far), 0, Given::default());
    assert!(
        matches!(error, Err(SyntheticError::Unsuited { axis: 1 })),
        "{error:?}"
    );
}

#[test]
fn the_step_of_the_quadcopters_model_file_is_that_of_the_compiled_one() {
    let text = library::find("quadcopter").unwrap().text;
    let model = TextModel::parse(text, "quadcopter.toml").unwrap();
    let model = ModelVehicle::new(model, &["z".to_owned()]).unwrap();
    let flights = Flights {
        targets: vec![10.0],
        runs: 1,
        ..Flights::default()
    };
    let of_file = flights.fly(&Human::default(), &model).unwrap().remove(0);
    let compiled = pilotage_models::Quadcopter::default();
    let compiled = flights.fly(&Human::default(), &compiled).unwrap().remove(0);
    let pairs = values(&of_file, "position")
        .iter()
        .zip(values(&compiled, "position"));
    let farthest = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(farthest < 1.1e-4, "{farthest}");
    let names: Vec<&str> = of_file
        .series
        .columns
        .iter()
        .map(|column| column.name.as_str())
        .collect();
    assert_eq!(
        names,
        [
            "target", "position", "stick", "phi", "v", "q", "omega_f", "omega_b"
        ]
    );
}

/// K/s with a delay alone is stable below `K k τ = π/2`; the arm's lag has nearly the effect of a delay.
#[test]
fn loops_are_held_up_to_the_gain_of_the_stability_limit() {
    let vehicle = library_vehicle("integrator");
    // Gain 10/s; an arm of 1e-2 s after a delay of 0.5 s: at the phase crossover w, w τ + atan(...) = π/2.
    let human = |gain| Human {
        gain,
        lead: 0.0,
        delay: 0.5,
        frequency: 100.0,
        damping: 1.0,
        ..Human::default()
    };
    let phase = |w: f64| 0.5 * w + 2.0 * (w / 100.0).atan() - std::f64::consts::FRAC_PI_2;
    let (mut low, mut high) = (1.0, 4.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if phase(middle) < 0.0 {
            low = middle
        } else {
            high = middle
        }
    }
    let limit = low * (1.0 + (low / 100.0).powi(2)) / 10.0;
    let is_held = |gain| {
        let hands = Hands {
            axes: vec![human(gain)],
            coupling: 0.0,
        };
        vehicle.is_held_by(&hands)
    };
    assert!(is_held(0.99 * limit) && !is_held(1.01 * limit), "{limit}");
    let flights = Flights {
        targets: vec![2.0],
        runs: 1,
        ..Flights::default()
    };
    let error = flights.fly(&human(1.1 * limit), &vehicle);
    assert!(matches!(error, Err(SyntheticError::Unstable)), "{error:?}");
}
