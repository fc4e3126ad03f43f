//! `pilotage linearize` and what it stands on: against the exact Jacobian of the joint equations, against
//! transfer functions multiplied out, and against NumPy.

use crate::command::{CONNECTIONS, Ended, Folder};
use crate::foreign;
use crate::joint_ode::Joint;
use num_dual::Dual64;
use pilotage::cosim::component::{ComponentError, Linear};
use pilotage::cosim::{
    Algorithm, Clock, Component, Ending, Linearization, NativeComponent, Progress, Role,
    SeriesRecorder, System, ValueKind, Variable, linearize,
};
use pilotage::linear::StateSpace;
use pilotage::models::{Model, Pilot, Quadcopter};
use serde_json::{Value, json};
use std::io::{Cursor, Read};

/// A pilot who brings the vehicle to its target.
const THETA: [f64; 6] = [0.3, 1.2, 1.0, -0.006, -0.03, -0.04];
pub const LOOP: [&str; 2] = ["--loop", "pilot.stick=quadcopter.stick"];

/// A state off the trim, where the vehicle is not what it is at hover: pilot, then vehicle.
const PILOT: [(&str, f64); 3] = [("x1", 3.0), ("x2", -2.0), ("x3", 1.5)];
const VEHICLE: [(&str, f64); 6] = [
    ("z", 2.0),
    ("phi", 0.3),
    ("v", -1.0),
    ("q", 0.2),
    ("omega_f", 0.02),
    ("omega_b", -0.03),
];

/// The start values as `instance.variable=value`.
fn starts() -> Vec<String> {
    let pilot = PILOT
        .iter()
        .map(|(name, value)| format!("pilot.{name}_start={value}"));
    let vehicle = VEHICLE.iter();
    let vehicle = vehicle.map(|(name, value)| format!("quadcopter.{name}_start={value}"));
    pilot.chain(vehicle).collect()
}

fn native() -> Linearization {
    let mut system = System::new();
    for (name, model) in [
        ("pilot", Model::pilot(&THETA, 1.0)),
        ("quadcopter", Model::quadcopter(&Quadcopter::default())),
    ] {
        system
            .add(name, Box::new(NativeComponent::new(model)))
            .unwrap();
    }
    system.connect("pilot.stick", "quadcopter.stick").unwrap();
    system.connect("quadcopter.z", "pilot.position").unwrap();
    for start in starts() {
        let (name, value) = start.split_once('=').unwrap();
        system.set(name, value).unwrap();
    }
    let clock = Clock::standing(0.0, 1.0).unwrap();
    let recorder = &mut SeriesRecorder::default();
    let (_, found) = linearize(system, &clock, None, Algorithm::Jacobi, recorder).unwrap();
    found.unwrap()
}

/// The Jacobian of the joint equations, by dual numbers, by the names of states.
fn jacobian() -> (Vec<String>, Vec<Vec<f64>>) {
    let joint = Joint {
        vehicle: Quadcopter::default(),
        pilot: Pilot::default(),
    };
    let vehicle = VEHICLE
        .iter()
        .map(|(name, value)| (format!("quadcopter.{name}"), *value));
    let pilot = PILOT
        .iter()
        .map(|(name, value)| (format!("pilot.{name}"), *value));
    let (names, at): (Vec<String>, Vec<f64>) = vehicle.chain(pilot).unzip();
    let n = at.len();
    let theta = THETA.map(Dual64::from);
    let columns: Vec<Vec<f64>> = (0..n)
        .map(|j| {
            let mut x: Vec<Dual64> = at.iter().map(|&value| value.into()).collect();
            x[j].eps = 1.0;
            let mut dx = vec![Dual64::from(0.0); n];
            joint.derivative(&x, &[0.0.into()], &theta, &mut dx);
            dx.iter().map(|dual| dual.eps).collect()
        })
        .collect();
    let rows = (0..n).map(|i| columns.iter().map(|column| column[i]).collect());
    (names, rows.collect())
}

/// Largest difference between a linearization's `A` and the joint Jacobian, relative to each entry or 1.
fn distance(states: &[String], a: impl Fn(usize, usize) -> f64) -> f64 {
    let (names, expected) = jacobian();
    assert_eq!(states.len(), names.len());
    let at = |name: &String| states.iter().position(|state| state == name).unwrap();
    let mut largest = 0.0f64;
    for (i, row) in names.iter().enumerate() {
        for (j, column) in names.iter().enumerate() {
            let difference = (a(at(row), at(column)) - expected[i][j]).abs();
            largest = largest.max(difference / expected[i][j].abs().max(1.0));
        }
    }
    largest
}

