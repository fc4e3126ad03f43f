//! Recorded sticks that contradict the model of the vehicle, and those that do not.

use crate::command::Folder;
use serde_json::Value;

/// Accelerates by 6 m/s² at full stick, against a drag.
const VEHICLE: &str = "[model]\nname = \"v\"\n[inputs]\nstick = {}\n[states]\nx.der = \"v\"\nv.der = \"6 * stick - 2 * v\"\n\
                       [outputs]\nposition = \"x\"\n";

/// What a stick of sines makes of the vehicle, in closed form, from 0.2 at 0.1/s: time, stick, position. The stick is
/// `Σ a sin(w t)`, and `x` the sum of `-6 a (w sin(w t) + 2 cos(w t)) / (w (w² + 4))`, a constant and a decay.
fn flown(t: f64, stick_at: f64) -> (f64, f64) {
    let sines = [(0.30, 0.7), (0.25, 1.9), (0.15, 4.1)];
    let stick = sines.iter().map(|(a, w)| a * (w * stick_at).sin()).sum();
    let forced = |t: f64| -> f64 {
        let each = sines.iter();
        each.map(|(a, w)| {
            -6.0 * a * (w * (w * t).sin() + 2.0 * (w * t).cos()) / (w * (w * w + 4.0))
        })
        .sum()
    };
    let slope: f64 = sines
        .iter()
        .map(|(a, w)| -6.0 * a * w / (w * w + 4.0))
        .sum();
    let decay = -0.5 * (0.1 - slope);
    (
        stick,
        forced(t) + decay * (-2.0 * t).exp() + 0.2 - forced(0.0) - decay,
    )
}

/// The problem of a pilot in front of this vehicle, with runs of 20 s at 20 Hz.
fn problem(vehicle: &str, stick: impl Fn(f64) -> f64, later: f64) -> Folder {
    let folder = Folder::new();
    folder.write("v.toml", vehicle);
    let row = |k: usize| {
        let t = 0.05 * k as f64;
        let (u, x) = flown(t, t + later);
        let ripple = 1e-3 * ((k * k) as f64).sin();
        format!("{t},{},{},{}\n", (0.4 * t).sin(), x + ripple, stick(u))
    };
    let rows: String = (0..=400).map(row).collect();
    folder.write("run.csv", format!("time [s],target,position,stick\n{rows}"));
    let ended = folder.pilotage(&[
        "init",
        "run.csv",
        "--pilot",
        "crossover",
        "--vehicle",
        "v.toml",
        "-o",
        "p.toml",
    ]);
    assert_eq!(ended.code, 0, "{ended:?}");
    folder
}

/// The words of the diagnostic.
fn told(folder: &Folder) -> Option<String> {
    let ended = folder.pilotage(&[
        "fit",
        "p.toml",
        "--json",
        "--force",
        "--random-starts",
        "0",
        "--max-iterations",
        "3",
    ]);
    let json: Value = ended.json();
    let doubts = json["doubts"].as_array().unwrap();
    let own = doubts.iter().find(|own| own["code"] == "open-loop")?;
    assert!(
        ended.stderr.contains("put through `vehicle` alone"),
        "{ended:?}"
    );
    own["words"].as_str().map(str::to_owned)
}

#[test]
fn a_stick_that_the_vehicle_answers_is_not_doubted() {
    assert_eq!(told(&problem(VEHICLE, |u| u, 0.0)), None);
    // Held for half a sample more or less, or with a trim.
    assert_eq!(told(&problem(VEHICLE, |u| u, 0.025)), None);
    assert_eq!(told(&problem(VEHICLE, |u| u + 0.05, 0.0)), None);
    // Recorded under a name that nothing has.
    let folder = problem(VEHICLE, |u| -u, 0.0);
    let other = folder.read("run.csv").replacen("stick", "lever", 1);
    folder.write("run.csv", other);
    assert_eq!(told(&folder), None);
}

#[test]
fn sign_unit_gain_delay_and_dynamics_show() {
    let of = |vehicle: &str, stick: &dyn Fn(f64) -> f64, later: f64| {
        told(&problem(vehicle, stick, later)).expect("it is told")
    };
    let words = of(VEHICLE, &|u| -u, 0.0);
    assert!(
        words.contains("moves 1 times as far, the other way"),
        "{words}"
    );
    let words = of(VEHICLE, &|u| 100.0 * u, 0.0);
    assert!(
        words.contains("moves 0.01 times as far, with which it explains 100 %"),
        "{words}"
    );
    let words = of(&VEHICLE.replace("6 * stick", "3 * stick"), &|u| u, 0.0);
    assert!(
        words.contains("moves 2 times as far, with which it explains 100 %"),
        "{words}"
    );
    let words = of(VEHICLE, &|u| u, 0.3);
    assert!(
        words.contains("is 0.3 s later, with which it explains 100 %"),
        "{words}"
    );
    let words = of(
        &VEHICLE
            .replace("v.der", "y.der")
            .replace("x.der = \"v\"", "x.der = \"stick - x\"")
            .replace("2 * v", "2 * y"),
        &|u| u,
        0.0,
    );
    assert!(
        words.contains("or something that is not recorded moves it too"),
        "{words}"
    );
}

/// A stick that is measured is the same, and one of a vehicle with a sought parameter is not looked at.
#[test]
fn a_measured_stick_counts_and_an_unknown_vehicle_does_not() {
    let folder = problem(VEHICLE, |u| -u, 0.0);
    let text = folder.read("p.toml");
    assert!(
        text.contains("# signal = \"pilot.stick\"\n# column = \"stick\"\n"),
        "{text}"
    );
    let measured = "# [[measured]]\n# signal = \"pilot.stick\"\n# column = \"stick\"\n";
    folder.write(
        "p.toml",
        text.replace(measured, &measured.replace("# ", "")),
    );
    assert!(told(&folder).is_some());
    let sought = VEHICLE
        .replace("6 * stick", "k * stick")
        .replace("[states]", "[parameters]\nk = 6\n[states]");
    folder.write("v.toml", sought);
    assert!(told(&folder).is_some());
    folder.write(
        "p.toml",
        text.replace("[parameters] ", "[parameters]\n\"vehicle.k\" = {} "),
    );
    assert_eq!(told(&folder), None);
}
