//! What a fit says against itself: flights and vehicles that make its answer wrong, each beside the shipped
//! ones, which do not.

use crate::command::{Folder, example};
use crate::fitted::{codes, fitted, recorded, theta, with};
use crate::joint_ode::Loop;
use pilotage::collocation::Scheme;
use pilotage::estimation::file::Mesh;
use pilotage::estimation::{Diagnostic, Fit};
use pilotage::flights::options::{InitialState, Objective};
use pilotage::flights::{FlightOptions, Trial, TrialSet};
use pilotage::models::{Pilot, Quadcopter};
use pilotage::synthetic::{Flights, Human};
use pilotage::vehicle::ClosedLoop;
use std::sync::OnceLock;

fn shipped() -> Vec<Trial> {
    TrialSet::read(&[example("trials/trials.toml")])
        .unwrap()
        .fit
}

/// The default fit of the shipped flights.
fn shipped_fit() -> &'static Fit {
    static FIT: OnceLock<Fit> = OnceLock::new();
    FIT.get_or_init(|| fitted(&shipped(), &FlightOptions::default()))
}

fn synthetic(seed: u64) -> Vec<Trial> {
    let flights = Flights {
        seed,
        ..Flights::default()
    };
    let flights = flights
        .fly(&Human::default(), &Quadcopter::default())
        .unwrap();
    let parsed = flights.iter().map(|flight| {
        let csv = flight.series.to_csv();
        Trial::parse(csv.as_bytes(), &flight.name).unwrap()
    });
    parsed.collect()
}

/// Two runs, changed: enough to see what a fit says of them.
fn changed(change: impl Fn(&mut Trial)) -> Vec<Trial> {
    let mut trials = vec![shipped().swap_remove(0), shipped().swap_remove(4)];
    trials.iter_mut().for_each(change);
    trials
}

/// Of these seeds the best fit without the constraint flies an unstable loop; seed 7 is 4,900 m away after 300 s.
#[test]
fn every_fit_keeps_its_closed_loop_stable() {
    for seed in [5, 7, 10] {
        let fit = fitted(&synthetic(seed), &FlightOptions::default());
        assert!(fit.is_answer(), "{seed}: {}", fit.verdict());
        let pilot = Pilot { order: 3 };
        let closed_loop = ClosedLoop::of(Quadcopter::default(), pilot, &theta(&fit));
        let rightmost = closed_loop.rightmost().unwrap().re;
        assert!(rightmost <= -1e-3 * (1.0 - 1e-6), "{seed}: {rightmost}");
        assert_eq!(codes(&fit), ["loop-on-bound"], "{seed}");
    }
}

#[test]
fn an_unstable_loop_that_was_allowed_is_the_first_diagnostic() {
    let options = with(|own| own.stable_loop = false);
    let free = fitted(&shipped(), &options);
    assert!(free.is_answer() && !free.is_stable());
    assert_eq!(codes(&free)[0], "unstable-loop");
    // What stability costs: little, since the data hardly tell.
    let cost = shipped_fit().objective / free.objective - 1.0;
    assert!((0.0..0.01).contains(&cost), "{cost}");
}

/// Over 6,000 s, from rest; the unstable one was 28 m away by then.
#[test]
fn the_pilot_of_the_shipped_flights_stays_at_the_target() {
    let flown = Loop {
        theta: theta(shipped_fit()),
        limit: 1.0,
        target: 10.0,
    };
    let points = flown.solve(0.5, 6000.0);
    let worst = points[30..].iter().map(|point| (point.z[0] - 10.0).abs());
    let worst = worst.fold(0.0, f64::max);
    assert!(worst < 0.5, "{worst} m");
}

/// Poles of a loop whose polynomial is known in closed form: an ideal gain on K/s² is not to be had with this
/// vehicle, so a pilot with its pole on its zero, which must leave the vehicle's own poles and its own.
#[test]
fn a_pilot_of_no_gain_leaves_the_poles_of_pilot_and_vehicle() {
    let found = ClosedLoop::of(
        Quadcopter::default(),
        Pilot { order: 2 },
        &[6.0, 5.0, 0.0, 0.0],
    );
    assert_eq!(found.poles.len(), 8);
    for pole in [-2.0, -3.0, -14.48, 0.0] {
        let nearest = found
            .poles
            .iter()
            .map(|p| (p - pole).norm())
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-7, "{pole}: {:?}", found.poles);
    }
    assert!(!found.is_stable(), "nobody brings it back");
}

