//! What commands say to type next works as typed, whatever the program and the files are called; and so does what README says.
#![cfg(unix)]

use crate::command::{Ended, Folder, example, path_with_program};
use std::ffi::OsStr;
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
    typed_with(folder, command, ELSEWHERE[0].1.as_ref())
}

fn typed_with(folder: &Folder, command: &str, search_path: &OsStr) -> Ended {
    let mut shell = Command::new("sh");
    let output = shell
        .args(["-c", command])
        .env("PATH", search_path)
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

/// The commands of README, one after the other, in a folder with the example flights.
#[test]
fn what_readme_says_to_type_works() {
    let folder = Folder::new();
    let flights =
        (std::fs::read_dir(example("trials")).unwrap()).map(|entry| entry.unwrap().path());
    for (n, flight) in flights
        .filter(|path| path.extension() == Some("csv".as_ref()))
        .enumerate()
    {
        let (name, bytes) = (flight.file_name().unwrap(), std::fs::read(&flight).unwrap());
        folder.write(&format!("examples/trials/{}", name.display()), &bytes);
        folder.write(&format!("run{n}.csv"), &bytes);
    }
    let readme = include_str!("../../README.md").replace("\\\n", "");
    // One block is a model file.
    let (_, model) = readme.split_once("    [model]\n").unwrap();
    let (model, _) = model.split_once("\n\n").unwrap();
    folder.write("tracker.toml", format!("[model]\n{model}"));
    let lines = readme.lines().filter_map(|line| line.strip_prefix("    "));
    let inline = readme
        .split('`')
        .filter(|word| word.contains("tracker.toml"));
    let commands: Vec<&str> = lines
        .chain(inline)
        .filter(|line| line.starts_with("pilotage "))
        .collect();
    assert_eq!(commands.len(), 12, "{commands:?}");
    for command in commands {
        typed_with(&folder, command, &path_with_program());
    }
    for made in ["fit.html", "problem.html", "result.csv", "tracker.fmu"] {
        assert!(folder.path(made).is_file(), "{made}");
    }
}
