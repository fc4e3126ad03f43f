//! States of runs: a run that goes on from one gives the rows of a run that never stopped, to the last bit.

use crate::command::{Ended, Folder, exported};
use crate::foreign;
use std::process::Command;
use std::time::Duration;

/// A model that moves by itself, with a delayed output.
const HEATER: &str = r#"[model]
name = "heater"
[inputs]
outside = { start = 5 }
[parameters]
lag = { start = 0.7, unit = "s", min = 0.1 }
rate = { start = 3, unit = "rad/s" }
[states]
room = { der = "(20 + 6 * sin(rate * time) - room) / lag + (outside - room) / (10 * lag)", start = 12 }
[outputs]
room = {}
late = { value = "delay(room, 0.33)" }
"#;

/// Pilot and quadcopter in a loop: as FMUs of both versions, and as files.
fn folder() -> Folder {
    let folder = exported();
    for words in [
        "export pilot --preset paper --fmi 3 -o pilot3.fmu",
        "export quadcopter --fmi 3 -o quadcopter3.fmu",
    ] {
        let ended = folder.pilotage(&words.split(' ').collect::<Vec<_>>());
        assert_eq!(ended.code, 0, "{ended:?}");
    }
    folder.write("heater.toml", HEATER);
    folder.write("three.fmu", foreign::fmu3("good"));
    let state = "canGetAndSetFMUstate=\"true\"";
    let both = format!("{state} canSerializeFMUstate=\"true\"");
    let description = foreign::DESCRIPTION.replace(state, &both);
    folder.write("two.fmu", foreign::fmu_of(&description, foreign::binary()));
    folder.write(
        "target.csv",
        "time,pilot.target [m]\n0,10\n1.23,10\n1.23,4\n3,7\n",
    );
    folder
}

const WIRES: &str =
    "--connect pilot.stick=vehicle.stick --connect vehicle.z=pilot.position --input target.csv";

fn pilotage(folder: &Folder, words: &str) -> Ended {
    folder.pilotage(&words.split_whitespace().collect::<Vec<_>>())
}

/// The rows from a time on.
fn tail(table: &str, time: &str) -> String {
    let mut lines = table.lines();
    let mut all = vec![lines.next().unwrap()];
    all.extend(lines.skip_while(|line| line.split(',').next() != Some(time)));
    assert!(all.len() > 2, "no row at {time}");
    all.join("\n") + "\n"
}

#[test]
fn the_rest_of_a_run_is_that_of_the_whole_to_the_last_bit() {
    let folder = folder();
    let fmus = format!("pilot=pilot.fmu vehicle=quadcopter.fmu {WIRES}");
    let fmus3 = format!("pilot=pilot3.fmu vehicle=quadcopter3.fmu {WIRES}");
    let model = format!("pilot=pilot.fmu vehicle=quadcopter {WIRES}");
    let isolated = format!("pilot=pilot3.fmu vehicle=quadcopter.fmu {WIRES} --isolate all");
    // A delay, and FMUs that have nothing of this project.
    let foreign =
        "heater.toml three.fmu two.fmu --connect heater.late=three.u --connect three.y=two.u";
    for (system, algorithm) in [
        (fmus.as_str(), ""),
        (&fmus, "--extrapolation 2"),
        (&fmus, "--algorithm strong --tolerance 1e-5"),
        (&fmus, "--parts vehicle=3"),
        (&fmus3, "--algorithm gauss-seidel"),
        (&fmus3, "--algorithm strong"),
        (&fmus3, "--algorithm strong --tolerance 1e-5"),
        (&model, "--algorithm strong"),
        (&isolated, "--algorithm strong --tolerance 1e-5"),
        (foreign, ""),
        (foreign, "--algorithm strong"),
    ] {
        let base = format!("cosim {system} {algorithm} --stop-time 3 --force");
        let run = |more: &str| {
            let ended = pilotage(&folder, &format!("{base} {more}"));
            assert_eq!(ended.code, 0, "{base} {more}: {ended:?}");
        };
        run("--step 0.05 -o whole.csv");
        run("--step 0.05 -o kept.csv --save-state 1.5=s.state --save-state 0=begin.state");
        let whole = folder.read("whole.csv");
        assert!(
            folder.read("kept.csv") == whole,
            "{base}: keeping changes rows"
        );
        run("--from-state s.state -o rest.csv --save-state 2=t.state");
        assert!(folder.read("rest.csv") == tail(&whole, "1.5"), "{base}");
        if algorithm.is_empty() {
            // From one that a run kept that itself began with one, and from the start.
            run("--from-state t.state -o rest.csv");
            assert!(folder.read("rest.csv") == tail(&whole, "2"), "{base}");
            run("--from-state begin.state -o rest.csv");
            assert!(folder.read("rest.csv") == whole, "{base}");
        }
    }
}