#[test]
fn the_shipped_flights_raise_one_diagnostic() {
    assert!(shipped_fit().is_answer());
    assert_eq!(codes(shipped_fit()), ["loop-on-bound"]);
}

#[test]
fn flights_that_never_move_are_no_answer() {
    let trials = changed(|trial| {
        trial.position.fill(0.0);
        trial.target.fill(0.0);
        trial.stick = None;
    });
    let fit = fitted(&trials, &FlightOptions::default());
    assert_eq!(codes(&fit)[0], "constant-data");
    assert!(!fit.is_answer() && fit.ending() == "constant-data");
    assert!(fit.uncertainty.is_err(), "no intervals of width 0");
}

/// Hovering about the target with the motion of a remnant, here two sines of small amplitude.
#[test]
fn hovering_without_a_task_is_no_answer() {
    let trials = changed(|trial| {
        let wander = |t: &f64| 0.2 * (0.9 * t).sin() + 0.1 * (2.3 * t).sin();
        trial.position = trial.time.iter().map(wander).collect();
        trial.target.fill(0.0);
        trial.stick = None;
    });
    let options = with(|own| own.fit.max_iterations = 20);
    let fit = fitted(&trials, &options);
    assert!(
        codes(&fit).contains(&"no-forcing") && !fit.is_answer(),
        "{:?}",
        codes(&fit)
    );
}

/// It must not matter whether the start is away from the target or the target moves.
#[test]
fn a_target_that_moves_is_a_task() {
    let trials = changed(|trial| {
        trial.target = trial.time.iter().map(|t| 0.5 * t.sin()).collect();
        trial.position = trial.time.iter().map(|t| 0.4 * (t - 0.4).sin()).collect();
        trial.stick = None;
    });
    let options = with(|own| own.fit.max_iterations = 5);
    assert!(!codes(&fitted(&trials, &options)).contains(&"no-forcing"));
}

#[test]
fn one_sample_of_500_m_is_named() {
    let mut trials = changed(|_| ());
    trials[0].position[123] = 500.0;
    let fit = fitted(&trials, &FlightOptions::default());
    let Some(Diagnostic::Outlier {
        run,
        time,
        count,
        share,
        ..
    }) = fit.diagnostics.first()
    else {
        panic!("{:?}", fit.diagnostics)
    };
    assert_eq!((run.as_str(), *time, *count), ("10m-run1", 6.15, 1));
    assert!(*share > 0.9 && !fit.is_answer());
}

/// Those of a fit that is not followed to its end.
fn codes_of(trials: &[Trial]) -> Vec<&'static str> {
    codes(&fitted(trials, &FlightOptions::default()))
}

fn outlier(trials: &[Trial]) -> (String, f64, usize, bool) {
    let fit = fitted(trials, &FlightOptions::default());
    let found = fit
        .diagnostics
        .iter()
        .find_map(|diagnostic| match diagnostic {
            Diagnostic::Outlier {
                run, time, count, ..
            } => Some((run.clone(), *time, *count, diagnostic.is_fatal())),
            _ => None,
        });
    found.unwrap_or_else(|| panic!("{:?}", codes(&fit)))
}

#[test]
fn outliers_side_by_side_are_counted_and_the_worst_is_named() {
    let mut trials = changed(|_| ());
    trials[1].position[120..123].copy_from_slice(&[300.0, 500.0, 320.0]);
    let name = trials[1].name.clone();
    assert_eq!(outlier(&trials), (name, 6.05, 3, true));
}

#[test]
fn a_recording_that_drops_to_zero_for_a_while_is_told() {
    let mut trials = changed(|_| ());
    trials[1].position[150..165].fill(0.0);
    let (run, time, count, _) = outlier(&trials);
    assert_eq!((run, count), (trials[1].name.clone(), 15));
    assert!((7.5..8.25).contains(&time), "{time}");
}