#[test]
fn the_coupled_matrix_is_the_jacobian_of_the_joint_equations() {
    let coupled = native().coupled().unwrap();
    let found = distance(&coupled.states, |i, j| coupled.a[(i, j)]);
    assert!(found < 1e-12, "{found}");
    assert_eq!(coupled.inputs, ["pilot.target"]);
    // Far from hover, so that this says something.
    let (_, expected) = jacobian();
    assert!((expected[2][1] + 9.80665).abs() > 0.3, "{expected:?}");
}

/// `P(s) V(s)` of pilot and vehicle at hover, from their transfer functions (module docs of the pilot;
/// docs/method.md for the pitch loop).
fn transfer(omega: f64) -> nalgebra::Complex<f64> {
    let s = nalgebra::Complex::new(0.0, omega);
    let polynomial = |c: &[f64]| {
        c.iter()
            .rev()
            .fold(nalgebra::Complex::from(0.0), |p, c| p * s + c)
    };
    let [t1, t2, t3, t4, t5, t6] = THETA;
    let pilot = polynomial(&[t4, t5, t6]) / polynomial(&[t1, t2, t3, 1.0]);
    let vehicle = Quadcopter::default();
    let [c0, c1, c2] = vehicle.pitch_polynomial();
    let pitch = vehicle.max_pitch * c0 / polynomial(&[c0, c1, c2, 1.0]);
    pilot * pitch * -vehicle.gravity / (s * s)
}

#[test]
fn the_margins_are_those_of_the_transfer_functions() {
    let folder = folder_with_models();
    let ended = run(&folder, "toml", &[&LOOP[..], &["--json"]].concat());
    let json = ended.json();
    let looped = &json["loops"][0];
    let number = |value: &Value| value.as_f64().unwrap();
    let crossing = &looped["gainCrossings"][0];
    let omega = number(&crossing["frequency"]);
    let value = transfer(omega);
    assert!((value.norm() - 1.0).abs() < 1e-9, "{value}");
    let margin = (-value).arg();
    assert!((number(&crossing["phaseMargin"]) - margin).abs() < 1e-9);
    assert!((number(&crossing["delayMargin"]) - margin / omega).abs() < 1e-9);
    let delay = (std::f64::consts::FRAC_PI_2 - margin) / omega;
    assert!((number(&crossing["effectiveDelay"]) - delay).abs() < 1e-9);
    let crossing = &looped["phaseCrossings"][0];
    let value = transfer(number(&crossing["frequency"]));
    assert!(value.im.abs() < 1e-9 && value.re < 0.0, "{value}");
    assert!((number(&crossing["gainMargin"]) * value.norm() - 1.0).abs() < 1e-9);
    // Each point of the response, and what is drawn of it.
    let response = &looped["response"];
    let list = |name: &str| -> Vec<f64> { serde_json::from_value(response[name].clone()).unwrap() };
    let (frequency, gain, phase) = (list("frequency"), list("gain"), list("phase"));
    assert!(frequency.len() > 500);
    for ((omega, gain), phase) in frequency.iter().zip(gain).zip(phase) {
        let expected = transfer(*omega);
        let found = nalgebra::Complex::from_polar(gain, phase);
        assert!(
            (found - expected).norm() < 1e-6 * expected.norm(),
            "{omega}: {found} {expected}"
        );
    }
    assert_eq!(looped["lowFrequencyPower"], -2);
}

pub fn folder_with_models() -> Folder {
    let folder = Folder::new();
    folder.write(
        "quadcopter.toml",
        folder.pilotage(&["vehicle", "show"]).stdout,
    );
    let theta = THETA.iter().zip(1..);
    let theta: String = theta
        .map(|(value, i)| format!("theta{i} = {value}\n"))
        .collect();
    folder.write("pilot.toml", format!("[theta]\n{theta}"));
    folder
}

pub fn run(folder: &Folder, ending: &str, more: &[&str]) -> Ended {
    let files = ["pilot", "quadcopter"].map(|name| format!("{name}.{ending}"));
    let files = ["linearize", &files[0], &files[1]];
    let ended = folder.pilotage(&[&files[..], &CONNECTIONS, more].concat());
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    ended
}

/// A component whose equations have no derivative where it stands.
struct Kink(Vec<Variable>, f64);

impl Component for Kink {
    fn variables(&self) -> &[Variable] {
        &self.0
    }