/// The solver of model exchange begins anew where a state is written: the run that goes on has the bits of the one that wrote it, and
/// one without a state differs by the solver's tolerance.
#[test]
fn model_exchange_goes_on_where_it_was() {
    let folder = folder();
    let fmus = format!("pilot=pilot.fmu vehicle=quadcopter.fmu {WIRES}");
    let fmus3 = format!("pilot=pilot3.fmu vehicle=quadcopter3.fmu {WIRES}");
    for (system, algorithm) in [
        (&fmus, ""),
        (&fmus3, "--extrapolation 1"),
        (&fmus3, "--algorithm strong --tolerance 1e-5"),
        (&fmus, "--isolate all"),
    ] {
        let base = format!("cosim {system} {algorithm} --kind me --stop-time 3 --force");
        let run = |more: &str| {
            let ended = pilotage(&folder, &format!("{base} {more}"));
            assert_eq!(ended.code, 0, "{base} {more}: {ended:?}");
        };
        run("--step 0.05 -o whole.csv");
        run("--step 0.05 -o kept.csv --save-state 1.5=s.state");
        run("--from-state s.state -o rest.csv");
        let [whole, kept, rest] =
            ["whole.csv", "kept.csv", "rest.csv"].map(|file| folder.read(file));
        assert!(rest == tail(&kept, "1.5"), "{base}");
        for (a, b) in whole.lines().zip(kept.lines()).skip(1) {
            let numbers = |line: &str| {
                line.split(',')
                    .map(|own| own.parse::<f64>().unwrap())
                    .collect::<Vec<_>>()
            };
            for (a, b) in numbers(a).iter().zip(numbers(b)) {
                assert!((a - b).abs() < 1e-4, "{base}: {a} {b}");
            }
        }
    }
}

/// Other signals and fewer rows may be recorded.
#[test]
fn what_is_recorded_may_change() {
    let folder = folder();
    let base = format!("cosim pilot=pilot.fmu vehicle=quadcopter.fmu {WIRES} --force");
    let run = |more: &str| {
        let ended = pilotage(&folder, &format!("{base} {more}"));
        assert_eq!(ended.code, 0, "{base} {more}: {ended:?}");
        ended
    };
    let record = "--record vehicle.z,vehicle.mass,pilot.stick --record-every 0.2";
    run(&format!("--stop-time 3 --step 0.05 {record} -o whole.csv"));
    let ended = run("--stop-time 3 --step 0.05 --save-state 1.55=s.state --save-state e.state");
    assert!(
        ended
            .stdout
            .starts_with("60 steps of 0.05 s from 0 s to 3 s")
    );
    let ended = run(&format!("--from-state s.state {record} -o rest.csv"));
    assert!(
        ended
            .stdout
            .starts_with("29 steps of 0.05 s from 1.55 s to 3 s"),
        "{ended:?}"
    );
    // 1.55 s is none of the recorded times.
    assert_eq!(
        folder.read("rest.csv"),
        tail(&folder.read("whole.csv"), "1.6")
    );
    let ended = pilotage(&folder, &format!("{base} --from-state e.state"));
    assert_eq!(
        (ended.code, ended.stderr.as_str()),
        (
            2,
            "error: e.state is at 3 s, and the run ends at 3 s\nhint: say a later end: --stop-time\n"
        )
    );
}