#[test]
fn a_first_sample_that_is_off_is_told() {
    let mut trials = changed(|_| ());
    trials[0].position[0] = 4.0;
    let (run, time, count, _) = outlier(&trials);
    assert_eq!((run, time, count), (trials[0].name.clone(), 0.0, 1));
}

#[test]
fn a_jump_in_one_run_is_told() {
    let mut trials = changed(|_| ());
    trials[1].position[140..].iter_mut().for_each(|z| *z += 3.0);
    let fit = fitted(&trials, &FlightOptions::default());
    let jump = fit
        .diagnostics
        .iter()
        .find_map(|diagnostic| match diagnostic {
            Diagnostic::Jump { time, size, .. } => Some((*time, *size)),
            _ => None,
        });
    let (time, size) = jump.unwrap_or_else(|| panic!("{:?}", codes(&fit)));
    assert!(time == 7.0 && (size - 3.0).abs() < 0.2, "{time} {size}");
    assert!(!codes(&fit).contains(&"outlier"));
}

/// Found before any fit too, and not called a jump.
#[test]
fn a_position_that_stands_still_is_told() {
    let mut trials = changed(|_| ());
    for (run, samples) in [(0, 40..70), (1, 100..112)] {
        let value = trials[run].position[samples.start];
        trials[run].position[samples].fill(value);
    }
    let fit = fitted(&trials, &FlightOptions::default());
    let frozen = fit.diagnostics.iter().find_map(|own| match own {
        Diagnostic::Frozen {
            from, to, count, ..
        } => Some((*from, *to, *count)),
        _ => None,
    });
    assert_eq!(frozen, Some((2.0, 3.45, 2)), "{:?}", fit.diagnostics);
    assert!(!codes(&fit).contains(&"jump"));
    let before = recorded(&trials);
    let frozen = before.iter().find_map(|own| match own {
        Diagnostic::Frozen {
            from, to, count, ..
        } => Some((*from, *to, *count)),
        _ => None,
    });
    assert_eq!(frozen, Some((2.0, 3.45, 2)), "{before:?}");
    assert!(before.iter().all(|own| own.code() != "jump"));
    assert_eq!(recorded(&shipped()), []);
}

/// It is driven, so that it does not rest there.
#[test]
fn a_position_that_stands_still_at_an_end_is_told() {
    let found = |samples: std::ops::Range<usize>, moves: bool| {
        let mut trials = changed(|_| ());
        let trial = &mut trials[1];
        let value = trial.position[samples.start];
        trial.position[samples.clone()].fill(value);
        if !moves {
            let target = trial.target[samples.start];
            trial.target[samples.clone()].fill(target);
            trial.stick.as_mut().unwrap()[samples].fill(0.0);
        }
        let told = recorded(&trials).into_iter().find_map(|own| match own {
            Diagnostic::Frozen { from, to, size, .. } => Some((from, to, size.is_some())),
            _ => None,
        });
        told.map(|(from, to, comes_back)| {
            let at = |time: f64| trials[1].time.iter().position(|t| *t == time).unwrap();
            (at(from)..at(to) + 1, comes_back)
        })
    };
    let last = changed(|_| ())[1].time.len();
    assert_eq!(found(0..last, true), Some((0..last, false)));
    assert_eq!(found(last - 150..last, false), None);
}

/// Samples that are wild again and again are no motion.
#[test]
fn frequent_outliers_are_told() {
    for every in [50, 20, 11] {
        let mut trials = changed(|_| ());
        for trial in &mut trials {
            let wild = (0..trial.position.len()).step_by(every).skip(1);
            wild.for_each(|k| trial.position[k] += 20.0 + (k % 7) as f64);
        }
        let codes: Vec<_> = recorded(&trials).iter().map(Diagnostic::code).collect();
        assert_eq!(codes, ["outlier"], "one in {every}");
    }
}

