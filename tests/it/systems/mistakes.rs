//! System files that are wrong, and what each is told, to the letter.
//!
//! `mistakes.txt` has a paragraph for each: its lines behind `| `, the exit code in brackets, and what goes to stderr.

use crate::command::{Folder, exported};
use crate::foreign;
use crate::paragraphs::assert_same;

/// What stands beside the system files.
fn folder() -> Folder {
    let folder = exported();
    let theta = [0.3, 1.2, 1.0, -0.006, -0.03, -0.04];
    let theta = theta.iter().zip(1..);
    let lines: String = theta
        .map(|(value, i)| format!("theta{i} = {value}\n"))
        .collect();
    let typed = foreign::fmu3("good");
    let pilot = format!("[theta]\n{lines}");
    let texts: [(&str, &[u8]); 9] = [
        ("pilot.toml", pilot.as_bytes()),
        ("other.toml", b"[motor]\nspeed = 3\n"),
        ("model.toml", b"[model]\nname = \"lag\"\n"),
        ("foreign.fmu", &foreign::fmu("good")),
        ("typed.fmu", &typed),
        ("text.fmu", b"not a zip\n"),
        (
            "run.csv",
            b"time [s],target [m],position [m]\n0,10,0\n1,10,1\n",
        ),
        ("course.csv", b"time [s],altitude [m]\n0,0\n1,10\n"),
        ("page.html", b"<!DOCTYPE html>\n<html></html>\n"),
    ];
    for (name, content) in texts {
        folder.write(name, content);
    }
    folder
}

#[test]
fn what_each_mistake_is_told() {
    let expected = include_str!("mistakes.txt");
    let folder = folder();
    let mut found = Vec::new();
    for paragraph in expected.split("\n\n") {
        let lines = paragraph.lines().filter_map(|line| line.strip_prefix('|'));
        let lines: Vec<&str> = lines.collect();
        let text: String = lines
            .iter()
            .map(|line| format!("{}\n", line.trim_start()))
            .collect();
        folder.write("system.toml", text);
        let run = ["cosim", "system.toml", "--stop-time", "1", "--step", "0.5"];
        let ended = folder.pilotage(&run);
        let shown: String = lines.iter().map(|line| format!("|{line}\n")).collect();
        found.push(format!(
            "{shown}[{}]\n{}",
            ended.code,
            ended.stderr.trim_end()
        ));
        assert!(!ended.stderr.contains("panicked"), "{}", ended.stderr);
    }
    assert!(found.len() >= 50, "{}", found.len());
    let refused = found
        .iter()
        .filter(|refused| refused.contains("\n[2]\nerror: system.toml"));
    assert!(refused.count() >= 45);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/it/systems/mistakes.txt");
    assert_same(path, &found);
}

/// The commands that take system files tell the same of a wrong one.
#[test]
fn every_command_tells_of_a_mistake() {
    let folder = folder();
    for (text, message) in [
        (
            "[system.pilot]\nmodel = \"pilot.fmu\"\nset = { targt = 1 }\n",
            "error: system.toml:3:9: `pilot.targt`: `pilot` has no variable `targt`; did you mean `pilot.target`?\n",
        ),
        (
            "[system.pilot\n",
            "error: system.toml:1:14: not TOML: unclosed table, expected `]`\n",
        ),
    ] {
        folder.write("system.toml", text);
        for command in [
            &["cosim", "system.toml", "--step", "1"][..],
            &["linearize", "system.toml"],
            &["info", "system.toml"],
            &["info", "system.toml", "--json"],
            &["validate", "system.toml"],
        ] {
            let ended = folder.pilotage(command);
            let outcome = (ended.code, ended.stderr.as_str());
            assert_eq!(outcome, (2, message), "{command:?}");
        }
    }
}
