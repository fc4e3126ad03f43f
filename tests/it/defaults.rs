//! What `pilotage cosim` assumes where it is told nothing: names of instances and steps.

use crate::command::{Ended, Folder};
use crate::foreign;

const SINE: &str = "[model]\nname = \"sine\"\n[parameters]\nrate = { start = 2, unit = \"rad/s\" }\n\
                    [outputs]\nout = { value = \"sin(rate * time)\" }\n";

fn pilotage(folder: &Folder, words: &str) -> Ended {
    folder.pilotage(&words.split_whitespace().collect::<Vec<_>>())
}

/// Dots of a file's name are in no name of an instance, since they separate it from its variables.
#[test]
fn instances_are_named_after_models() {
    let folder = Folder::new();
    folder.write("vdp.model.toml", SINE);
    folder.write("Some.Tool.Lag-1.5.fmu", foreign::fmu("good"));
    let fmu = "Some_Tool_Lag-1_5";
    let words =
        "cosim vdp.model.toml Some.Tool.Lag-1.5.fmu --connect vdp.out=FMU.u --set vdp.rate=3";
    let ended = pilotage(&folder, &words.replace("FMU", fmu));
    assert_eq!(ended.code, 0, "{ended:?}");
    let result = folder.read("result.csv");
    let head = result.lines().next().unwrap();
    assert!(
        head.starts_with("time,vdp.out,") && head.contains(&format!(",{fmu}.y [m],")),
        "{head}"
    );
    // As they are in a file of values.
    folder.write("values.toml", "[vdp]\nrate = 3\n");
    let words =
        "cosim vdp.model.toml --parameters values.toml --stop-time 1 --step 0.1 -o other.csv";
    assert_eq!(pilotage(&folder, words).code, 0);
    let value: f64 = folder.read("other.csv").lines().last().unwrap()[2..]
        .parse()
        .unwrap();
    assert!((value - 3_f64.sin()).abs() < 1e-12, "{value}");
}

/// Without --step it is what the system or an FMU suggests, or a part of the run; the rows are those of that step.
#[test]
fn steps_are_assumed() {
    let folder = Folder::new();
    folder.write("sine.toml", SINE);
    // It suggests to run to 1 s in steps of 0.1 s.
    folder.write("good.fmu", foreign::fmu("good"));
    folder.write(
        "system.toml",
        "[system.sine]\nmodel = \"sine.toml\"\n[experiment]\nstop_time = 2\nstep = 0.25\n",
    );
    for (words, step, why) in [
        ("good.fmu", "0.1", "an FMU suggests 0.1 s"),
        ("good.fmu sine.toml", "0.1", "an FMU suggests 0.1 s"),
        // It does not divide this time.
        (
            "good.fmu --stop-time 0.95",
            "0.095",
            "an FMU suggests 0.1 s",
        ),
        ("good.fmu --stop-time 0.05", "0.0001", "1/500 of the run"),
        ("sine.toml --stop-time 4", "0.008", "1/500 of the run"),
        (
            "sine.toml --start-time 1 --stop-time 2",
            "0.002",
            "1/500 of the run",
        ),
        ("system.toml", "0.25", ""),
    ] {
        let ended = pilotage(&folder, &format!("cosim {words} --force"));
        assert_eq!(ended.code, 0, "{words}: {ended:?}");
        let assumed = folder.read("result.csv");
        let note = format!("note: --step {step} is assumed: {why}\n");
        assert_eq!(
            ended.stdout.contains(&note),
            !why.is_empty(),
            "{words}: {}",
            ended.stdout
        );
        let ended = pilotage(&folder, &format!("cosim {words} --step {step} --force"));
        assert!(
            ended.code == 0 && !ended.stdout.contains("assumed"),
            "{words}: {ended:?}"
        );
        assert_eq!(folder.read("result.csv"), assumed, "{words}");
    }
    let ended = pilotage(
        &folder,
        "sweep system.toml --vary rate=1,2 --stop-time 1 --step 0.25 -o one",
    );
    assert_eq!(ended.code, 0, "{ended:?}");
    let ended = pilotage(
        &folder,
        "sweep system.toml --vary rate=1,2 --stop-time 1 -o two",
    );
    assert_eq!(ended.code, 0, "{ended:?}");
    assert_eq!(folder.read("one/sweep.csv"), folder.read("two/sweep.csv"));
    let ended = pilotage(
        &folder,
        "sweep sine.toml --vary rate=1,2 --stop-time 1 -o three",
    );
    assert_eq!(
        ended.stderr,
        "note: --step 0.002 is assumed: 1/500 of the run\n"
    );
}