/// A target that moves on does not explain a jump, and a vehicle does not stop at once.
#[test]
fn jumps_and_stops_in_motion_are_told_before_a_fit() {
    let sines = |t: f64| 4.0 * (0.6 * t).sin() + 2.0 * (1.5 * t).sin();
    let mut trials = changed(|own| {
        own.target = own.time.iter().map(|t| sines(*t)).collect();
        own.position = own.time.iter().map(|t| sines(*t - 0.4)).collect();
        own.stick = None;
    });
    trials.truncate(1);
    assert_eq!(recorded(&trials), []);
    let codes = |change: fn(&mut [f64])| -> Vec<_> {
        let mut trials = trials.clone();
        change(&mut trials[0].position);
        recorded(&trials).iter().map(Diagnostic::code).collect()
    };
    let jump = |z: &mut [f64]| z[130..].iter_mut().for_each(|z| *z += 4.0);
    assert_eq!(codes(jump), ["jump"]);
    let stop = |z: &mut [f64]| (241..z.len()).for_each(|k| z[k] = z[240]);
    assert_eq!(codes(stop), ["frozen"]);
    let start = |z: &mut [f64]| (1..60).for_each(|k| z[k] = z[0]);
    assert_eq!(codes(start), ["frozen"]);
    let slow = |z: &mut [f64]| (0..z.len()).for_each(|k| z[k] = z[k / 10 * 10]);
    assert_eq!(codes(slow), ["slow-sensor"]);
    let beside = |z: &mut [f64]| z.iter_mut().for_each(|z| *z += 30.0);
    assert_eq!(codes(beside), ["origin"]);
    let other_unit = |z: &mut [f64]| z.iter_mut().for_each(|z| *z *= 0.01);
    assert_eq!(codes(other_unit), ["wrong-scale"]);
    let stops = |w: &mut [f64]| (100..130).for_each(|k| w[k] = w[100]);
    let mut still = trials.clone();
    stops(&mut still[0].target);
    let found = recorded(&still);
    assert_eq!(found[0].code(), "frozen");
    assert!(found[0].to_string().starts_with("target of"), "{found:?}");
}

/// What needs no fit is known before it.
#[test]
fn recordings_are_doubted_before_a_fit() {
    let before = |change: fn(&mut Trial)| -> Vec<&'static str> {
        recorded(&changed(change))
            .iter()
            .map(Diagnostic::code)
            .collect()
    };
    assert_eq!(before(|_| ()), [""; 0]);
    assert_eq!(before(|own| own.position[100] += 5.0), ["outlier"]);
    assert_eq!(before(|own| own.position.fill(1.0)), ["constant-data"]);
    assert_eq!(
        before(|own| own.position.iter_mut().for_each(|z| *z *= -1.0)),
        ["wrong-scale"]
    );
    assert_eq!(
        before(|own| own.stick.as_mut().unwrap().fill(0.0)),
        ["frozen"]
    );
    assert_eq!(
        before(|own| own.time.iter_mut().for_each(|t| *t *= 1e-3)),
        ["time-scale"]
    );
}

/// Ends of a task that are none of the recording: a target that jumps to the other side, a rounded target. A sensor of 2 Hz is
/// that alone.
#[test]
fn slow_sensors_and_square_targets_are_no_outliers() {
    let slow = changed(|own| {
        let position = own.position.clone();
        (own.position.iter_mut().enumerate()).for_each(|(k, z)| *z = position[k / 10 * 10]);
    });
    let codes = |trials: &[Trial]| {
        recorded(trials)
            .iter()
            .map(Diagnostic::code)
            .collect::<Vec<_>>()
    };
    assert_eq!(codes(&slow), ["slow-sensor"]);
    assert!(!crate::fitted::codes(&fitted(&slow, &FlightOptions::default())).contains(&"outlier"));
    // Tracked with a lag of 0.5 s and an overshoot.
    let square = changed(|own| {
        let side = |t: f64| {
            if t % 10.0 < 5.0 { 1.0 } else { -1.0 }
        };
        own.target = own.time.iter().map(|t| side(*t)).collect();
        let mut z = 0.0;
        for k in 0..own.time.len() {
            own.position[k] = 1.03 * z;
            z += 0.05 / 0.5 * (own.target[k] - z);
        }
        own.stick = None;
    });
    assert_eq!(codes(&square[..1]), [""; 0]);
    let rounded = changed(|own| {
        let of = |t: &f64| (4.0 * (0.7 * t).sin() * 10.0).round() / 10.0;
        own.target = own.time.iter().map(of).collect();
    });
    assert!(!codes(&rounded).contains(&"target-outlier"));
}

