//! Describing functions of the synthetic human's flights after sines: beside that human, beside what is fitted, and what
//! a fit says where they differ.

use crate::command::{Folder, example};
use nalgebra::Complex;
use serde_json::{Value, json};

/// Three flights of a minute, all of the same human.
const SYNTH: &str =
    "trials synth --target sines --runs 3 --duration 60 --bandwidth 0.8 --variation 0 -o sines";
pub const RUNS: [&str; 3] = ["sines/run1.csv", "sines/run2.csv", "sines/run3.csv"];

/// A problem with the human's own structure; delay and stick are told.
pub const PROBLEM: &str = r#"
[system.pilot]
model = "extended_crossover"
[system.vehicle]
model = "quadcopter"
[connect]
"pilot.stick" = "vehicle.stick"
"vehicle.z" = "pilot.position"
[inputs]
"pilot.target" = { column = "target", hold = "linear" }
[[measured]]
signal = "vehicle.z"
column = "position"
sd = 0.1
[[measured]]
signal = "vehicle.stick"
column = "stick"
sd = 0.02
[parameters]
"pilot.gain" = { start = -0.02 }
"pilot.lead" = { start = 2 }
"pilot.delay" = { start = DELAY }
"pilot.omega_nm" = { start = 10, fixed = true }
"pilot.zeta_nm" = { start = 0.7, fixed = true }
[[run]]
file = "sines/run1.csv"
[[run]]
file = "sines/run2.csv"
[[run]]
file = "sines/run3.csv"
[fit]
starts = 2
mesh = "samples"
"#;

pub fn flown() -> Folder {
    let folder = Folder::new();
    let words: Vec<&str> = SYNTH.split(' ').collect();
    let ended = folder.pilotage(&words);
    assert_eq!(ended.code, 0, "{ended:?}");
    folder
}

/// A fit of these; it may doubt, but has an answer.
fn fitted(folder: &Folder, what: &[&str]) -> Value {
    let flags = ["--json", "--force", "--report", "fit.html"];
    let ended = folder.pilotage(&[&["fit"], what, &flags].concat());
    assert_eq!(ended.code, 0, "{ended:?}");
    ended.json()
}

fn problem(folder: &Folder, delay: &str) -> Value {
    folder.write("problem.toml", PROBLEM.replace("DELAY", delay));
    fitted(folder, &["problem.toml", "-o", "model.toml"])
}

fn codes(fit: &Value) -> Vec<&str> {
    let doubts = fit["doubts"].as_array().unwrap().iter();
    doubts.map(|own| own["code"].as_str().unwrap()).collect()
}

fn numbers(list: &Value) -> Vec<f64> {
    let list = list.as_array().unwrap().iter();
    list.map(|own| own.as_f64().unwrap()).collect()
}

/// The default human of `trials synth`: forward is negative.
fn human(omega: f64) -> Complex<f64> {
    let s = Complex::new(0.0, omega);
    let arm = s * s + s * 14.0 + 100.0;
    -0.03 * (s * 2.5 + 1.0) * (s * -0.15).exp() * 100.0 / arm
}

/// Of eight lines one may be beyond 95 %, and none is beyond 99.9 %: `√(2 F(2, 30))`.
fn check_human(describing: &Value) {
    let frequencies = numbers(&describing["frequency_rad_per_s"]);
    let base = 2.0 * std::f64::consts::PI / 60.0;
    let lines: Vec<f64> = frequencies.iter().map(|own| own / base).collect();
    assert_eq!(lines.len(), 8);
    assert!(lines.iter().all(|own| (own - own.round()).abs() < 1e-6));
    let (gain, phase) = (
        numbers(&describing["gain"]),
        numbers(&describing["phase_deg"]),
    );
    let sd = numbers(&describing["phase_sd_deg"]);
    let mut far = 0;
    for (k, omega) in frequencies.iter().enumerate() {
        let found = Complex::from_polar(gain[k], phase[k].to_radians());
        let distance = (human(*omega) / found - 1.0).norm() / sd[k].to_radians();
        assert!(distance < 4.2, "{omega} rad/s: {distance}");
        far += usize::from(distance > 2.6);
    }
    assert!(far <= 1, "{far}");
    let coherence = numbers(&describing["coherence"]);
    assert!(coherence.iter().all(|own| (0.8..1.0).contains(own)));
}

