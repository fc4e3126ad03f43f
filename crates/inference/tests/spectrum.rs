//! Responses of a loop whose truth is known: first-order pilot on an integrator, sampled, with remnant inside the loop.

use nalgebra::Complex;
use pilotage_inference::spectrum::{Excitation, Flight, Point, Record, Unfit, Window, response};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

const STEP: f64 = 0.05;
const SAMPLES: usize = 1201;
const LINES: [usize; 8] = [3, 5, 7, 13, 23, 37, 61, 97];
/// `x' = POLE x + e`, `u = GAIN x`, `z' = z + STEP u`, a sample each.
const POLE: f64 = 0.8;
const GAIN: f64 = 0.3;

struct Run {
    time: Vec<f64>,
    forcing: Vec<f64>,
    error: Vec<f64>,
    stick: Vec<f64>,
    position: Vec<f64>,
}

fn run(random: &mut ChaCha8Rng, remnant: f64, change: f64) -> Run {
    let mut normal = || -> f64 { StandardNormal.sample(random) };
    let phases: Vec<f64> = LINES.iter().map(|_| TAU * normal()).collect();
    let forcing = |t: usize| -> f64 {
        let sines = LINES.iter().zip(&phases);
        sines
            .map(|(k, phase)| (TAU * (k * t) as f64 / 1200.0 + phase).sin())
            .sum()
    };
    let gain = GAIN * (1.0 + change * normal());
    let (mut x, mut z, mut noise) = (0.0, 0.0, 0.0);
    let mut found = Run {
        time: (0..SAMPLES).map(|k| k as f64 * STEP).collect(),
        forcing: (0..SAMPLES).map(forcing).collect(),
        error: Vec::new(),
        stick: Vec::new(),
        position: Vec::new(),
    };
    for t in 0..SAMPLES {
        let error = found.forcing[t] - z;
        noise = 0.7 * noise + remnant * normal();
        let stick = gain * x + noise;
        found.error.push(error);
        found.stick.push(stick);
        found.position.push(z);
        x = POLE * x + error;
        z += STEP * stick;
    }
    found
}

/// A run as it is given, with another output or forcing function.
fn record<'a>(run: &'a Run, output: &'a [f64], forcing: &'a [f64]) -> Record<'a> {
    Record {
        time: &run.time,
        forcing: vec![forcing],
        input: &run.error,
        output,
    }
}

fn of(runs: &[Run], output: fn(&Run) -> &[f64]) -> Vec<Point> {
    let record = |run| record(run, output(run), &run.forcing);
    let records: Vec<Record<'_>> = runs.iter().map(record).collect();
    let (points, unfit) = response(&records);
    assert_eq!(unfit, []);
    let lines: Vec<f64> = points.iter().map(|own| own.frequency).collect();
    for (found, k) in lines.iter().zip(LINES) {
        assert!((found - TAU * k as f64 / 60.0).abs() < 1e-9, "{found}");
    }
    assert_eq!(points.len(), LINES.len());
    points
}

fn turn(frequency: f64) -> Complex<f64> {
    Complex::from_polar(1.0, frequency * STEP)
}

fn pilot(frequency: f64) -> Complex<f64> {
    GAIN / (turn(frequency) - POLE)
}

#[test]
fn without_remnant_the_response_is_that_of_the_pilot() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let runs = [run(&mut random, 0.0, 0.0)];
    for own in of(&runs, |run| &run.stick) {
        let (truth, found) = (pilot(own.frequency), own.response);
        assert!((found / truth - 1.0).norm() < 1e-3, "{own:?} {truth}");
        assert!(own.coherence > 0.999 && own.sd < 1e-3, "{own:?}");
    }
    for own in of(&runs, |run| &run.position) {
        let truth = pilot(own.frequency) * STEP / (turn(own.frequency) - 1.0);
        assert!((own.response / truth - 1.0).norm() < 1e-2, "{own:?}");
    }
}

