//! The exported FMUs in masters that are not ours: each ends where ours does.

use super::python;
use crate::command::{CONNECTIONS, Folder, exported};

fn numbers(line: &str, separator: char) -> Vec<f64> {
    (line.split(separator))
        .filter_map(|v| v.parse().ok())
        .collect()
}

/// The last row of a run of 15 s in steps of 0.05 s, without the time.
fn flown(folder: &Folder, arguments: &[&str]) -> Vec<f64> {
    let time = ["--stop-time", "15", "--step", "0.05"];
    let ended = folder.pilotage(&[&["cosim"], arguments, &time].concat());
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    numbers(folder.read("result.csv").lines().last().unwrap(), ',').split_off(1)
}

/// The quadcopter's outputs in our master, to 10 m.
fn ours(folder: &Folder) -> Vec<f64> {
    let (fmus, target) = (
        ["pilot.fmu", "quadcopter.fmu"],
        ["--set", "pilot.target=10"],
    );
    // The pilot's two outputs come first.
    let ours = flown(folder, &[&fmus[..], &CONNECTIONS, &target].concat()).split_off(2);
    assert!(
        ours[0].abs() > 1.0,
        "the vehicle moved by {} m only",
        ours[0]
    );
    ours
}

fn assert_same(theirs: &[f64], ours: &[f64]) {
    assert_eq!(theirs.len(), ours.len());
    for (theirs, ours) in theirs.iter().zip(ours) {
        let difference = (theirs - ours).abs();
        assert!(difference <= 1e-12 * ours.abs().max(1.0), "{theirs} {ours}");
    }
}

/// What a script of `tests/python` that closes the loop prints as outputs; and what was said on the way.
fn theirs(folder: &Folder, script: &str) -> (Vec<f64>, String) {
    let [pilot, quadcopter] =
        ["pilot.fmu", "quadcopter.fmu"].map(|name| folder.path(name).display().to_string());
    let arguments = [&pilot, &quadcopter, "10", "15", "0.05"];
    let (printed, log) = python::run_and_listen(script, arguments);
    let line = printed.lines().find(|line| line.starts_with("outputs"));
    let outputs = numbers(line.unwrap_or_else(|| panic!("{printed}")), ' ');
    (outputs, log)
}

/// FMI rule 30: a master with FMI Library takes the FMUs without a complaint.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn libcosim_flies_as_our_master_does() {
    let folder = exported();
    let (theirs, log) = theirs(&folder, "libcosim.py");
    assert!(!log.contains("[error]"), "{log}");
    assert_same(&theirs, &ours(&folder));
}

#[test]
fn fmuloader_flies_as_our_master_does() {
    let folder = exported();
    assert_same(&theirs(&folder, "loader.py").0, &ours(&folder));
}

/// The master of the Ecos platform.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn ecos_flies_as_our_master_does() {
    let folder = exported();
    assert_same(&theirs(&folder, "ecos.py").0, &ours(&folder));
}

#[test]
fn cofmupy_flies_as_our_master_does() {
    let folder = exported();
    assert_same(&theirs(&folder, "cofmu.py").0, &ours(&folder));
}

/// Both FMUs in one that another tool makes of them, which our master runs; it has the outputs of the quadcopter.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn assert_container_flies(script: &str) {
    let folder = exported();
    let names = ["pilot.fmu", "quadcopter.fmu", "container.fmu"];
    let [pilot, quadcopter, container] = names.map(|name| folder.path(name).display().to_string());
    python::run(script, [&pilot, &quadcopter, "10", "0.05", &container]);
    assert_same(&flown(&folder, &["container.fmu"]), &ours(&folder));
}

#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn a_container_of_fmpy_flies_as_our_master_does() {
    assert_container_flies("container.py");
}

#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn a_container_of_the_manipulation_toolbox_flies_as_our_master_does() {
    assert_container_flies("toolbox.py");
}
