//! What follows from parameters, with intervals that have a formula.

use nalgebra::Complex;
use pilotage_estimation::{Fit, PilotPaths, Posed, ProblemFile, fit, part};
use pilotage_inference::{Class, Interval, quantile};
use std::fmt::Write;
use std::ops::ControlFlow;

const SAMPLES: usize = 60;

fn time(k: usize) -> f64 {
    0.1 * k as f64
}

/// A value that is no solution: what is not told by the model is noise.
fn recorded(j: usize, k: usize, x: f64) -> f64 {
    let phase = (7 * k * k + 13 * j * k + 3 * j) as f64;
    x + 0.05 * phase.sin()
}

/// The fit of a problem with files beside it, and with runs that follow `x`.
fn fitted(files: &[(&str, &str)], problem: &str, runs: usize, x: impl Fn(f64) -> f64) -> Fit {
    looked_at(files, problem, runs, x, |_, fit| fit)
}

/// The same, with the problem itself.
fn looked_at<T>(
    files: &[(&str, &str)],
    problem: &str,
    runs: usize,
    x: impl Fn(f64) -> f64,
    look: impl FnOnce(&Posed<'_>, Fit) -> T,
) -> T {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    files.iter().for_each(|(name, text)| write(name, text));
    let mut text = problem.to_owned();
    for j in 0..runs {
        let mut rows = "time,x\n".to_owned();
        for k in 0..SAMPLES {
            writeln!(rows, "{},{}", time(k), recorded(j, k, x(time(k)))).unwrap();
        }
        write(&format!("run{j}.csv"), &rows);
        write!(text, "[[run]]\nfile = \"run{j}.csv\"\n").unwrap();
    }
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).unwrap();
    let posed = Posed::new(&file, &part::open).unwrap();
    look(&posed, fit(&posed, &mut |_| ControlFlow::Continue(())))
}

fn derived(fit: &Fit, name: &str) -> (f64, Interval) {
    let place = fit.derived.iter().position(|own| own.name == name).unwrap();
    let sure = fit.uncertainty.as_ref().unwrap();
    (fit.derived[place].values[0].1, sure.derived[place][0])
}

fn parameter(fit: &Fit, name: &str) -> (f64, Interval) {
    let place = fit
        .parameters
        .iter()
        .position(|own| own.name == name)
        .unwrap();
    let sure = fit.uncertainty.as_ref().unwrap();
    (fit.parameters[place].values[0].1, sure.intervals[place][0])
}

#[track_caller]
fn assert_near(found: f64, expected: f64, relative: f64) {
    let distance = (found - expected).abs();
    assert!(
        distance < relative * expected.abs(),
        "{found} is not {expected}"
    );
}

const DECAY: &str = "[model]\nname = \"decay\"\n[parameters]\nrate = 0.5\n[states]\n\
                     x = { start = 2, der = \"-rate * x\" }\n";
const MEASURED: &str = "[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n";

/// The half-life is `ln 2/rate`, and the initial state is told as a parameter would be: by `s² (JᵀJ)⁻¹`.
#[test]
fn half_lives_and_initial_states_have_the_intervals_of_formulas() {
    let problem = format!(
        "[system.m]\nmodel = \"decay.toml\"\n{MEASURED}[parameters]\n\"m.rate\" = {{}}\n[initial]\n\"m.x\" = \"free\"\n\
         [derived]\nhalf_life = \"log(2) / m.rate\"\ntwice = \"2 * half_life\"\n[fit]\ncovariance = \"plain\"\n"
    );
    let fit = fitted(&[("decay.toml", DECAY)], &problem, 1, |t| {
        3.0 * (-0.7 * t).exp()
    });
    let (rate, of_rate) = parameter(&fit, "m.rate");
    let (half_life, own) = derived(&fit, "half_life");
    assert_near(half_life, 2_f64.ln() / rate, 1e-12);
    assert_near(own.sd, 2_f64.ln() / rate.powi(2) * of_rate.sd, 1e-9);
    let degrees = SAMPLES as f64 - 2.0;
    assert_near(own.high - half_life, quantile(0.95, degrees) * own.sd, 1e-9);
    assert_near(derived(&fit, "twice").1.sd, 2.0 * own.sd, 1e-9);
    let x0 = fit.runs[0].states[0][0];
    let (mut information, mut squares) = ([[0.0; 2]; 2], 0.0);
    for k in 0..SAMPLES {
        let decayed = (-rate * time(k)).exp();
        let row = [-time(k) * x0 * decayed, decayed];
        squares += (fit.runs[0].recorded[0][k] - x0 * decayed).powi(2);
        for i in 0..2 {
            (0..2).for_each(|j| information[i][j] += row[i] * row[j]);
        }
    }
    let [[a, b], [_, d]] = information;
    let variance = squares / degrees * a / (a * d - b * b);
    let initial = fit.uncertainty.as_ref().unwrap().initial[0][0].unwrap();
    assert_near(initial.sd, variance.sqrt(), 1e-4);
}