/// 100 sets with 8 lines each: 95 of 100 regions of 95 % hold the truth, and the deviations are those that are told.
#[test]
fn the_error_bars_hold_the_truth_as_often_as_they_say() {
    for (runs, remnant, change, range) in [
        (1, 0.3, 0.0, 0.935..0.965),
        (3, 0.3, 0.0, 0.945..0.985),
        (6, 0.1, 0.05, 0.93..0.985),
    ] {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let (mut held, mut all, mut squares) = (0, 0, 0.0);
        for _ in 0..100 {
            let own: Vec<Run> = (0..runs)
                .map(|_| run(&mut random, remnant, change))
                .collect();
            for point in of(&own, |run| &run.stick) {
                let truth = pilot(point.frequency);
                held += usize::from(point.likelihood_of(truth) > 0.05);
                squares += ((point.response / truth).arg() / point.sd).powi(2);
                all += 1;
            }
        }
        let part = held as f64 / f64::from(all);
        assert!(range.contains(&part), "{runs} runs: {part}");
        let ratio = (squares / f64::from(all)).sqrt();
        // A gain that changes scatters the phase less than the gain.
        let is_steady = change == 0.0;
        assert!(
            !is_steady || (0.85..1.25).contains(&ratio),
            "{runs} runs: {ratio}"
        );
    }
}

/// The remnant is `w / (1 - 0.7 z^-1)`, the coherence what that leaves of the stick's power in a bin.
#[test]
fn remnant_and_coherence_are_those_of_the_loop() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let runs: Vec<Run> = (0..40).map(|_| run(&mut random, 0.3, 0.0)).collect();
    for own in of(&runs, |run| &run.stick) {
        let z = turn(own.frequency);
        let noise = (0.3 / (1.0 - 0.7 / z)).norm_sqr() * STEP / std::f64::consts::PI;
        assert!((own.remnant / noise - 1.0).abs() < 0.4, "{own:?} {noise}");
        let driven = pilot(own.frequency).norm_sqr();
        let expected = driven / (driven + 2.0 * noise * TAU / 60.0);
        assert!(
            (own.coherence - expected).abs() < 0.03,
            "{own:?} {expected}"
        );
        assert!((own.amplitude - 1.0).abs() < 1e-6 && own.runs == 40);
    }
}

#[test]
fn runs_that_tell_nothing_are_left_out_with_a_reason() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let runs = [0, 1, 2].map(|_| run(&mut random, 0.1, 0.0));
    let mut gap = runs[0].stick.clone();
    gap[700] = f64::NAN;
    let still = vec![3.0; SAMPLES];
    let few = Record {
        time: &runs[0].time[..3],
        forcing: vec![&runs[0].forcing[..3]],
        input: &runs[0].error[..3],
        output: &runs[0].stick[..3],
    };
    let records: [Record<'_>; 4] = [
        few,
        record(&runs[0], &gap, &runs[0].forcing),
        record(&runs[1], &runs[1].stick, &still),
        record(&runs[2], &runs[2].stick, &runs[2].forcing),
    ];
    let (points, unfit) = response(&records);
    let expected = [(0, Unfit::Few), (1, Unfit::Missing), (2, Unfit::Still)];
    assert_eq!(unfit, expected);
    assert!(points.iter().all(|own| own.runs == 1) && points.len() == 8);
}

/// Ramps and steps between random places, as tracking tasks have them, of 30 draws each.
#[test]
fn ramps_and_steps_are_no_sums_of_sines() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let time: Vec<f64> = (0..900).map(|k| f64::from(k) * STEP).collect();
    for _ in 0..30 {
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let places: Vec<f64> = (0..7).map(|_| normal()).collect();
        let steps: Vec<f64> = (0..900).map(|k| places[k / 150]).collect();
        let ramp = |k: usize| {
            let part = (k % 150) as f64 / 150.0;
            places[k / 150] * (1.0 - part) + places[k / 150 + 1] * part
        };
        let ramps: Vec<f64> = (0..900).map(ramp).collect();
        for forcing in [&steps, &ramps] {
            assert_eq!(Window::of(&time, &[forcing]), Err(Unfit::NoLines));
        }
    }
}

/// Flights of the loop above with these targets.
fn excited(runs: &[Run], has_stick: bool) -> Excitation {
    let flights = runs.iter().map(|run| Flight {
        name: "run",
        time: &run.time,
        forcing: vec![&run.forcing],
        error: run.error.clone(),
        stick: has_stick.then_some(&run.stick[..]),
        position: &run.position,
    });
    Excitation::of(&flights.collect::<Vec<_>>()).unwrap()
}