    fn set_reals(&mut self, _handles: &[u32], _values: &[f64]) -> Result<(), ComponentError> {
        Ok(())
    }

    fn get_reals(&mut self, _handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        values.fill(0.0);
        Ok(())
    }

    fn step(&mut self, _t: f64, _h: f64) -> Result<Progress, ComponentError> {
        Ok(Progress::Done)
    }

    fn linearize(&mut self, _step: f64) -> Result<Linear, ComponentError> {
        let names = [
            vec!["x".to_owned()],
            vec!["u".to_owned()],
            vec!["y".to_owned()],
        ];
        let columns = [[-1.0, 1.0], [self.1, 0.0]];
        let system =
            StateSpace::from_columns(names, |k| Ok::<_, ComponentError>(columns[k].to_vec()))?;
        Ok(system.into())
    }
}

/// It is named, instead of handed on to what does not end on it or calls it stable.
#[test]
fn a_derivative_that_is_no_number_is_named() {
    let mut system = System::new();
    let variables = vec![
        Variable::new("u", 0, ValueKind::Real, Role::Input),
        Variable::new("y", 1, ValueKind::Real, Role::Output),
    ];
    system
        .add("kink", Box::new(Kink(variables, f64::NAN)))
        .unwrap();
    let clock = Clock::standing(0.0, 1.0).unwrap();
    let recorder = &mut SeriesRecorder::default();
    let (run, found) = linearize(system, &clock, None, Algorithm::Jacobi, recorder).unwrap();
    assert!(found.is_none());
    let Ending::Failed {
        instance, source, ..
    } = run.ending
    else {
        panic!("{:?}", run.ending)
    };
    assert_eq!(instance, "kink");
    assert_eq!(
        source.to_string(),
        "the derivative of the rate of `x` with respect to `u` is NaN where it stands; linearise it where the \
         model is smooth: at another time, or with other start values or parameters"
    );
}

/// A discrete real counts as constant, and is no place to cut a loop.
#[test]
fn a_discrete_connection_is_named() {
    let mut system = System::new();
    let mut variables = vec![
        Variable::new("u", 0, ValueKind::Real, Role::Input),
        Variable::new("y", 1, ValueKind::Real, Role::Output),
    ];
    system
        .add("plant", Box::new(Kink(variables.clone(), 1.0)))
        .unwrap();
    variables[1].is_discrete = true;
    system
        .add("sampler", Box::new(Kink(variables, 1.0)))
        .unwrap();
    system.connect("sampler.y", "plant.u").unwrap();
    system.connect("plant.y", "sampler.u").unwrap();
    let clock = Clock::standing(0.0, 1.0).unwrap();
    let recorder = &mut SeriesRecorder::default();
    let (_, found) = linearize(system, &clock, None, Algorithm::Jacobi, recorder).unwrap();
    let found = found.unwrap();
    assert_eq!(found.constant, ["sampler.y=plant.u"]);
    assert_eq!(found.wires.len(), 1);
    let error = found.wire("sampler.y", "plant.u").unwrap_err();
    let begin = "the connection `sampler.y=plant.u` changes at events alone";
    assert!(error.to_string().starts_with(begin), "{error}");
}

/// Exported FMUs of both versions, for co-simulation and model exchange, at the same point: by directional
/// derivatives, and by differences where the description offers none.
#[test]
fn fmus_of_every_kind_give_the_same_matrices() {
    let folder = folder_with_models();
    let starts = starts();
    let set: Vec<&str> = starts
        .iter()
        .flat_map(|start| ["--set", start.as_str()])
        .collect();
    for version in ["2", "3"] {
        for name in ["pilot", "quadcopter"] {
            let (file, fmu) = (format!("{name}.toml"), format!("{name}.fmu"));
            let ended = folder.pilotage(&["export", name, &file, "--fmi", version, "-o", &fmu]);
            assert_eq!(ended.code, 0, "{ended:?}");
        }
        for (kind, tolerance) in [("cs", 1e-12), ("me", 1e-12)] {
            let json = run(
                &folder,
                "fmu",
                &[&set[..], &["--kind", kind, "--json"]].concat(),
            )
            .json();
            let found = distance_of(&json);
            assert!(found < tolerance, "FMI {version} {kind}: {found}");
        }
        for name in ["pilot", "quadcopter"] {
            let fmu = std::fs::read(folder.path(&format!("{name}.fmu"))).unwrap();
            folder.write(&format!("{name}.fmu"), without_derivatives(&fmu));
        }
        let json = run(
            &folder,
            "fmu",
            &[&set[..], &["--kind", "me", "--json"]].concat(),
        )
        .json();
        let found = distance_of(&json);
        assert!(
            found < 1e-7 && found > 0.0,
            "FMI {version} by differences: {found}"
        );
    }
    let pilot = std::fs::read(folder.path("pilot.fmu")).unwrap();
    let without = changed(
        &pilot,
        &[
            ("canGetAndSetFMUState=\"true\"", ""),
            ("canSerializeFMUState=\"true\"", ""),
        ],
    );
    folder.write("pilot.fmu", without);
    let files = ["linearize", "pilot.fmu", "quadcopter.fmu"];
    let ended = folder.pilotage(&[&files[..], &CONNECTIONS, &["--kind", "cs"]].concat());
    assert_eq!(ended.code, 1);
    assert_eq!(
        ended.stderr,
        "error: `pilot` failed to be linearised at 0 s: it is for co-simulation, gives no directional \
         derivatives and cannot go back to a saved state, so that nothing can be found of its states; take it \
         for model exchange (--kind me), if it can be\n"
    );
}

