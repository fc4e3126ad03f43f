//! The exported FMUs in fmpy, a tool that is not ours.

use crate::python;
use pilotage::export::{Provenance, export_pilot, export_quadcopter};
use pilotage::models::pilot::PAPER_THETA;
use pilotage::models::{Model, Quadcopter, Simulation};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Both FMUs in a folder.
fn fmus() -> (TempDir, PathBuf, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let pilot = folder.path().join("pilot.fmu");
    let quadcopter = folder.path().join("quadcopter.fmu");
    export_pilot(&PAPER_THETA, 1.0, &Provenance::paper(), &pilot).expect("the pilot");
    let provenance = Provenance::vehicle(None);
    export_quadcopter(&Quadcopter::default(), &provenance, &quadcopter).expect("the quadcopter");
    (folder, pilot, quadcopter)
}

#[test]
fn fmpy_finds_nothing_wrong() {
    let (_folder, pilot, quadcopter) = fmus();
    let printed = python::run("validate.py", [&pilot, &quadcopter]);
    let numbers: Vec<_> = printed
        .lines()
        .filter(|l| l.parse::<u32>().is_ok())
        .collect();
    assert_eq!(numbers, ["21", "30"], "{printed}");
}

/// Simulates in fmpy and with our own model, and compares every output at every point.
fn compare(fmu: &Path, model: Model, step: f64, settings: &[(&str, f64)]) {
    let stop = 15.0;
    let mut arguments = vec![
        fmu.display().to_string(),
        stop.to_string(),
        step.to_string(),
    ];
    arguments.extend(
        settings
            .iter()
            .map(|(name, value)| format!("{name}={value:?}")),
    );
    let printed = python::run("simulate.py", arguments);
    let mut simulation = Simulation::new(model);
    for (name, value) in settings {
        let index = simulation.model().index(name).expect("the variable exists");
        simulation.set(index, *value).expect("it can be set");
    }
    let rows: Vec<Vec<f64>> = printed
        .lines()
        .map(|line| {
            line.split(' ')
                .map(|v| v.parse().expect("a number"))
                .collect()
        })
        .collect();
    assert_eq!(rows.len(), (stop / step).round() as usize + 1);
    for (k, row) in rows.iter().enumerate() {
        assert!((row[0] - k as f64 * step).abs() < 1e-12 * stop);
        let outputs: Vec<f64> = simulation
            .model()
            .outputs()
            .map(|i| simulation.get(i))
            .collect();
        assert_eq!(row.len(), 1 + outputs.len());
        for (theirs, ours) in row[1..].iter().zip(&outputs) {
            let tolerance = 1e-12 * ours.abs().max(1.0);
            assert!(
                (theirs - ours).abs() <= tolerance,
                "at {} s: {theirs} {ours}",
                row[0]
            );
        }
        simulation.step(step).expect("the step is possible");
    }
    let moved = rows.first().map(|r| &r[1..]) != rows.last().map(|r| &r[1..]);
    assert!(moved, "nothing happened");
}

#[test]
fn pilot_in_fmpy_agrees_with_the_model() {
    let (_folder, pilot, _) = fmus();
    let model = || Model::pilot(&PAPER_THETA, 1.0);
    compare(
        &pilot,
        model(),
        0.05,
        &[("target", 10.0), ("position", 2.0)],
    );
    let settings = [
        ("x1_start", 1.0),
        ("theta3", 1.3),
        ("stick_limit", 0.2),
        ("target", 3.0),
    ];
    compare(&pilot, model(), 0.1, &settings);
}

#[test]
fn quadcopter_in_fmpy_agrees_with_the_model() {
    let (_folder, _, quadcopter) = fmus();
    let model = || Model::quadcopter(&Quadcopter::default());
    compare(&quadcopter, model(), 0.05, &[("stick", -0.3)]);
    let settings = [
        ("mass", 2.0),
        ("phi_start", 0.2),
        ("z_start", -1.0),
        ("stick", 0.1),
    ];
    compare(&quadcopter, model(), 0.25, &settings);
}
