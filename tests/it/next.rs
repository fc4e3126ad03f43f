//! What commands say to type next works as typed, whatever the program and the files are called.
#![cfg(unix)]

use crate::command::{Ended, Folder};
use std::process::Command;

/// A search path on which the program is not.
const ELSEWHERE: [(&str, &str); 1] = [("PATH", "/usr/bin:/bin")];

/// The commands behind `next:`.
fn next(ended: &Ended) -> Vec<String> {
    let (_, next) = ended
        .stdout
        .split_once("next: ")
        .unwrap_or_else(|| panic!("{ended:?}"));
    next.lines().map(|line| line.trim().to_owned()).collect()
}

/// A command as a shell takes it.
fn typed(folder: &Folder, command: &str) -> Ended {
    let mut shell = Command::new("sh");
    let output = shell
        .args(["-c", command])
        .envs(ELSEWHERE)
        .current_dir(folder.path("."));
    let output = output.output().unwrap();
    let ended = Ended {
        code: output.status.code().unwrap_or(-1),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    };
    assert_eq!(ended.code, 0, "{command}: {ended:?}");
    ended
}

/// From synthetic flights to a valid FMU of the pilot, by nothing else than what each command says.
#[test]
fn the_way_from_flights_to_an_fmu_is_told_step_by_step() {
    let folder = Folder::new();
    let flown = ["trials", "synth", "-o", "my flights"];
    let flown = folder.pilotage_with(&flown, &ELSEWHERE);
    let [check, fit] = &next(&flown)[..] else {
        panic!("{flown:?}");
    };
    typed(&folder, check);
    let fitted = typed(&folder, &fit.replace("pilot.toml", "'my pilot.toml'"));
    let exported = typed(&folder, &next(&fitted)[0]);
    assert!(folder.path("my pilot.fmu").is_file(), "{exported:?}");
    let validated = typed(&folder, &next(&exported)[0]);
    assert!(validated.stdout.contains("my pilot.fmu"), "{validated:?}");
}

/// Where its name leads to the program, that is its name.
#[test]
fn a_program_on_the_search_path_is_called_by_its_name() {
    let folder = Folder::new();
    let exported = folder.pilotage(&["export", "quadcopter", "-o", "a b.fmu"]);
    assert_eq!(next(&exported), ["pilotage validate 'a b.fmu'"]);
}