/// Co-simulation FMUs of which nothing is known but how they respond: poles of the closed loop, margins and
/// frequency response of the open one are those of the exact equations.
#[test]
fn fmus_without_derivatives_are_found_by_their_responses() {
    let folder = folder_with_models();
    let more = [
        "--json",
        "--step",
        "0.02",
        "--loop",
        "pilot.stick=quadcopter.stick",
    ];
    let exact = run(&folder, "toml", &more).json();
    for version in ["2", "3"] {
        for name in ["pilot", "quadcopter"] {
            let (file, path) = (format!("{name}.toml"), format!("{name}.fmu"));
            let ended = folder.pilotage(&["export", name, &file, "--fmi", version, "-o", &path]);
            assert_eq!(ended.code, 0, "{ended:?}");
            let fmu = std::fs::read(folder.path(&path)).unwrap();
            folder.write(&path, without_derivatives(&fmu));
        }
        let found = run(&folder, "fmu", &more).json();
        for name in ["pilot", "quadcopter"] {
            let begin = format!("`{name}` gives no derivatives: found by its responses");
            let notes = found["notes"].as_array().unwrap();
            assert!(
                notes
                    .iter()
                    .any(|note| note.as_str().unwrap().starts_with(&begin))
            );
        }
        let poles = |json: &Value| -> Vec<[f64; 2]> {
            let modes = json["poles"].as_array().unwrap().iter();
            modes
                .map(|m| ["real", "imaginary"].map(|part| m[part].as_f64().unwrap()))
                .collect()
        };
        let (found_poles, mut exact_poles) = (poles(&found), poles(&exact));
        // Both rotors faster or slower alike: the stick does not do that, nor does anything show it.
        exact_poles.retain(|pole| (pole[0] + 14.48).abs() > 1e-9);
        assert_eq!(
            found_poles.len(),
            exact_poles.len(),
            "{found_poles:?} {exact_poles:?}"
        );
        for (found, exact) in found_poles.iter().zip(&exact_poles) {
            let error = (found[0] - exact[0]).hypot(found[1] - exact[1]);
            assert!(
                error < 1e-6 * exact[0].hypot(exact[1]).max(1.0),
                "{found:?} {exact:?}"
            );
        }
        let crossing = |json: &Value| {
            let first = &json["loops"][0]["gainCrossings"][0];
            ["frequency", "phaseMargin"].map(|name| first[name].as_f64().unwrap())
        };
        for (found, exact) in crossing(&found).iter().zip(crossing(&exact)) {
            assert!((found / exact - 1.0).abs() < 1e-6, "{found} {exact}");
        }
    }
}

fn distance_of(json: &Value) -> f64 {
    let states: Vec<String> = serde_json::from_value(json["states"].clone()).unwrap();
    let a: Vec<Vec<f64>> = serde_json::from_value(json["A"].clone()).unwrap();
    distance(&states, |i, j| a[i][j])
}

/// The FMU with a description that offers no directional derivatives.
fn without_derivatives(fmu: &[u8]) -> Vec<u8> {
    let flags = [
        "providesDirectionalDerivative=\"true\"",
        "providesDirectionalDerivatives=\"true\"",
    ];
    changed(fmu, &flags.map(|flag| (flag, "")))
}