/// A sensor whose range ends at half the motion.
#[test]
fn clipped_positions_are_named() {
    let sine = |limit: f64| {
        changed(|own| {
            let at = |t: &f64| 4.0 * (0.7 * t).sin();
            own.target = own.time.iter().map(at).collect();
            let late = own.time.iter().map(|t| at(&(t - 0.4)));
            own.position = late.map(|z| z.clamp(-limit, limit)).collect();
        })
    };
    let codes = |limit| {
        let found = recorded(&sine(limit)[..1]);
        found.iter().map(Diagnostic::code).collect::<Vec<_>>()
    };
    assert_eq!(codes(2.0), ["clipped"]);
    assert_eq!(codes(5.0), [""; 0]);
}

/// A recording in steps of 0.25 m, and one of 0.01 m of a single flight.
#[test]
fn rounded_recordings_have_no_outliers() {
    for (runs, step) in [(2, 0.25), (1, 0.01)] {
        let mut trials = changed(|trial| {
            (trial.position.iter_mut()).for_each(|z| *z = (*z / step).round() * step);
        });
        trials.truncate(runs);
        let found = codes_of(&trials);
        assert!(
            !found.contains(&"outlier") && !found.contains(&"jump"),
            "{found:?}"
        );
    }
}

#[test]
fn a_run_of_another_origin_is_told() {
    let is_misfit = |offset: f64| {
        let mut trials = shipped();
        (trials[1].position.iter_mut().skip(1)).for_each(|z| *z += offset);
        codes_of(&trials).contains(&"misfit")
    };
    assert!(is_misfit(5.0) && !is_misfit(0.0));
}

#[test]
fn a_stick_that_was_never_recorded_is_told() {
    let trials = changed(|trial| trial.stick.as_mut().unwrap().fill(0.0));
    assert!(codes_of(&trials).contains(&"frozen"));
    assert!(!codes(shipped_fit()).contains(&"frozen"));
}

/// In a fit that comes to nothing, here since it is ended at once.
#[test]
fn a_long_time_without_rows_is_told() {
    let trials = changed(|trial| {
        for values in [&mut trial.time, &mut trial.target, &mut trial.position] {
            values.drain(20..200);
        }
        trial.stick = None;
    });
    let options = with(|own| own.fit.max_iterations = 1);
    let fit = fitted(&trials, &options);
    let gap = fit
        .diagnostics
        .iter()
        .find_map(|diagnostic| match diagnostic {
            Diagnostic::Gap { from, to, .. } => Some((*from, *to)),
            _ => None,
        });
    assert_eq!(gap, Some((0.95, 10.0)), "{:?}", codes(&fit));
}

#[test]
fn a_target_that_flickers_is_told_and_a_doublet_is_not() {
    let with = |count: usize| {
        let mut trials = changed(|_| ());
        trials[0].target[100..100 + count].fill(500.0);
        codes_of(&trials).contains(&"target-outlier")
    };
    assert!(with(1) && with(2) && !with(20));
}

/// The first two seconds of each recording are missing.
#[test]
fn a_run_that_begins_in_motion_is_told_where_it_is_fitted_from_rest() {
    let trials = changed(|trial| {
        for values in [&mut trial.time, &mut trial.target, &mut trial.position] {
            values.drain(..40);
        }
        trial.stick = None;
    });
    let of = |initial_state| {
        let options = with(|own| {
            own.initial_state = initial_state;
            own.fit.max_iterations = 50;
        });
        codes(&fitted(&trials[..2], &options)).contains(&"moving-start")
    };
    assert!(of(InitialState::AtRest) && of(InitialState::VehicleAtRest));
    assert!(!of(InitialState::Free));
}

