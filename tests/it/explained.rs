//! Fits that explain little of their recordings, or nothing, and those whose times are in another unit.

use crate::command::Folder;
use serde_json::Value;

/// A pilot with a gain and a lag in front of an integrator.
const PILOT: &str = "[model]\nname = \"p\"\n[inputs]\ntarget = {}\nposition = {}\n[parameters]\n\
                     gain = { start = 1, min = 0, max = 10 }\nlag = { start = 0.2, unit = \"s\", min = 0.02, max = 5 }\n\
                     [states]\narm.der = \"(gain * (target - position) - arm) / lag\"\n[outputs]\nstick = \"arm\"\n";

/// Noise of unit variance, about normal, from sums of a linear congruential generator.
fn noise(count: usize) -> Vec<f64> {
    let mut state = 7_u64;
    let mut next = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    (0..count).map(|_| (0..12).map(|_| next()).sum()).collect()
}

/// The target of the runs.
fn target(t: f64) -> f64 {
    (0.7 * t).sin() + 0.6 * (1.9 * t).sin()
}

/// Rows of a run of 30 s at 10 Hz with these targets, and positions given the one that the loop with gain 2 and lag 0.3 s has.
fn rows(first: f64, head: &str, row: impl Fn(usize, f64, f64, f64) -> String) -> String {
    let (mut arm, mut position) = (0.0, first);
    let (h, parts) = (0.1, 200);
    let mut text = format!("{head}\n");
    for k in 0..300 {
        let t = k as f64 * h;
        text += &row(k, t, target(t), position);
        for part in 0..parts {
            let step = h / f64::from(parts);
            let at = target(t) + (target(t + h) - target(t)) * f64::from(part) / f64::from(parts);
            let slope = (2.0 * (at - position) - arm) / 0.3;
            (arm, position) = (arm + step * slope, position + step * arm);
        }
    }
    text
}

fn fitted(run: &str, input: &str) -> (i32, Value) {
    let folder = Folder::new();
    folder.write("pilot.toml", PILOT);
    folder.write("run.csv", run);
    folder.write(
        "problem.toml",
        format!(
            "[system.pilot]\nmodel = \"pilot.toml\"\n[system.vehicle]\nmodel = \"integrator\"\n[connect]\n\
             \"pilot.stick\" = \"vehicle.stick\"\n\"vehicle.position\" = \"pilot.position\"\n{input}\n\
             [[measured]]\nsignal = \"vehicle.position\"\ncolumn = \"position\"\n[parameters]\n\"pilot.*\" = {{}}\n\
             [initial]\n\"vehicle.position\" = \"free\"\n[[run]]\nfile = \"run.csv\"\n[fit]\nstarts = 2\n"
        ),
    );
    let ended = folder.pilotage(&["fit", "problem.toml", "--json", "--force"]);
    (ended.code, ended.json())
}

fn codes(json: &Value) -> Vec<&str> {
    let doubts = json["doubts"].as_array().unwrap();
    doubts
        .iter()
        .map(|own| own["code"].as_str().unwrap())
        .collect()
}

const DRIVEN: &str = "[inputs]\n\"pilot.target\" = \"target\"";

#[test]
fn a_fit_that_explains_nothing_has_no_answer() {
    // What moved the vehicle is not recorded: a target that nobody followed.
    let other = rows(0.0, "time [s],target,position", |_, t, w, _| {
        format!("{t},{w},{}\n", 3.0 * (0.31 * t * t).sin())
    });
    let (code, json) = fitted(&other, DRIVEN);
    assert_eq!((code, &json["status"]), (1, &"nothing-explained".into()));
    let words = json["doubts"][0]["words"].as_str().unwrap();
    assert!(words.contains("of position within the runs"), "{words}");
    // The target is not named, or keeps a value.
    let still = rows(0.0, "time [s],target,position", |_, t, _, z| {
        format!("{t},0,{z}\n")
    });
    for (run, input) in [(&still, ""), (&still, DRIVEN)] {
        let (code, json) = fitted(run, input);
        assert_eq!((code, codes(&json)[0]), (1, "nothing-explained"));
        let words = json["doubts"][0]["words"].as_str().unwrap();
        assert!(words.contains("nothing drives `pilot.target`"), "{words}");
    }
}

/// A decay from where the run begins is driven by nothing, and little may be explained of what is noisy.
#[test]
fn what_decays_or_is_noisy_is_an_answer() {
    let decay = rows(1.0, "time [s],target,position", |_, t, _, _| {
        // ẍ + ẋ/0.3 + 2/0.3 x = 0, from 1 with the arm at 0.
        let (a, w) = (1.0 / 0.6, (2.0 / 0.3_f64 - 1.0 / 0.36).sqrt());
        format!(
            "{t},0,{}\n",
            (-a * t).exp() * ((w * t).cos() + a / w * (w * t).sin())
        )
    });
    let (code, json) = fitted(&decay, "");
    assert_eq!(code, 0, "{json}");
    let gain = json["parameters"]["pilot.gain"]["value"].as_f64().unwrap();
    // The vehicle moves by 10 m/s at full stick.
    assert!((gain - 0.2).abs() < 1e-3, "{gain}");
    let noise = noise(300);
    let noisy = rows(0.0, "time [s],target,position", |k, t, w, z| {
        format!("{t},{w},{}\n", z + 2.5 * noise[k])
    });
    let (code, json) = fitted(&noisy, DRIVEN);
    let vaf = json["runs"][0]["measured"]["position"]["vaf"].as_f64();
    assert_eq!((code, codes(&json)[0]), (0, "poor-fit"), "{vaf:?} {json}");
}

/// Milliseconds in a column without a unit; the same with a unit, or as short as a task may be.
#[test]
fn times_in_another_unit_are_no_answer() {
    let scaled = |head: &str, factor: f64| {
        let head = format!("{head},target,position");
        let run = rows(0.0, &head, |_, t, w, z| format!("{},{w},{z}\n", factor * t));
        let (code, json) = fitted(&run, DRIVEN);
        let is_told = codes(&json).contains(&"time-scale");
        (code, is_told, codes(&json).join(" "))
    };
    for known in [scaled("time", 1.0), scaled("time [ms]", 1000.0)] {
        assert!(known.0 == 0 && !known.1, "{known:?}");
    }
    let told = scaled("time", 1000.0);
    assert!(told.0 == 1 && told.1, "{told:?}");
}
