//! FMUs that other tools exported: the Reference FMUs of the Modelica Association's FMI project (FMI 2.0 and
//! FMI 3.0), OpenModelica's and one of MapleSim. They are checked, and flown as fmpy flies them.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use super::python;
use crate::command::Folder;
use std::fmt::Write;

/// A folder with all of them, and their names.
fn unpacked() -> (Folder, Vec<String>) {
    let folder = Folder::new();
    let printed = python::run("other_tools.py", [python::packages(), folder.path(".")]);
    let names: Vec<_> = printed.lines().map(str::to_owned).collect();
    assert!(names.len() > 15, "{names:?}");
    (folder, names)
}

/// No false alarm, and true ones: each line of the snapshot was looked at.
#[test]
fn fmus_of_other_tools_are_judged_fairly() {
    let (folder, names) = unpacked();
    let mut arguments = vec!["validate", "--json"];
    arguments.extend(names.iter().map(String::as_str));
    let judged = folder.pilotage(&arguments).json();
    let mut list = String::new();
    for fmu in judged["fmus"].as_array().unwrap() {
        let runs = if fmu["run"] == true { ", runs" } else { "" };
        writeln!(list, "{}{runs}", fmu["file"].as_str().unwrap()).unwrap();
        for finding in fmu["findings"].as_array().unwrap() {
            let text = |key: &str| finding[key].as_str().unwrap_or_default().to_owned();
            let (severity, message) = (text("severity"), text("message"));
            writeln!(list, "  {severity}: {message} ({})", text("section")).unwrap();
        }
    }
    insta::assert_snapshot!(list);
}

/// Both kinds of each, from rest to the stop time, against fmpy's simulation, which integrates model
/// exchange with CVODE.
#[test]
fn fmus_of_other_tools_fly_as_in_fmpy() {
    let (folder, names) = unpacked();
    let mut runs = Vec::new();
    for name in &names {
        let (stop, step) = match name.rsplit(['-', '_']).next().unwrap() {
            "BouncingBall.fmu" => ("3", "0.01"),
            // It ends by itself at 9 s, within a step.
            "Stair.fmu" => ("10", "0.2"),
            "VanDerPol.fmu" => ("20", "0.01"),
            _ => ("1.5", "0.01"),
        };
        let info = folder.pilotage(&["info", "--json", name]).json();
        for (kind, fmi, named) in [
            ("cs", "CoSimulation", "co-simulation"),
            ("me", "ModelExchange", "model exchange"),
        ] {
            // In model exchange fmpy leaves out what the last event did.
            let stop = match (kind, stop) {
                ("me", "10") => "8",
                _ => stop,
            };
            if info["capabilities"].get(named).is_some() {
                runs.push((name, kind, fmi, stop, step));
            }
        }
    }
    let path = |name: &str| folder.path(name).display().to_string();
    let theirs = python::run(
        "end_values.py",
        runs.iter().flat_map(|(name, _, fmi, stop, step)| {
            [
                path(name),
                (*fmi).to_owned(),
                (*stop).to_owned(),
                (*step).to_owned(),
            ]
        }),
    );
    assert_eq!(theirs.lines().count(), runs.len());
    let mut compared = 0;
    for ((name, kind, _, stop, step), theirs) in runs.into_iter().zip(theirs.lines()) {
        let arguments = ["--kind", kind, "--stop-time", stop, "--step", step];
        let fmu = format!("fmu={name}");
        let ended = folder.pilotage(&[&["cosim", &fmu][..], &arguments].concat());
        assert_eq!(ended.code, 0, "{name} {kind}: {}", ended.stderr);
        let csv = folder.read("result.csv");
        let row = |line: Option<&str>| -> Vec<String> {
            line.unwrap().split(',').map(str::to_owned).collect()
        };
        let (head, last) = (row(csv.lines().next()), row(csv.lines().last()));
        let theirs: serde_json::Value = serde_json::from_str(theirs).unwrap();
        // Both integrate model exchange to a tolerance of their own.
        let tolerance = if kind == "cs" { 1e-12 } else { 1e-6 };
        for (column, ours) in head.iter().zip(&last).skip(1) {
            let column = column
                .split(" [")
                .next()
                .unwrap()
                .trim_start_matches("fmu.");
            let column = column.split(" [").next().unwrap();
            let Some(theirs) = theirs[column].as_f64() else {
                continue;
            };
            let ours: f64 = ours.parse().unwrap();
            let off = (ours - theirs).abs() / theirs.abs().max(1.0);
            assert!(off <= tolerance, "{name} {kind} {column}: {ours} {theirs}");
            compared += 1;
        }
    }
    assert!(compared > 60, "{compared}");
}