#[test]
fn positions_of_the_wrong_sign_or_unit_are_told() {
    let of = |factor: f64| {
        let trials = changed(|trial| {
            trial.position.iter_mut().for_each(|z| *z *= factor);
            trial.stick = None;
        });
        let options = with(|own| own.fit.max_iterations = 20);
        let fit = fitted(&trials, &options);
        (codes(&fit).contains(&"wrong-scale"), fit.is_answer())
    };
    assert_eq!([of(-1.0), of(100.0)], [(true, false); 2]);
    assert!(!of(1.3).0);
}

#[test]
fn times_of_another_unit_are_told() {
    let of = |factor: f64| {
        let trials = changed(|trial| {
            trial.time.iter_mut().for_each(|t| *t *= factor);
            trial.stick = None;
        });
        let options = with(|own| own.fit.max_iterations = 5);
        codes(&fitted(&trials, &options)).contains(&"time-scale")
    };
    assert!(of(1000.0) && of(1.0 / 60.0) && !of(2.0) && !of(0.5));
}

/// Forward Euler is off by much at 20 Hz; the same with short steps is not.
#[test]
fn a_mesh_on_which_the_scheme_is_not_the_equations_is_told() {
    let of = |scheme, mesh| {
        let options = with(|own| {
            own.fit.scheme = Some(scheme);
            own.fit.mesh = mesh;
        });
        codes(&fitted(&changed(|_| ()), &options)).contains(&"mesh-error")
    };
    assert!(of(Scheme::Euler, Mesh::Samples));
    assert!(!of(Scheme::Euler, Mesh::Step(0.0025)));
    assert!(!of(Scheme::HermiteSimpson, Mesh::Samples));
}

/// A human who overshoots more each time: no stable loop does so.
#[test]
fn a_human_whose_own_loop_grows_is_on_the_stability_bound() {
    let human = Human {
        gain: 0.05,
        lead: 0.8,
        delay: 0.3,
        ..Human::default()
    };
    let flights = Flights {
        targets: vec![10.0, 20.0],
        runs: 1,
        ..Flights::default()
    };
    let flown = flights.fly(&human, &Quadcopter::default()).unwrap();
    let trials: Vec<Trial> = (flown.iter())
        .map(|flight| Trial::parse(flight.series.to_csv().as_bytes(), &flight.name).unwrap())
        .collect();
    let fit = fitted(&trials, &FlightOptions::default());
    assert!(fit.is_stable(), "{}", fit.verdict());
    assert!(
        codes(&fit).contains(&"loop-on-bound"),
        "{:?}",
        fit.diagnostics
    );
    let free = fitted(&trials, &with(|own| own.stable_loop = false));
    assert!(free.is_answer() && codes(&free)[0] == "unstable-loop");
    assert!(
        free.objective < fit.objective,
        "{} {}",
        free.objective,
        fit.objective
    );
}

/// Two runs to one target that swing against each other about what a pilot does.
#[test]
fn a_model_that_explains_little_is_told() {
    let mut trials = vec![shipped().swap_remove(0), shipped().swap_remove(0)];
    trials[1].name = "again".into();
    trials[1].origin = "again.csv".into();
    for (trial, sign) in trials.iter_mut().zip([1.0, -1.0]) {
        trial.stick = None;
        let swing = trial.time.iter().map(|t| sign * 6.0 * (2.0 * t).sin());
        trial
            .position
            .iter_mut()
            .zip(swing)
            .for_each(|(z, w)| *z += w);
    }
    let fit = fitted(&trials, &FlightOptions::default());
    assert!(fit.is_met(), "{}", fit.status);
    let explained = fit
        .diagnostics
        .iter()
        .find_map(|diagnostic| match diagnostic {
            Diagnostic::PoorFit { explained, .. } => Some(*explained),
            _ => None,
        });
    assert!(
        (0.0..0.5).contains(&explained.unwrap()),
        "{:?}",
        codes(&fit)
    );
    assert!(!codes(shipped_fit()).contains(&"poor-fit"));
}

