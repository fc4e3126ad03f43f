//! What the commands write, read by tools that are not ours: results by fmpy, matrices by NumPy.

use super::python;
use crate::command::{CONNECTIONS, Folder};
use crate::{closed_loop, cosim_command, linearize};
use serde_json::{Value, json};

fn read_by_fmpy(folder: &Folder, file: &str) -> Value {
    let printed = python::run("read_result.py", [folder.path(file)]);
    serde_json::from_str(&printed).unwrap()
}

/// Pilot and quadcopter for 15 s.
fn simulate(folder: &Folder, algorithm: &str) {
    let flight = [
        "--set",
        "pilot.target=10",
        "--stop-time",
        "15",
        "--step",
        "0.05",
    ];
    let output = ["--algorithm", algorithm, "-o", "result.csv"];
    let fmus = ["cosim", "pilot.fmu", "quadcopter.fmu"];
    let ended = folder.pilotage(&[&fmus[..], &CONNECTIONS, &flight, &output].concat());
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
}

#[test]
fn fmpy_closes_the_loop_to_the_same_numbers_and_reads_our_csv() {
    let folder = closed_loop::folder_with_fmus();
    for algorithm in ["jacobi", "gauss-seidel"] {
        simulate(&folder, algorithm);
        let file = |name: &str| folder.path(name).into_os_string();
        let printed = python::run(
            "closed_loop.py",
            [
                file("pilot.fmu"),
                file("quadcopter.fmu"),
                file("result.csv"),
                algorithm.into(),
                "10".into(),
                "15".into(),
                "0.05".into(),
            ],
        );
        let difference: f64 = printed.trim().parse().unwrap();
        assert!(difference < 1e-12, "{algorithm}: {difference}");
    }
}

#[test]
fn fmpy_reads_names_units_and_values() {
    let folder = cosim_command::folder(&["good"]);
    let chosen = ["--record", "good.k,*.y,good.?", "--record-every", "1"];
    let more = [&chosen[..], &["--set", "good.u=1"]].concat();
    assert_eq!(cosim_command::short_run(&folder, &more).code, 0);
    let read = read_by_fmpy(&folder, "result.csv");
    assert_eq!(
        read["names"],
        json!(["time", "good.k [1/s]", "good.y [m]", "good.u [m]", "good.n"])
    );
    assert_eq!(read["rows"], 3);
    let y = 1.0 - (-2.0f64).exp();
    let last: Vec<f64> = serde_json::from_value(read["last"].clone()).unwrap();
    assert!((last[2] - y).abs() < 1e-12);
    assert_eq!((last[0], last[1], last[3], last[4]), (2.0, 1.0, 1.0, 1.0));
}

#[test]
fn fmpy_reads_what_a_crash_leaves() {
    let folder = cosim_command::folder(&["crash@1.25"]);
    let crashed = folder.pilotage(&["cosim", "crash.fmu", "--stop-time", "2", "--step", "0.25"]);
    assert_eq!(crashed.code, 1, "{crashed:?}");
    let read = read_by_fmpy(&folder, "result.csv.part");
    assert_eq!(
        (read["rows"].as_u64(), read["last"][0].as_f64()),
        (Some(6), Some(1.25))
    );
}

/// Poles by NumPy from the printed matrix, the files against the JSON, and what a time later looks like.
#[test]
fn poles_agree_with_numpy_and_files_with_the_json() {
    let folder = linearize::folder_with_models();
    let later = ["--set", "pilot.target=10", "--at", "2", "--step", "0.05"];
    let files = [
        "--json",
        "--csv",
        "m.csv",
        "--matlab",
        "m.m",
        "--in-steps",
        "0.05",
    ];
    let json = linearize::run(
        &folder,
        "toml",
        &[&later[..], &files, &linearize::LOOP].concat(),
    )
    .json();
    assert_eq!(json["time"], 2.0);
    folder.write("linear.json", json.to_string());
    let paths = ["linear.json", "m.csv"].map(|name| folder.path(name).into_os_string());
    let found: Value = serde_json::from_str(&python::run("linear.py", paths)).unwrap();
    for (what, limit) in [("poles", 1e-9), ("table", 0.0), ("sampled", 1e-8)] {
        let difference = found[what].as_f64().unwrap();
        assert!(difference <= limit, "{what}: {difference}");
    }
    let matlab = folder.read("m.m");
    let first = matlab
        .split("A = [\n")
        .nth(1)
        .unwrap()
        .lines()
        .next()
        .unwrap();
    assert_eq!(first, "0.0 1.0 0.0 0.0 0.0 0.0 0.0 0.0 0.0");
    assert!(
        matlab.contains("\ninputs = {'pilot.target'};\n"),
        "{matlab}"
    );
}