/// FMU, duration, step, measured signal, values that are sought, values that are known.
type Flight<'t> = (
    &'t str,
    [&'t str; 2],
    &'t str,
    &'t [(&'t str, f64)],
    &'t [(&'t str, f64)],
);

/// What the master flies with some parameters, the fit finds again: with directional derivatives and without, of both
/// versions of FMI.
#[test]
fn fmus_of_other_tools_are_fitted() {
    let (folder, _) = unpacked();
    let flights: [Flight<'_>; 4] = [
        (
            "reference3-VanDerPol.fmu",
            ["10", "0.1"],
            "x0",
            &[("mu", 2.3)],
            &[],
        ),
        (
            "reference2-Dahlquist.fmu",
            ["5", "0.1"],
            "x",
            &[("k", 0.7)],
            &[],
        ),
        // Before it bounces.
        (
            "reference3-BouncingBall.fmu",
            ["0.4", "0.02"],
            "h",
            &[("g", -9.5)],
            &[],
        ),
        (
            "openmodelica-Mass_Damper.fmu",
            ["2", "0.02"],
            "y",
            &[("damper.d", 14.0), ("spring.c", 800.0)],
            &[("mass.m", 1.7)],
        ),
    ];
    for (fmu, [stop, step], measured, sought, known) in flights {
        let own = format!("own={fmu}");
        let mut arguments = vec!["cosim", &own, "--stop-time", stop, "--step", step];
        arguments.extend([
            "--kind",
            "me",
            "--fmu-tolerance",
            "1e-10",
            "-o",
            "run.csv",
            "--force",
        ]);
        let set = sought
            .iter()
            .chain(known)
            .map(|(name, value)| format!("own.{name}={value}"));
        let set: Vec<String> = set.collect();
        arguments.extend(set.iter().flat_map(|set| ["--set", set]));
        let flown = folder.pilotage(&arguments);
        assert_eq!(flown.code, 0, "{flown:?}");
        let mut problem = format!(
            "[system.own]\nmodel = \"{fmu}\"\n[[measured]]\nsignal = \"own.{measured}\"\ncolumn = \"own.{measured}\"\n\
             sd = 0.001\n[[run]]\nfile = \"run.csv\"\n[parameters]\n"
        );
        for (name, _) in sought {
            writeln!(problem, "\"own.{name}\" = {{}}").unwrap();
        }
        for (name, value) in known {
            writeln!(
                problem,
                "\"own.{name}\" = {{ start = {value}, fixed = true }}"
            )
            .unwrap();
        }
        problem += "[fit]\nmesh_tolerance = 1e-8\nstarts = 1\n";
        folder.write("problem.toml", problem);
        let fitted = folder.pilotage(&["fit", "problem.toml", "--json", "--force"]);
        assert_eq!(fitted.code, 0, "{fmu}: {fitted:?}");
        let found = fitted.json();
        for (name, value) in sought {
            let found = found["parameters"][format!("own.{name}")]["value"]
                .as_f64()
                .unwrap();
            let error = (found / value - 1.0).abs();
            assert!(error < 1e-5, "{fmu}, {name}: {found} and not {value}");
        }
        assert_eq!(found["doubts"], serde_json::json!([]), "{fmu}");
    }
}