#[test]
fn a_stick_of_the_wrong_sign_is_told() {
    let turned = changed(|trial| {
        let stick = trial.stick.as_mut().unwrap();
        stick.iter_mut().for_each(|u| *u = -*u);
    });
    let stick = fitted(&turned, &with(|own| own.objective = Objective::Stick));
    assert!(
        !codes(&stick).contains(&"open-loop"),
        "nobody said what was flown"
    );
    let known = with(|own| {
        own.objective = Objective::Stick;
        own.vehicle_file = Some(example("vehicles/quadcopter.toml"));
    });
    let known = fitted(&turned, &known);
    assert_eq!(codes(&known)[0], "unstable-loop");
    assert!(codes(&known).contains(&"open-loop"));
    assert!(!known.is_answer(), "nobody allowed it");
}

#[test]
fn a_vehicle_that_is_no_body_is_told() {
    let of = |vehicle| {
        let options = with(|own| {
            own.vehicle = vehicle;
            own.fit.max_iterations = 5;
        });
        codes(&fitted(&changed(|_| ()), &options))
    };
    let heavy = Quadcopter {
        mass: 1200.0,
        ..Quadcopter::default()
    };
    assert!(of(heavy).contains(&"vehicle-size"));
    let unflyable = Quadcopter {
        attitude_gain: 200.0,
        ..Quadcopter::default()
    };
    assert!(of(unflyable).contains(&"vehicle-unstable"));
}

/// Sines are followed late, so that positions and targets of one time are hardly alike.
#[test]
fn a_wrong_unit_or_sign_is_told_behind_a_delay() {
    let is_wrong_scale = |factor: f64| {
        let sines = |t: f64| -> f64 {
            let lines = [6.0, 13.0, 27.0, 41.0].map(|n| std::f64::consts::TAU * n / 81.92);
            lines.iter().map(|w| (w * (t + 7.0)).sin()).sum()
        };
        let late = |trial: &mut Trial| {
            trial.time = (0..400).map(|k| 0.05 * f64::from(k)).collect();
            trial.target = trial.time.iter().map(|t| sines(*t)).collect();
            let position = |t: &f64| factor * (sines(t - 0.8) - sines(-0.8));
            trial.position = trial.time.iter().map(position).collect();
            trial.stick = None;
        };
        let trials = changed(late)[..1].to_vec();
        codes_of(&trials).contains(&"wrong-scale")
    };
    assert!(is_wrong_scale(3.28) && is_wrong_scale(-1.0) && !is_wrong_scale(1.0));
}

#[test]
fn a_flight_that_stands_there_twice_is_told() {
    let mut trials = changed(|_| ());
    let of = |trials: &[Trial]| codes(&fitted(trials, &FlightOptions::default())).contains(&"copy");
    assert!(!of(&trials));
    let mut copy = trials[0].clone();
    copy.name = "again".to_owned();
    copy.origin = "again.csv".to_owned();
    trials.push(copy);
    assert!(of(&trials));
    trials.last_mut().unwrap().position[3] += 1e-9;
    assert!(!of(&trials));
}

#[test]
fn a_mesh_of_a_few_intervals_is_told() {
    let of = |step| {
        let options = with(|own| own.fit.mesh = Mesh::Step(step));
        codes(&fitted(&changed(|_| ()), &options)).contains(&"mesh-error")
    };
    assert!(of(2.0) && !of(0.1));
}

