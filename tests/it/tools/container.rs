//! Containers in other tools: each gives what our master gives of the parts.

use super::python;
use crate::command::{CONNECTIONS, Folder, exported};

/// Pilot and quadcopter with strong coupling as an FMU of that version, and the rows that `cosim` gives of the parts.
fn flown(fmi: &str) -> (Folder, String) {
    let folder = exported();
    let fmus = ["pilot.fmu", "quadcopter.fmu", "--set", "pilot.target=10"];
    let system = [
        &fmus[..],
        &CONNECTIONS,
        &["--algorithm", "strong", "--step", "0.05"],
    ]
    .concat();
    let made = ["--fmi", fmi, "-o", "container.fmu"];
    let ended = folder.pilotage(&[&["container"], &system[..], &made].concat());
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let ended = folder.pilotage(&[&["cosim"], &system[..], &["--stop-time", "15"]].concat());
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let rows = folder.read("result.csv");
    (folder, rows)
}

fn numbers(line: &str) -> Vec<f64> {
    line.split([',', ' '])
        .filter_map(|cell| cell.parse().ok())
        .collect()
}

/// It validates the FMU, goes back by its states, and resets it.
#[test]
fn fmpy_runs_a_container() {
    for fmi in ["2", "3"] {
        let (folder, rows) = flown(fmi);
        let path = folder.path("container.fmu").display().to_string();
        let printed = python::run("container_in_fmpy.py", [&path, "15", "0.05"]);
        assert_eq!(printed.lines().count(), rows.lines().count());
        for (theirs, ours) in printed.lines().zip(rows.lines()).skip(1) {
            let (theirs, ours) = (numbers(theirs), numbers(ours));
            assert_eq!(theirs.len(), ours.len());
            for (theirs, ours) in theirs.iter().zip(&ours) {
                assert!(
                    (theirs - ours).abs() <= 1e-12 * ours.abs().max(1.0),
                    "{theirs} {ours}"
                );
            }
        }
    }
}

#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn libcosim_runs_a_container() {
    let (folder, rows) = flown("2");
    let path = folder.path("container.fmu").display().to_string();
    let (printed, log) = python::run_and_listen("container_in_libcosim.py", [&path, "15", "0.05"]);
    // The library writes its log among what is printed.
    assert!(
        !(printed.contains("[error]") || log.contains("[error]")),
        "{printed}{log}"
    );
    let mut lines = printed.lines();
    let theirs = numbers(lines.rfind(|line| !line.starts_with('[')).unwrap());
    let ours = &numbers(rows.lines().last().unwrap())[1..];
    assert_eq!(theirs.len(), ours.len());
    for (theirs, ours) in theirs.iter().zip(ours) {
        assert!(
            (theirs - ours).abs() <= 1e-12 * ours.abs().max(1.0),
            "{theirs} {ours}"
        );
    }
}
