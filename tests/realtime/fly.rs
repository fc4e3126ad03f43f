//! `pilotage fly` in a browser, and what FlightGear hears of it.

use crate::command::Folder;
use crate::{python, times};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// One at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// The scripted stick of `tests/python/fly.py` as a model: it takes the speed from the last four states, of a hundred and
/// twentieth of a second each.
const PILOT: &str = r#"
[model]
name = "script"
[inputs]
target = { unit = "m" }
position = { unit = "m" }
speed = { unit = "m/s" }
[parameters]
gain = { start = -0.02, min = -0.2, max = 0.2, unit = "1/m" }
lead = { start = 1, min = 0, max = 10, unit = "s" }
tau = { start = 0.1, min = 0, max = 0.5, unit = "s" }
[outputs]
stick = { unit = "1", value = "delay(gain * (target - position - lead * delay(speed, 0.0125, 2)), tau, 2)", limit = [-1, 1] }
"#;

const PROBLEM: &str = r#"
[system.pilot]
model = "script.toml"
[system.vehicle]
model = "quadcopter"
[connect]
"pilot.stick" = "vehicle.stick"
"vehicle.z" = "pilot.position"
"vehicle.v" = "pilot.speed"
[inputs]
"pilot.target" = { column = "target" }
[[measured]]
signal = "vehicle.z"
column = "position"
[parameters]
"pilot.gain" = {}
"pilot.lead" = {}
"pilot.tau" = {}
"#;

fn pilotage() -> PathBuf {
    env!("CARGO_BIN_EXE_pilotage").into()
}

/// A protocol is flown to its end, through a reload and a dropped socket; the stick's gain and lead come back, and what the
/// page adds as a delay.
#[test]
fn a_session_in_a_browser_is_recorded_and_its_stick_identified() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = Folder::new();
    let browsers = Path::new(env!("CARGO_TARGET_TMPDIR")).join("browsers");
    let printed = python::run("fly.py", [pilotage(), browsers, folder.path(".")]);
    if printed.trim() == "no browser" {
        return times::missing("a browser (Chromium)", "nobody flies");
    }
    let results: Vec<Value> =
        serde_json::from_str(&printed).unwrap_or_else(|error| panic!("{error}: {printed}"));
    let is_broken = |own: &&Value| {
        let why = own["why"].as_str().unwrap_or("");
        why.contains("connection broke")
    };
    assert!(results.iter().filter(is_broken).count() >= 2, "{printed}");
    // On a busy machine runs may not count because frames came late: the stick was the same.
    let flown = results.iter().skip(1).filter(|own| !is_broken(own));
    let files: Vec<&str> = flown.filter_map(|own| own["file"].as_str()).collect();
    let runs = files
        .iter()
        .map(|file| format!("[[run]]\nfile = \"flights/{file}\"\n"));
    folder.write("script.toml", PILOT);
    folder.write(
        "problem.toml",
        PROBLEM.to_owned() + &runs.collect::<String>(),
    );
    let json = folder.pilotage(&["fit", "problem.toml", "--json"]).json();
    let found = |name: &str| json["parameters"][name]["value"].as_f64().unwrap();
    let [gain, lead, tau] = ["pilot.gain", "pilot.lead", "pilot.tau"].map(found);
    // The quadcopter's own stick is negative forward.
    assert!((gain / -0.03 - 1.0).abs() < 0.05, "{json}");
    assert!((lead / 2.0 - 1.0).abs() < 0.05, "{json}");
    assert!((0.005..0.15).contains(&tau), "{json}");
}

/// Both versions of the packet, taken apart by a decoder that is not ours.
#[test]
fn flightgear_hears_where_vehicle_and_marker_are() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    for version in ["24", "25"] {
        let folder = Folder::new();
        let arguments = [pilotage(), folder.path("."), version.into()];
        assert_eq!(python::run("flightgear.py", arguments).trim(), "");
    }
}
