//! The C interface of exported FMUs under valgrind: no invalid access, nothing uninitialised, no leak.

use crate::command::Folder;
use crate::times;
use std::process::Command;

/// Runs a check of `validate` under valgrind.
fn run(folder: &Folder, fmu: &str, check: &str) {
    let output = Command::new("valgrind")
        .args(["--quiet", "--error-exitcode=99", "--leak-check=full"])
        .args([
            "--show-leak-kinds=definite",
            "--errors-for-leak-kinds=definite",
        ])
        .arg(env!("CARGO_BIN_EXE_pilotage"))
        .args(["probe", fmu, "--check", check])
        .current_dir(folder.path("."))
        .output()
        .unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "{fmu}, {check}: {stdout}\n{stderr}"
    );
    assert!(
        stdout.contains("stage") && !stdout.contains("finding"),
        "{stdout}"
    );
}

/// FMI rule 30: memory, as far as valgrind sees it; on machines that have it.
#[test]
#[cfg(target_os = "linux")]
fn exported_fmus_are_clean_under_valgrind() {
    if Command::new("valgrind").arg("--version").output().is_err() {
        return times::missing("valgrind", "memory of exported FMUs is not checked");
    }
    let folder = Folder::new();
    for version in ["2", "3"] {
        let pilot = [
            "export",
            "pilot",
            "--preset",
            "paper",
            "--fmi",
            version,
            "-o",
            "pilot.fmu",
        ];
        let quadcopter = [
            "export",
            "quadcopter",
            "--fmi",
            version,
            "-o",
            "quadcopter.fmu",
        ];
        assert_eq!(folder.pilotage(&pilot).code, 0);
        assert_eq!(folder.pilotage(&quadcopter).code, 0);
        run(&folder, "pilot.fmu", "cs:state");
        run(&folder, "quadcopter.fmu", "me:derivatives");
        run(&folder, "quadcopter.fmu", "cs:simulate");
    }
}