/// The FMU with texts of its description replaced.
fn changed(fmu: &[u8], replaced: &[(&str, &str)]) -> Vec<u8> {
    let mut archive = zip::ZipArchive::new(Cursor::new(fmu)).unwrap();
    let mut files = Vec::new();
    for i in 0..archive.len() {
        let mut file = archive.by_index(i).unwrap();
        let (name, mut content) = (file.name().unwrap().into_owned(), Vec::new());
        file.read_to_end(&mut content).unwrap();
        if name == "modelDescription.xml" {
            let text = String::from_utf8(content).unwrap();
            let replace = |text: String, (old, new): &(&str, &str)| text.replace(old, new);
            content = replaced.iter().fold(text, replace).into_bytes();
        }
        files.push((name, content));
    }
    let files: Vec<(&str, &[u8])> = (files.iter())
        .map(|(name, content)| (name.as_str(), content.as_slice()))
        .collect();
    foreign::archive(&files)
}

#[test]
fn what_is_printed() {
    let folder = folder_with_models();
    let ended = run(&folder, "toml", &LOOP);
    let text: Vec<&str> = ended.stdout.lines().collect();
    insta::assert_snapshot!(text.join("\n"), @"
    linear at 0 s; states 9, inputs 1, outputs 8

    poles of the closed loop
      pole [1/s]            frequency [rad/s]  damping
      -0.341                            0.341    1.000
      -0.065 ± 0.511 i                  0.515    0.126
      -0.286 ± 0.659 i                  0.718    0.398
      -4.222 ± 3.166 i                  5.277    0.800
      -5.992                            5.992    1.000
      -14.480                          14.480    1.000

    loop at pilot.stick=quadcopter.stick
      gain at 0.00303 rad/s  16729, going as ω^-2
      gain 1 at          0.4979 rad/s: phase margin 7.6 deg, delay margin 0.266 s, effective delay 2.89 s
      phase -180° at     0.6279 rad/s: gain margin 1.253 (2.0 dB)

    STABLE: every pole is left of the imaginary axis; the slowest fades with a time constant of 15.4 s
    ");
    let ended = run(&folder, "toml", &["--matrices"]);
    let text: Vec<&str> = ended.stdout.lines().take(4).collect();
    assert_eq!(text[1], "");
    assert!(
        text[2].starts_with("A, columns pilot.x1, pilot.x2"),
        "{text:?}"
    );
}

/// A gain margin of 1.253: with 1.3 times the gain the loop is unstable, and so it is where a co-simulation
/// holds the values for 0.5 s. The exit code says so, and the last line.
#[test]
fn an_unstable_loop_is_no_success() {
    let folder = folder_with_models();
    let gain = |factor: f64| {
        let theta = THETA.iter().zip(1..).map(|(value, i)| {
            let factor = if i > 3 { factor } else { 1.0 };
            format!("theta{i} = {}\n", value * factor)
        });
        format!("[theta]\n{}", theta.collect::<String>())
    };
    for (factor, more, code, word, last) in [
        (1.2, &[][..], 0, "stable", "STABLE: every pole is left of"),
        (1.3, &[], 1, "unstable", "UNSTABLE: 2 poles are right of"),
        (
            1.0,
            &["--in-steps", "0.5"],
            1,
            "stable",
            "UNSTABLE, in steps of 0.5 s: 2 poles are",
        ),
    ] {
        folder.write("pilot.toml", gain(factor));
        let files = ["linearize", "pilot.toml", "quadcopter.toml"];
        let run = |form: &[&str]| folder.pilotage(&[&files[..], &CONNECTIONS, more, form].concat());
        let ended = run(&[]);
        assert_eq!((ended.code, ended.stderr.as_str()), (code, ""));
        let line = ended.stdout.lines().last().unwrap();
        assert!(line.starts_with(last), "{line}");
        assert_eq!(run(&["--json"]).json()["stability"], word);
    }
    // The vehicle alone integrates twice: it is on the border, which is no failure.
    let ended = folder.pilotage(&["linearize", "quadcopter.toml"]);
    let line = ended.stdout.lines().last().unwrap();
    assert!(line.starts_with("ON THE BORDER: 2 poles are on"), "{line}");
    assert_eq!(ended.code, 0);
}

/// Poles, warning, command, files, version and date; the crossover marked, and the range about it.
#[test]
fn the_page_of_a_loop_tells_all() {
    let folder = folder_with_models();
    let more = ["--in-steps", "0.5", "--report", "loop.html"];
    let files = ["linearize", "pilot.toml", "quadcopter.toml"];
    let arguments = [&files[..], &CONNECTIONS, &LOOP, &more].concat();
    let epoch = [("SOURCE_DATE_EPOCH", "1709251199")];
    let ended = folder.pilotage_with(&arguments, &epoch);
    assert_eq!(ended.code, 1, "{ended:?}");
    let page = folder.read("loop.html");
    let version = env!("CARGO_PKG_VERSION");
    let made = format!("pilotage {version}, 2024-02-29 23:59 UTC");
    for part in [
        "<p class=\"verdict bad\">unstable</p>",
        "<p class=\"warning\">UNSTABLE, in steps of 0.5 s: 2 poles are",
        "<p>STABLE: every pole",
        "<h2>Poles of the closed loop</h2>",
        "<h2>Poles of the closed loop, in steps of 0.5 s</h2>",
        "<td>quadcopter.toml</td><td><code>",
        &made,
        "<code>pilotage linearize pilot.toml quadcopter.toml --connect pilot.stick=quadcopter.stick",
        // The crossover, in Bode and Nyquist plot.
        "\"words\":[\"0.498 rad/s\"]",
    ] {
        assert!(page.contains(part), "{part}");
    }
    let figures = pilotage::report::read::figures(&page);
    let names: Vec<&str> = figures.iter().map(|figure| figure.name.as_str()).collect();
    assert_eq!(names, ["bode", "nyquist"]);
    // A crossover at 0.5 rad/s: what is drawn is some decades about it, whatever the range of the response.
    let frequencies = &figures[0].panels[0].series[0].x;
    assert!(frequencies[0] > 0.01 && frequencies[frequencies.len() - 1] < 100.0);
}

/// FMU and model file mix, and what a table feeds is an input from outside, at the value that it has there.
#[test]
fn mixed_components_and_a_table() {
    let folder = folder_with_models();
    let ended = folder.pilotage(&["export", "pilot", "pilot.toml"]);
    assert_eq!(ended.code, 0);
    folder.write("course.csv", "time,pilot.target\n0,0\n1,10\n");
    let files = [
        "linearize",
        "pilot.fmu",
        "quadcopter.toml",
        "--input",
        "course.csv",
    ];
    let at = ["--at", "2", "--step", "0.01", "--json"];
    let ended = folder.pilotage(&[&files[..], &CONNECTIONS, &at].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    assert_eq!(
        ended.stderr,
        "note: course.csv ends at 1 s; from then on its last values are held\n"
    );
    let json = ended.json();
    assert_eq!(json["inputs"], json!(["pilot.target"]));
    assert_eq!(json["outputs"].as_array().unwrap().len(), 8);
    // The vehicle has been moved, so that its third derivative of position is that of another attitude.
    let (v, phi) = (5, 4);
    assert_eq!(json["states"][v], "quadcopter.v");
    let moved = json["A"][v][phi].as_f64().unwrap();
    assert!((moved + 9.80665).abs() > 0.01, "{moved}");
}

#[test]
fn questions_without_an_answer() {
    let folder = folder_with_models();
    for (more, message) in [
        (
            vec!["--loop", "pilot.stik=quadcopter.stick"],
            "error: there is no connection `pilot.stik=quadcopter.stick`; did you mean \
             `pilot.stick=quadcopter.stick`?\n",
        ),
        (
            vec!["--at", "1"],
            "error: --step is missing, to come to 1 s\n",
        ),
        (
            vec!["--at", "1", "--step", "0.3"],
            "error: 1 s are 3.33333333 steps of 0.3 s, expected a whole number: stop at 0.9 s or 1.2 s, or \
             change the step\n",
        ),
    ] {
        let files = ["linearize", "pilot.toml", "quadcopter.toml"];
        let ended = folder.pilotage(&[&files[..], &CONNECTIONS, &more].concat());
        assert_eq!((ended.code, ended.stderr.as_str()), (2, message));
    }
    let chain = ["linearize", "pilot.toml", "quadcopter.toml"];
    let ended = folder.pilotage(&[&chain[..], &CONNECTIONS[..2], &LOOP].concat());
    assert_eq!(
        (ended.code, ended.stderr.as_str()),
        (
            2,
            "error: the connection `pilot.stick=quadcopter.stick` is in no loop: what goes in there does \
             not come back\n"
        )
    );
    assert_eq!(
        json!(folder.files()),
        json!(["pilot.toml", "quadcopter.toml"])
    );
}