const PILOT: &str = "[model]\nname = \"pilot\"\n[inputs]\ntarget = 1\nposition = 0\n[parameters]\ngain = 0.5\n\
                     [outputs]\nstick = \"gain * (target - position)\"\n";
const VEHICLE: &str = "[model]\nname = \"vehicle\"\n[inputs]\nstick = 0\n[parameters]\nrate = 2\n[states]\n\
                       z = { der = \"rate * stick\" }\n";
const LOOP: &str = "[system.pilot]\nmodel = \"pilot.toml\"\n[system.vehicle]\nmodel = \"vehicle.toml\"\n[connect]\n\
                    \"pilot.stick\" = \"vehicle.stick\"\n\"vehicle.z\" = \"pilot.position\"\n\
                    [[measured]]\nsignal = \"vehicle.z\"\ncolumn = \"x\"\n";

/// `L = gain rate/s`: the crossover and the pole are at that frequency, the phase margin is 90°, and no delay is left.
#[test]
fn a_gain_before_an_integrator_has_the_figures_of_the_crossover_model() {
    let files = [("pilot.toml", PILOT), ("vehicle.toml", VEHICLE)];
    let problem = format!("{LOOP}[parameters]\n\"pilot.gain\" = {{}}\n");
    let fit = fitted(&files, &problem, 2, |t| 1.0 - (-1.2 * t).exp());
    let (gain, of_gain) = parameter(&fit, "pilot.gain");
    for (name, value, sd) in [
        ("crossover_frequency", 2.0 * gain, 2.0 * of_gain.sd),
        ("pole1_re", -2.0 * gain, 2.0 * of_gain.sd),
    ] {
        let (found, own) = derived(&fit, name);
        assert_near(found, value, 1e-9);
        assert_near(own.sd, sd, 1e-6);
    }
    assert_near(derived(&fit, "phase_margin").0, 90.0, 1e-9);
    assert!(derived(&fit, "effective_delay").0.abs() < 1e-9);
    let names: Vec<&str> = fit.derived.iter().map(|own| own.name.as_str()).collect();
    assert!(!names.contains(&"gain_margin"), "{names:?}");
}

/// A zone with a heater: the data determine `R C` and `R g` alone. What is a function of these has the interval that it has where
/// they are the parameters; what is not has none.
#[test]
fn what_the_data_determine_has_an_interval_beside_flat_parameters() {
    let zone = "[model]\nname = \"zone\"\n[parameters]\nR = 2.0\nC = 0.4\ng = 0.6\n[states]\n\
                x = { start = 2, der = \"(g - x / R) / C\" }\n";
    let plain = "[model]\nname = \"plain\"\n[parameters]\ntau = 0.8\nend = 1.2\n[states]\n\
                 x = { start = 2, der = \"(end - x) / tau\" }\n";
    let files = [("zone.toml", zone), ("plain.toml", plain)];
    let problem = |file: &str, derived: &str| {
        format!(
            "[system.m]\nmodel = \"{file}.toml\"\n{MEASURED}[parameters]\n\"m.*\" = {{}}\n[derived]\n{derived}\
             [fit]\ncovariance = \"plain\"\n"
        )
    };
    let x = |t: f64| 1.0 + (-t / 0.9).exp();
    let all = "tau = \"m.R * m.C\"\nend = \"m.R * m.g\"\nslope = \"end / tau\"\nsum = \"m.R + m.C\"\nnearly = \"tau + 0.02 * m.g\"\n";
    let fit = fitted(&files, &problem("zone", all), 2, x);
    let other = fitted(
        &files,
        &problem("plain", "slope = \"m.end / m.tau\"\n"),
        2,
        x,
    );
    for name in ["m.R", "m.C", "m.g"] {
        assert_eq!(parameter(&fit, name).1.class, Class::Flat, "{name}");
    }
    for (name, (value, expected)) in [
        ("tau", parameter(&other, "m.tau")),
        ("end", parameter(&other, "m.end")),
        ("slope", derived(&other, "slope")),
    ] {
        let (found, own) = derived(&fit, name);
        assert_near(found, value, 1e-6);
        assert_near(own.sd, expected.sd, 1e-4);
        assert_eq!(own.class, Class::Finite, "{name}");
    }
    for name in ["sum", "nearly"] {
        assert_eq!(derived(&fit, name).1.class, Class::Flat, "{name}");
    }
}