/// `1.96 / √Σ (ω/σ)²` is the deviation of the slope of phases over frequencies, by least squares through the origin.
#[test]
fn lines_tell_how_much_can_be_found() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let runs = [0, 1, 2].map(|_| run(&mut random, 0.1, 0.0));
    let own = excited(&runs, true);
    assert!(own.has_lines && own.of_stick && !own.is_still);
    assert_eq!(own.most_parameters(), Some(16));
    assert!((own.highest().unwrap() - TAU * 97.0 / 60.0).abs() < 1e-9);
    let points = of(&runs, |run| &run.stick);
    let (top, sd) = (points[7].frequency, points[7].sd);
    let least = own.least_delay().unwrap();
    assert!(
        least < 1.96 * sd / top && least > 1.96 * sd / top / 8.0,
        "{least}"
    );
    assert_eq!(own.starved(16, 1), None);
    assert_eq!(own.starved(17, 1).map(|own| own.determined), Some(16));
    assert!(own.advice().is_none());
    // A hand that does what it likes.
    let noisy = [0, 1, 2].map(|_| run(&mut random, 30.0, 0.0));
    let noisy = excited(&noisy, true);
    assert!(noisy.most_parameters().unwrap() < 8, "{noisy}");
}

/// A hand that never sees the target is not coherent with it: at most one claim in twenty, whether of one flight or more,
/// lines or octaves.
#[test]
fn chance_is_not_taken_for_coherence() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for flights in [1, 2, 3, 5] {
        for has_lines in [true, false] {
            let mut claims = 0;
            for _ in 0..24 {
                let blind = (0..flights).map(|_| {
                    let mut own = run(&mut random, 1.0, 0.0);
                    let other = run(&mut random, 1.0, 0.0);
                    if !has_lines {
                        let normal = |_: &f64| -> f64 { StandardNormal.sample(&mut random) };
                        own.forcing = own.forcing.iter().map(normal).collect();
                    }
                    let noise = |_: &f64| -> f64 { StandardNormal.sample(&mut random) };
                    own.stick = other.stick.iter().map(noise).collect();
                    own
                });
                let blind: Vec<Run> = blind.collect();
                let own = excited(&blind, true);
                assert_eq!(own.has_lines, has_lines);
                claims += usize::from(own.highest().is_some());
            }
            assert!(
                claims <= 4,
                "{claims} of 24, {flights} flights, lines: {has_lines}"
            );
        }
    }
}

/// Jumps to a target that stays: without remnant all comes back the same, with much of it little does.
#[test]
fn bands_of_jumps_are_coherent_as_far_as_flights_are_alike() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let mut jump = |remnant: f64, samples: usize| {
        let mut own = run(&mut random, remnant, 0.0);
        // The loop is linear: what a jump adds to it is a flight of its own.
        own.time.truncate(samples);
        own.forcing = vec![5.0; own.time.len()];
        let (mut x, mut z, mut noise) = (0.0, 0.0, 0.0);
        (own.error, own.stick, own.position) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..samples {
            let error = 5.0 - z;
            let normal: f64 = StandardNormal.sample(&mut random);
            noise = 0.7 * noise + remnant * normal;
            let stick = GAIN * x + noise;
            own.error.push(error);
            own.stick.push(stick);
            own.position.push(z);
            x = POLE * x + error;
            z += STEP * stick;
        }
        own
    };
    let clean: Vec<Run> = (0..3).map(|_| jump(0.0, 300)).collect();
    let own = excited(&clean, true);
    assert!(!own.has_lines && own.is_still && own.advice().is_some());
    assert_eq!(own.most_parameters(), None);
    for row in &own.rows {
        assert!(row.coherence.unwrap() > 1.0 - 1e-9, "{row:?}");
        // The transform of a jump of 5 is 5/ω.
        assert!(
            (0.5..2.0).contains(&(row.forcing * row.frequency / 5.0)),
            "{row:?}"
        );
    }
    let noisy: Vec<Run> = (0..3).map(|_| jump(3.0, 300)).collect();
    let noisy = excited(&noisy, true);
    assert!(noisy.coherent().count() < own.rows.len() / 2, "{noisy:?}");
    let few = excited(&clean[..2], false);
    assert!(!few.of_stick && few.rows.iter().all(|own| own.coherence.is_none()));
    assert_eq!(few.highest(), None);
}
