//! `pilotage fly` in a browser, and its packets to FlightGear.

use crate::command::Folder;
use crate::{python, times};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Tests run one at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// The scripted stick of `tests/python/fly.py` as a model: it takes the speed from the last four states, at intervals
/// of 1/120 s.
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
tau = { start = 0.2, min = 0, max = 0.8, unit = "s" }
[outputs]
stick = { unit = "1", value = "delay(gain * (target - position - lead * delay(speed, 0.0125, 2)), tau, 3)", limit = [-1, 1] }
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

/// Time of a frame of the display [s].
const FRAME: f64 = 1.0 / 60.0;

fn pilotage() -> PathBuf {
    env!("CARGO_BIN_EXE_pilotage").into()
}

/// A protocol is flown to its end, through a reload and a dropped socket. The fit's intervals contain the stick's gain
/// and lead, and agree with its delay plus the latency of the page.
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
    // On a busy machine, runs may not count because frames were late; the stick is the same.
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
    let interval = |name: &str| {
        let own = &json["parameters"][name];
        ["low", "high"].map(|end| own[end].as_f64().unwrap_or_else(|| panic!("{json}")))
    };
    // The quadcopter's stick is negative forward. One in 20 intervals of 95 % misses what is true, one in 1,000 of three
    // times the width (five runs: Student's t with 4 degrees of freedom).
    for (name, truth) in [("pilot.gain", -0.03), ("pilot.lead", 2.0)] {
        let [low, high] = interval(name);
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        assert!((middle - truth).abs() < 3.0 * half, "{name}: {json}");
        assert!((high - low) / truth.abs() < 0.15, "{name}: {json}");
    }
    // The page's button made a pilot of those of these flights that count.
    let recorded = std::fs::read_dir(folder.path("flights")).unwrap();
    let mut recorded = recorded.map(|entry| entry.unwrap().path());
    if recorded.any(|path| path.extension().is_some_and(|own| own == "csv")) {
        let made = folder.read("flights/made/P1-pilot.toml");
        for (name, truth) in [("gain", -0.03), ("lead", 2.0)] {
            let found = start(&made, name);
            assert!(
                (found / truth - 1.0).abs() < 0.1,
                "{name} is {found}: {made}"
            );
        }
    } else {
        eprintln!("no flight counts: this machine is too busy; the page's own fit is not tried");
    }
    // A state waits for a frame of the display, and a frame stays until the next. The page looks at the stick once a
    // frame, and its time from input to picture begins there: what the stick wants may be a frame older.
    let slowest = files.iter().map(|file| to_picture(&folder, file));
    let slowest = slowest.fold(0.0, f64::max);
    let [low, high] = interval("pilot.tau");
    eprintln!(
        "delay between {low} and {high} s, of which 0.1 are the stick's; from input to picture {slowest} s"
    );
    assert!(
        high > 0.1 && low < 0.1 + FRAME + slowest,
        "{slowest}: {json}"
    );
    assert!(high - low < 0.2, "{json}");
}

/// The start value of a parameter in a model file.
fn start(model: &str, name: &str) -> f64 {
    let mut lines = model.lines();
    let line = lines.find_map(|line| line.strip_prefix(&format!("{name} = {{")));
    let value = line.and_then(|line| Some(line.split_once("start = ")?.1));
    let value = value.and_then(|value| value.split([',', ' ', '}']).next());
    value.and_then(|value| value.parse().ok()).expect(model)
}

/// Median time from input to picture [s], as the page measured it in a flight.
fn to_picture(folder: &Folder, file: &str) -> f64 {
    let text = folder.read(&format!("flights/{file}"));
    let line = text.lines().find(|line| line.contains("input to picture"));
    let (_, after) = line.and_then(|own| own.split_once("median ")).expect(&text);
    let median: f64 = after
        .split(',')
        .next()
        .expect("a number")
        .parse()
        .expect(&text);
    median / 1000.0
}

/// Both versions of the packet, decoded by an independent decoder.
#[test]
fn flightgear_hears_where_vehicle_and_marker_are() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    for version in ["24", "25"] {
        let folder = Folder::new();
        let arguments = [pilotage(), folder.path("."), version.into()];
        assert_eq!(python::run("flightgear.py", arguments).trim(), "");
    }
}