/// Of two gains in series the data determine the product, which is the crossover.
#[test]
fn a_loop_of_two_gains_has_the_crossover_of_their_product() {
    let files = [("pilot.toml", PILOT), ("vehicle.toml", VEHICLE)];
    let x = |t: f64| 1.0 - (-1.2 * t).exp();
    let of = |also: &str| {
        fitted(
            &files,
            &format!("{LOOP}[parameters]\n\"pilot.gain\" = {{}}\n{also}"),
            2,
            x,
        )
    };
    let (one, both) = (of(""), of("\"vehicle.rate\" = {}\n"));
    assert_eq!(parameter(&both, "vehicle.rate").1.class, Class::Flat);
    for name in ["crossover_frequency", "pole1_re"] {
        assert_near(derived(&both, name).1.sd, derived(&one, name).1.sd, 1e-2);
    }
}

/// An offset of the sensor and a level that begins anywhere balance each other.
#[test]
fn an_initial_state_that_an_offset_balances_has_no_interval() {
    let tank =
        "[model]\nname = \"tank\"\n[parameters]\nflow = 0.3\n[states]\nx = { der = \"flow\" }\n";
    let problem = "[system.m]\nmodel = \"tank.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\noffset = \"o\"\n\
                   [parameters]\n\"m.flow\" = {}\no = { start = 0.2 }\n[initial]\n\"m.x\" = \"free\"\n";
    let fit = fitted(&[("tank.toml", tank)], problem, 2, |t| 1.0 + 0.4 * t);
    assert_eq!(parameter(&fit, "o").1.class, Class::Flat);
    assert_eq!(parameter(&fit, "m.flow").1.class, Class::Finite);
    for run in &fit.uncertainty.as_ref().unwrap().initial[0] {
        assert_eq!(run.unwrap().class, Class::Flat);
    }
}

/// Two sticks of a vehicle whose axes disturb each other: each loop has the figures that it has with the other one closed.
/// With `ż₁ = s₁ - c z₂`, `ż₂ = s₂ + d z₁` and gains k, b that is `L₁ = k (s + b)/(s (s + b) + c d)`.
#[test]
fn loops_of_two_sticks_are_cut_one_at_a_time() {
    let pilot = "[model]\nname = \"pilot\"\n[inputs]\ntarget = 1\np1 = 0\np2 = 0\n[parameters]\nk = 0.5\nb = 0.8\n\
                 [outputs]\nstick = \"k * (target - p1)\"\nstick2 = \"-b * p2\"\n";
    let vehicle = "[model]\nname = \"vehicle\"\n[inputs]\nstick = 0\nstick2 = 0\n[states]\n\
                   z1 = { der = \"stick - 0.5 * z2\" }\nz2 = { der = \"stick2 + 0.6 * z1\" }\n";
    let files = [("pilot.toml", pilot), ("vehicle.toml", vehicle)];
    let problem = "[system.pilot]\nmodel = \"pilot.toml\"\n[system.vehicle]\nmodel = \"vehicle.toml\"\n[connect]\n\
                   \"pilot.stick\" = \"vehicle.stick\"\n\"pilot.stick2\" = \"vehicle.stick2\"\n\
                   \"vehicle.z1\" = \"pilot.p1\"\n\"vehicle.z2\" = \"pilot.p2\"\n\
                   [[measured]]\nsignal = \"vehicle.z1\"\ncolumn = \"x\"\n[parameters]\n\"pilot.k\" = {}\n";
    let fit = fitted(&files, problem, 2, |t| 0.6 * (1.0 - (-0.9 * t).exp()));
    let (k, of_k) = parameter(&fit, "pilot.k");
    let (b, e) = (0.8, 0.3);
    let (w, own) = derived(&fit, "crossover_frequency(pilot.stick)");
    let (above, below) = (w * w + b * b, (e - w * w).powi(2) + (w * b).powi(2));
    assert_near(k * k * above, below, 1e-9);
    let slope = 2.0 * k * above / (4.0 * w * (w * w - e) + 2.0 * w * b * b - 2.0 * w * k * k);
    assert_near(own.sd, slope.abs() * of_k.sd, 1e-5);
    let phase = w.atan2(b) - (w * b).atan2(e - w * w);
    let (margin, _) = derived(&fit, "phase_margin(pilot.stick)");
    assert_near(margin, 180.0 + phase.to_degrees(), 1e-9);
    // Of the second loop, in the same way with k and b in each other's place.
    let (w, own) = derived(&fit, "crossover_frequency(pilot.stick2)");
    let (above, below) = (w * w + k * k, (e - w * w).powi(2) + (w * k).powi(2));
    assert_near(b * b * above, below, 1e-9);
    let slope = (2.0 * k * b * b - 2.0 * w * w * k)
        / (4.0 * w * (w * w - e) + 2.0 * w * k * k - 2.0 * w * b * b);
    assert_near(own.sd, slope.abs() * of_k.sd, 1e-5);
    // The poles are those of both, once: s² + (k + b) s + k b + e.
    let poles: Vec<&str> = fit.derived.iter().map(|own| own.name.as_str()).collect();
    let poles: Vec<&&str> = poles.iter().filter(|own| own.starts_with("pole")).collect();
    assert_eq!(poles, [&"pole1_re", &"pole1_im"]);
    assert_near(derived(&fit, "pole1_re").0, -0.5 * (k + b), 1e-9);
}