/// The process is killed in the midst of a long run, as by a power cut.
#[test]
fn a_killed_run_goes_on() {
    let folder = folder();
    let system = format!("cosim pilot=pilot.fmu vehicle=quadcopter.fmu {WIRES} --force");
    let long =
        format!("{system} --step 0.001 --stop-time 100000 --save-state 5=s.state -o killed.csv");
    let words: Vec<&str> = long.split_whitespace().collect();
    let mut child = folder.start(&words, &[]);
    while !folder.files().iter().any(|name| name == "s.state") {
        assert!(child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(5));
    }
    let id = child.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-KILL", &id])
            .status()
            .unwrap()
            .success()
    );
    child.wait().unwrap();
    let ended = pilotage(
        &folder,
        &format!("{system} --from-state s.state --stop-time 6 -o rest.csv"),
    );
    assert_eq!(ended.code, 0, "{ended:?}");
    let ended = pilotage(
        &folder,
        &format!("{system} --step 0.001 --stop-time 6 -o whole.csv"),
    );
    assert_eq!(ended.code, 0, "{ended:?}");
    assert!(folder.read("rest.csv") == tail(&folder.read("whole.csv"), "5"));
}

#[test]
fn states_that_cannot_be_are_refused() {
    let folder = folder();
    let system = format!("cosim pilot=pilot.fmu vehicle=quadcopter.fmu {WIRES} --stop-time 1");
    let kept = pilotage(
        &folder,
        &format!("{system} --step 0.1 --save-state 0.5=s.state"),
    );
    assert_eq!(kept.code, 0, "{kept:?}");
    folder.write("not.fmu", foreign::fmu("good"));
    let told = [
        (
            "cosim not.fmu --stop-time 1 --step 0.1 --save-state x.state".to_owned(),
            "error: `not` cannot write its state: ",
        ),
        (
            format!("{system} --step 0.1 --save-state 0.55=x.state"),
            "error: --save-state 0.55=...: no step of 0.1 s ends there, but at 0.5 s and 0.6 s\n",
        ),
        (
            format!("{system} --step 0.1 --save-state 2=x.state"),
            "error: --save-state 2=...: the run is from 0 s to 1 s\n",
        ),
        (
            format!("{system} --from-state s.state --save-state 0.2=x.state"),
            "error: --save-state 0.2=...: the run is from 0.5 s to 1 s\n",
        ),
        (
            format!("{system} --from-state s.state --save-state s.state"),
            "error: ",
        ),
        (
            format!("{system} --step 0.1 --save-state target.csv"),
            "error: ",
        ),
        (
            format!("{system} --step 0.1 --from-state s.state"),
            "error: the argument '--step <SECONDS>' cannot be used with '--from-state <FILE>'",
        ),
        (
            format!("{system} --from-state s.state --set vehicle.mass=1"),
            "error: s.state is of another system: files, wires or values are not the same\n",
        ),
        (
            format!("{system} --from-state s.state --algorithm strong"),
            "error: s.state is of a run with another coupling or scenario\n",
        ),
        (
            format!("{system} --from-state target.csv"),
            "error: target.csv is no state of a run\n",
        ),
        (
            format!("{system} --from-state gone.state"),
            "error: cannot read gone.state: ",
        ),
    ];
    for (words, why) in told {
        let ended = pilotage(&folder, &words);
        assert!(
            ended.code == 2 && ended.stderr.starts_with(why),
            "{words}: {ended:?}"
        );
    }
    assert!(!folder.files().contains(&"x.state".to_owned()));
    // What an instance gives at once is part of the system.
    let file = "[system.heater]\nmodel = \"heater.toml\"\n";
    folder.write("system.toml", file);
    let run = "cosim system.toml --stop-time 1";
    let kept = pilotage(
        &folder,
        &format!("{run} --step 0.1 --save-state 0.5=h.state"),
    );
    assert_eq!(kept.code, 0, "{kept:?}");
    folder.write("system.toml", format!("{file}at_once = true\n"));
    let ended = pilotage(&folder, &format!("{run} --from-state h.state"));
    assert!(
        ended.code == 2 && ended.stderr.contains("h.state is of another system"),
        "{ended:?}"
    );
    // Cut, or with another byte somewhere.
    let whole = std::fs::read(folder.path("s.state")).unwrap();
    for k in (0..whole.len()).step_by(whole.len() / 12) {
        let mut changed = whole.clone();
        changed[k] ^= 0x41;
        for bytes in [&changed, &whole[..k].to_vec()] {
            folder.write("bad.state", bytes);
            let ended = pilotage(&folder, &format!("{system} --from-state bad.state"));
            let is_told = ["is damaged", "is no state"]
                .iter()
                .any(|own| ended.stderr.contains(own));
            assert!(ended.code == 2 && is_told, "byte {k}: {ended:?}");
        }
    }
}
