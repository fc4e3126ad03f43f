//! The exported FMUs in libcosim, a master that is not ours and reads FMUs with FMI Library.

use crate::command::Folder;
use crate::python;

/// FMI rule 30: another tool takes the FMUs without a complaint, and its loop ends where ours does.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn libcosim_flies_as_our_master_does() {
    let folder = Folder::new();
    let export = ["export", "pilot", "--preset", "paper", "-o", "pilot.fmu"];
    assert_eq!(folder.pilotage(&export).code, 0);
    assert_eq!(folder.pilotage(&["export", "quadcopter"]).code, 0);
    let ended = folder.pilotage(&[
        "cosim",
        "pilot.fmu",
        "quadcopter.fmu",
        "--connect",
        "pilot.stick=quadcopter.stick",
        "--connect",
        "quadcopter.z=pilot.position",
        "--set",
        "pilot.target=10",
        "--stop-time",
        "15",
        "--step",
        "0.05",
    ]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let csv = folder.read("result.csv");
    let numbers = |line: &str, separator| -> Vec<f64> {
        (line.split(separator))
            .filter_map(|v| v.parse().ok())
            .collect()
    };
    // Time and the pilot's two outputs come first.
    let ours = numbers(csv.lines().last().unwrap(), ',').split_off(3);

    let pilot = folder.path("pilot.fmu").display().to_string();
    let quadcopter = folder.path("quadcopter.fmu").display().to_string();
    let arguments = [&pilot, &quadcopter, "10", "15", "0.05"];
    let (printed, said) = python::run_and_listen("libcosim.py", arguments);
    assert!(!said.contains("[error]"), "{said}");
    let line = printed.lines().find(|line| line.starts_with("outputs"));
    let theirs = numbers(line.unwrap_or_else(|| panic!("{printed}")), ' ');
    assert_eq!(theirs.len(), ours.len());
    for (theirs, ours) in theirs.iter().zip(&ours) {
        assert!(
            (theirs - ours).abs() <= 1e-12 * ours.abs().max(1.0),
            "{theirs} {ours}"
        );
    }
    assert!(
        ours[0].abs() > 1.0,
        "the vehicle moved by {} m only",
        ours[0]
    );
}