/// A stability augmentation inside, `u = s - c v`, stays closed: the pilot's loop is `k/(s (s + c))`, whatever wire comes
/// first.
#[test]
fn an_inner_loop_stays_closed() {
    let pilot = "[model]\nname = \"pilot\"\n[inputs]\ntarget = 1\np = 0\n[parameters]\nk = 0.5\n[outputs]\n\
                 stick = \"k * (target - p)\"\n";
    let sas = "[model]\nname = \"sas\"\n[inputs]\ns = 0\nv = 0\n[outputs]\nu = \"s - 1.5 * v\"\n";
    let vehicle = "[model]\nname = \"vehicle\"\n[inputs]\nu = 0\n[states]\nz = { der = \"v\" }\nv = { der = \"u\" }\n";
    let files = [
        ("pilot.toml", pilot),
        ("sas.toml", sas),
        ("vehicle.toml", vehicle),
    ];
    let problem = "[system.pilot]\nmodel = \"pilot.toml\"\n[system.sas]\nmodel = \"sas.toml\"\n[system.vehicle]\n\
                   model = \"vehicle.toml\"\n[connect]\n\"sas.u\" = \"vehicle.u\"\n\"vehicle.v\" = \"sas.v\"\n\
                   \"pilot.stick\" = \"sas.s\"\n\"vehicle.z\" = \"pilot.p\"\n[inputs]\n\"pilot.target\" = \"x\"\n\
                   [[measured]]\nsignal = \"vehicle.z\"\ncolumn = \"x\"\n[parameters]\n\"pilot.k\" = {}\n";
    let fit = fitted(&files, problem, 2, |t| 1.0 - (-0.6 * t).exp());
    assert_eq!(fit.cuts, ["pilot.stick"]);
    let (k, _) = parameter(&fit, "pilot.k");
    let (w, _) = derived(&fit, "crossover_frequency");
    assert_near(w * w * (w * w + 2.25), k * k, 1e-9);
    let margin = 90.0 - w.atan2(1.5).to_degrees();
    assert_near(derived(&fit, "phase_margin").0, margin, 1e-9);
}