/// What speaks against flights speaks against the same data as a problem file, by code, words and exit code; what makes a fit
/// meaningless is known before the search.
#[test]
fn a_problem_file_of_flights_is_told_the_same() {
    let flight = std::fs::read_to_string(example("trials/10m-run1.csv")).unwrap();
    let with = |change: &dyn Fn(usize, [f64; 4]) -> [f64; 4]| -> String {
        let mut rows = 0;
        let line = |line: &str| {
            let cells: Vec<f64> = line.split(',').map_while(|own| own.parse().ok()).collect();
            let [time, target, position, stick] = cells[..] else {
                return String::new();
            };
            rows += 1;
            let [time, target, position, stick] = change(rows, [time, target, position, stick]);
            format!("{time},{target},{position},{stick}\n")
        };
        "time,target,position,stick\n".to_owned() + &flight.lines().map(line).collect::<String>()
    };
    let short: String = with(&|_, own| own)
        .lines()
        .take(6)
        .fold(String::new(), |all, line| all + line + "\n");
    let cases = [
        ("constant-data", with(&|_, [t, ..]| [t, 0.0, 0.0, 0.0])),
        (
            "no-forcing",
            with(&|_, [t, ..]| [t, 0.0, 0.2 * (0.9 * t).sin(), 0.0]),
        ),
        ("wrong-scale", with(&|_, [t, w, z, u]| [t, w, 100.0 * z, u])),
        ("time-scale", with(&|_, [t, w, z, u]| [1000.0 * t, w, z, u])),
        (
            "outlier",
            with(&|k, [t, w, z, u]| [t, w, if k == 90 { 1e8 } else { z }, u]),
        ),
        ("few-values", short),
    ];
    for (code, text) in cases {
        let folder = Folder::new();
        folder.write("run.csv", text);
        let ended = folder.pilotage(&["init", "run.csv", "-o", "problem.toml"]);
        assert_eq!(ended.code, 0, "{}", ended.stderr);
        let told = ["run.csv", "problem.toml"].map(|file| {
            let ended = folder.pilotage(&["fit", file, "-o", "out.toml", "--force", "--json"]);
            let json = ended.json();
            assert_eq!(
                (ended.code, json["status"].as_str()),
                (1, Some(code)),
                "{json}"
            );
            assert_eq!(json["iterations"], 0, "{code}");
            json["doubts"][0]["words"]
                .as_str()
                .unwrap()
                .replace("run.csv", "run")
        });
        assert_eq!(told[0], told[1]);
    }
}

/// Exit codes, the file that is written, and what is made of it.
#[test]
fn the_command_says_what_the_fit_says() {
    let folder = Folder::new();
    let flight = std::fs::read_to_string(example("trials/10m-run1.csv")).unwrap();
    let still: String = (flight.lines())
        .map(|line| match line.split(',').collect::<Vec<_>>()[..] {
            [time, ..] if time.parse::<f64>().is_ok() => format!("{time},0,0,0\n"),
            _ => format!("{line}\n"),
        })
        .collect();
    folder.write("still.csv", still);
    folder.write(
        "far.csv",
        flight.replace("\n5,10,11.0206,", "\n5,10,1e100,"),
    );

    let ended = folder.pilotage(&["fit", "still.csv", "-o", "still.toml"]);
    assert_eq!(ended.code, 1, "{ended:?}");
    assert!(
        ended
            .stdout
            .contains("diagnostic [constant-data]: what is measured does not move")
    );
    assert!(
        folder
            .read("still.toml")
            .contains("NO ANSWER (constant-data)")
    );
    let ended = folder.pilotage(&["export", "pilot", "still.toml", "-o", "still.fmu"]);
    assert_eq!(ended.code, 2, "{ended:?}");
    assert!(
        ended
            .stderr
            .contains("still.toml: the fit did not converge"),
        "{ended:?}"
    );

    // It never ended, whatever limit was set.
    let ended = folder.pilotage(&["fit", "far.csv", "-o", "far.toml"]);
    assert_eq!((ended.code, folder.path("far.toml").exists()), (2, false));
    assert!(
        ended
            .stderr
            .contains("far.csv: position = 1e100 m at 5 s; expected"),
        "{ended:?}"
    );

    let flights = example("trials/10m-run1.csv");
    let flights = flights.to_str().unwrap();
    let ended = folder.pilotage(&[
        "fit",
        flights,
        "--allow-unstable-loop",
        "-o",
        "free.toml",
        "--json",
        "--report",
        "free.html",
    ]);
    let json = ended.json();
    let stable = json["closed_loop"]["stable"].as_bool().unwrap();
    assert_eq!(json["closed_loop"]["poles"].as_array().unwrap().len(), 9);
    let first = json["doubts"]
        .as_array()
        .unwrap()
        .first()
        .map(|diagnostic| &diagnostic["code"]);
    assert_eq!(first == Some(&"unstable-loop".into()), !stable, "{json}");
    assert!(folder.read("free.html").contains("\"name\":\"poles\""));
}