#[test]
fn the_describing_function_is_that_of_the_human_whatever_is_fitted() {
    let folder = flown();
    let short = fitted(&folder, &RUNS);
    let own = &short["describing_function"];
    check_human(&own["pilot"]);
    assert_eq!(own["left_out"], json!([]));
    assert_eq!(codes(&short), [""; 0]);
    let drawn = folder.pilotage(&["plot", "fit.html", "--figure", "bode", "-o", "bode.csv"]);
    assert_eq!(drawn.code, 0, "{drawn:?}");
    let dots = folder.read("bode.csv");
    let dots = dots
        .lines()
        .filter(|row| row.contains(",describing function,"));
    assert_eq!(dots.count(), 16);

    let right = problem(&folder, "0.2");
    assert_eq!(codes(&right), [""; 0]);
    for name in ["pilot", "open_loop"] {
        let [own, other] = [&right, &short].map(|fit| &fit["describing_function"][name]);
        for key in ["frequency_rad_per_s", "gain", "phase_deg", "coherence"] {
            let pairs = numbers(&own[key]).into_iter().zip(numbers(&other[key]));
            pairs.for_each(|(a, b)| assert!((a - b).abs() < 1e-9 * (1.0 + b.abs())));
        }
    }
    let gains = numbers(&right["describing_function"]["pilot"]["fitted_gain"]);
    let omega = numbers(&right["describing_function"]["pilot"]["frequency_rad_per_s"]);
    let truth = omega.iter().map(|omega| human(*omega).norm());
    gains
        .iter()
        .zip(truth)
        .for_each(|(a, b)| assert!((a / b - 1.0).abs() < 0.05, "{a} {b}"));
}

/// The same flights, fitted with a delay that is held at four times the human's, and one of them with a weaker vehicle.
#[test]
fn a_fit_that_is_not_what_was_flown_is_told() {
    let folder = flown();
    let wrong = problem(&folder, "0.6, fixed = true");
    assert_eq!(codes(&wrong)[0], "describing-function");
    // The target tells of what is left in position and stick.
    assert_eq!(codes(&wrong)[1..], ["input-left"; 2]);
    check_human(&wrong["describing_function"]["pilot"]);
    let vehicle = folder.pilotage(&["vehicle", "show"]).stdout;
    let gain = vehicle
        .lines()
        .find(|line| line.starts_with("attitude_gain"))
        .unwrap();
    folder.write("weak.toml", vehicle.replace(gain, "attitude_gain = 12.0"));
    let flags = [
        "--vehicle",
        "weak.toml",
        "--initial-state=at-rest",
        "--force",
        "--json",
    ];
    let other = folder
        .pilotage(&[&["fit", RUNS[0]], &flags[..]].concat())
        .json();
    assert_eq!(codes(&other), ["describing-function", "open-loop"]);
}

/// Targets that stand still, and two axes that act on each other.
#[test]
fn where_there_are_no_lines_or_several_loops_there_is_none() {
    let folder = Folder::new();
    let trials = example("trials/trials.toml").to_str().unwrap().to_owned();
    assert_eq!(
        fitted(&folder, &[&trials])["describing_function"],
        Value::Null
    );
    let text = example("problems/two_axis_hover/problem.toml");
    let text = std::fs::read_to_string(text).unwrap();
    let at = |name: &str| example(&format!("problems/two_axis_hover/{name}"));
    let names = ["pilot.toml", "run1.csv", "run2.csv", "run3.csv"];
    let text = names.iter().fold(text, |text, name| {
        text.replace(&format!("\"{name}\""), &format!("{:?}", at(name)))
    });
    folder.write("two.toml", text + "[fit]\nstarts = 1\nmax_iterations = 1\n");
    let two = folder.pilotage(&["fit", "two.toml", "-o", "fitted.toml", "--json"]);
    let two = two.json();
    assert_eq!(two["describing_function"], Value::Null);
    assert_eq!(two["excitation"]["forcing"], Value::Null);
    assert_eq!(two["excitation"]["identifiability"]["flat"], json!([]));
}