/// A pilot with a lag, who sees the error and feels the rate: `gain/(1 + lag s)` and `-feel/(1 + lag s)`, whatever the vehicle
/// does and in whatever unit it says so.
#[test]
fn a_pilot_has_a_response_to_what_it_sees_and_one_to_what_it_feels() {
    let pilot = "[model]\nname = \"pilot\"\n[inputs]\ntarget = { start = 1, unit = \"m\" }\nposition = { unit = \"m\" }\n\
                 rate = { unit = \"m/s\" }\n[parameters]\ngain = { start = 0.5, unit = \"1/m\" }\nfeel = { start = 0.4, unit = \"s/m\" }\n\
                 lag = { start = 0.25, unit = \"s\" }\n[states]\narm = { der = \"(gain * (target - position) - feel * rate - arm) / lag\", unit = \"1\" }\n\
                 [outputs]\nstick = { value = \"arm\", unit = \"1\" }\n";
    let vehicle = "[model]\nname = \"vehicle\"\n[inputs]\nstick = { unit = \"1\" }\n[parameters]\npower = { start = 200, unit = \"cm/s2\" }\ndrag = { start = 0.01, unit = \"s/cm2\" }\n[states]\n\
                   z = { der = \"v\", unit = \"cm\" }\nv = { der = \"power * stick - drag * v * v * v\", unit = \"cm/s\" }\n";
    let files = [("pilot.toml", pilot), ("vehicle.toml", vehicle)];
    let problem = "[system.pilot]\nmodel = \"pilot.toml\"\n[system.vehicle]\nmodel = \"vehicle.toml\"\n[connect]\n\
                   \"pilot.stick\" = \"vehicle.stick\"\n\"vehicle.z\" = \"pilot.position\"\n\"vehicle.v\" = \"pilot.rate\"\n\
                   [inputs]\n\"pilot.target\" = \"x\"\n\
                   [[measured]]\nsignal = \"vehicle.z\"\ncolumn = \"x\"\n[parameters]\n\"pilot.gain\" = {}\n";
    let x = |t: f64| 1.0 - (-1.2 * t).exp();
    looked_at(&files, problem, 1, x, |posed, fit| {
        let paths = PilotPaths::new(posed, fit.solved.as_deref().unwrap()).unwrap();
        let expected = [
            ["pilot.target − pilot.position", "pilot.stick"],
            ["pilot.rate", "pilot.stick"],
        ];
        assert_eq!(paths.ends(), expected);
        for gain in [parameter(&fit, "pilot.gain").0, 3.0] {
            let found = paths.with(&[gain]).unwrap();
            for omega in [0.1, 1.0, 30.0] {
                let arm = 1.0 / Complex::new(1.0, 0.25 * omega);
                for (own, expected) in found.iter().zip([gain * arm, -0.4 * arm]) {
                    assert!((own(omega) - expected).norm() < 1e-12 * expected.norm());
                }
            }
        }
    });
}

/// With a gain of its own for each run the figures are those of the first, as sure as its gain is.
#[test]
fn a_loop_with_a_gain_for_each_run_is_that_of_the_first() {
    let files = [("pilot.toml", PILOT), ("vehicle.toml", VEHICLE)];
    let problem = format!("{LOOP}[parameters]\n\"pilot.gain\" = {{ per = \"run\" }}\n");
    let fit = fitted(&files, &problem, 2, |t| 1.0 - (-1.2 * t).exp());
    let (gain, of_gain) = parameter(&fit, "pilot.gain");
    let (found, own) = derived(&fit, "crossover_frequency");
    assert_near(found, 2.0 * gain, 1e-9);
    assert_near(own.sd, 2.0 * of_gain.sd, 1e-6);
}

#[test]
fn names_of_derived_quantities_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("decay.toml"), DECAY).unwrap();
    std::fs::write(folder.path().join("run.csv"), "time,x\n0,2\n1,1\n2,0.5\n").unwrap();
    for (line, expected) in [
        ("pi = \"m.rate\"", "`pi` cannot be a name"),
        ("k = \"m.rat\"", "m.rat"),
        ("k = \"m.x\"", "a derived quantity"),
        ("own = \"m.rate\"", "`own` is a parameter"),
    ] {
        let text = format!(
            "[system.m]\nmodel = \"decay.toml\"\n{MEASURED}[parameters]\n\"m.rate\" = {{}}\nown = {{ start = 1, fixed = true }}\n\
             [derived]\n{line}\n[[run]]\nfile = \"run.csv\"\n"
        );
        let file = ProblemFile::parse(&text, &folder.path().join("problem.toml"));
        let posed = file.and_then(|file| Posed::new(&file, &part::open).map(|_| ()));
        let error = posed.unwrap_err().to_string();
        assert!(
            error.contains(expected) && error.contains("problem.toml:10"),
            "{line}: {error}"
        );
    }
}
