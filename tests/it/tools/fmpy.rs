//! The exported FMUs in fmpy, a tool that is not ours: both versions, both kinds.

use super::python;
use pilotage::export::{Export, Provenance};
use pilotage::fmi::description::FmiVersion;
use pilotage::models::pilot::PAPER_THETA;
use pilotage::models::{Model, Quadcopter, Simulation};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const VERSIONS: [FmiVersion; 2] = [FmiVersion::V2, FmiVersion::V3];

fn pilot() -> Model {
    Model::pilot(&PAPER_THETA, 1.0)
}

fn quadcopter() -> Model {
    Model::quadcopter(&Quadcopter::default())
}

fn exported(folder: &TempDir, model: &Model, version: FmiVersion) -> PathBuf {
    let path = folder
        .path()
        .join(format!("{}-{version}.fmu", model.kind().name()));
    let provenance = Provenance::default();
    let export = Export::new(model, &provenance).version(version);
    export.write(&path).expect("it is exported");
    path
}

/// One of the examples of users' own models.
fn packed(folder: &TempDir, example: &str, version: FmiVersion) -> PathBuf {
    let path = folder.path().join(format!("{example}-{version}.fmu"));
    super::pack::packed(&crate::command::example(example), version, path)
}

/// FMI rules 1, 2, 5, 7 to 15 and 30: fmpy's schema and its own checks find nothing.
#[test]
fn fmpy_finds_nothing_wrong() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut fmus = Vec::new();
    for version in VERSIONS {
        fmus.extend([pilot(), quadcopter()].map(|model| exported(&folder, &model, version)));
        fmus.extend(["vehicle-fmu", "landing-fmu"].map(|name| packed(&folder, name, version)));
    }
    let printed = python::run("validate.py", &fmus);
    let numbers: Vec<_> = printed
        .lines()
        .filter(|l| l.parse::<u32>().is_ok())
        .collect();
    let expected = ["20", "29", "24", "30", "21", "30", "25", "31"];
    assert_eq!(numbers, expected, "{printed}");
}

/// What fmpy's simulation gives at the communication points, after events: time and outputs.
pub fn simulated(
    fmu: &Path,
    kind: &str,
    [stop, step]: [f64; 2],
    settings: &[(&str, f64)],
) -> Vec<Vec<f64>> {
    let mut arguments = vec![
        fmu.display().to_string(),
        kind.to_owned(),
        stop.to_string(),
        step.to_string(),
    ];
    let setting = |(name, value): &(&str, f64)| format!("{name}={value:?}");
    arguments.extend(settings.iter().map(setting));
    let rows: Vec<Vec<f64>> = python::run("simulate.py", arguments)
        .lines()
        .map(|line| {
            line.split(' ')
                .map(|v| v.parse().expect("a number"))
                .collect()
        })
        .collect();
    let n = (stop / step).round() as usize;
    let at = |k: usize| {
        let near = |row: &&Vec<f64>| (row[0] - k as f64 * step).abs() < 1e-9;
        let row = rows.iter().rev().find(near);
        row.unwrap_or_else(|| panic!("no row at {}", k as f64 * step))
            .clone()
    };
    (0..=n).map(at).collect()
}

/// Simulates in fmpy and with our own model, and compares every output at every point.
fn compare(model: &Model, step: f64, settings: &[(&str, f64)]) {
    let stop = 15.0;
    let mut simulation = Simulation::new(model.clone());
    for (name, value) in settings {
        let index = model.index(name).expect("the variable exists");
        simulation.set(index, *value).expect("it can be set");
    }
    let mut ours: Vec<Vec<f64>> = Vec::new();
    for _ in 0..=(stop / step).round() as usize {
        ours.push(model.outputs().map(|i| simulation.get(i)).collect());
        simulation.step(step).expect("the step is possible");
    }
    assert_ne!(ours.first(), ours.last(), "nothing happened");
    let folder = tempfile::tempdir().expect("a folder");
    for version in VERSIONS {
        let fmu = exported(&folder, model, version);
        for (kind, tolerance) in [("CoSimulation", 1e-12), ("ModelExchange", 1e-6)] {
            let rows = simulated(&fmu, kind, [stop, step], settings);
            assert_eq!(rows.len(), ours.len());
            for (row, ours) in rows.iter().zip(&ours) {
                assert_eq!(row.len(), 1 + ours.len());
                for (theirs, ours) in row[1..].iter().zip(ours) {
                    assert!(
                        (theirs - ours).abs() <= tolerance * ours.abs().max(1.0),
                        "FMI {version} {kind} at {} s: {theirs} {ours}",
                        row[0]
                    );
                }
            }
        }
    }
}

#[test]
fn pilot_in_fmpy_agrees_with_the_model() {
    compare(&pilot(), 0.05, &[("target", 10.0), ("position", 2.0)]);
    let settings = [
        ("x1_start", 1.0),
        ("theta3", 1.3),
        ("stick_limit", 0.2),
        ("target", 3.0),
    ];
    compare(&pilot(), 0.1, &settings);
}

#[test]
fn quadcopter_in_fmpy_agrees_with_the_model() {
    compare(&quadcopter(), 0.05, &[("stick", -0.3)]);
    let settings = [
        ("mass", 2.0),
        ("phi_start", 0.2),
        ("z_start", -1.0),
        ("stick", 0.1),
    ];
    compare(&quadcopter(), 0.25, &settings);
}

/// A user's model with events: it falls, bounces, and lies on the ground, whoever integrates it.
#[test]
fn a_users_model_in_fmpy_bounces_alike_in_all_versions_and_kinds() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = [("left", 4.0), ("right", 4.1), ("height_start", 2.0)];
    let run = |version, kind| {
        let fmu = packed(&folder, "landing-fmu", version);
        simulated(&fmu, kind, [4.0, 0.05], &settings)
    };
    let inside = run(FmiVersion::V2, "CoSimulation");
    assert_eq!(run(FmiVersion::V3, "CoSimulation"), inside);
    // The columns: time, x, height, pitch, power, and, behind the reals, landed.
    let height = |row: &Vec<f64>| row[2];
    let falls = inside.windows(2).map(|w| height(&w[1]) < height(&w[0]));
    let turns = falls.collect::<Vec<_>>();
    let bounces = turns.windows(2).filter(|w| w[0] && !w[1]).count();
    assert!(bounces >= 3, "{bounces} bounces");
    assert!(inside.iter().all(|row| height(row) >= -1e-9));
    let last = inside.last().expect("rows");
    assert_eq!((height(last), last[5]), (0.0, 1.0), "it lies");
    for version in VERSIONS {
        for (outside, inside) in run(version, "ModelExchange").iter().zip(&inside) {
            for (a, b) in outside.iter().zip(inside) {
                assert!(
                    (a - b).abs() < 1e-5,
                    "FMI {version}: {outside:?} {inside:?}"
                );
            }
        }
    }
}

/// The example of 30 lines, under a constant turning moment: what fmpy makes of it is the integral that it
/// has to be.
#[test]
fn the_small_vehicle_flies_in_fmpy_as_the_integral_says() {
    let folder = tempfile::tempdir().expect("a folder");
    let (left, right, stop) = (6.2, 6.1, 2.0);
    let turning = (left - right) * 0.16 / 0.0123;
    // The k-th quarter of a second by Simpson's rule: x = ∫ (t - s) T/m sin(ω̇ s²/2) ds, height likewise.
    let flown = |t: f64, force: fn(f64) -> f64, gravity: f64| {
        let n = 2000;
        let h = t / f64::from(n);
        let value = |i: i32| {
            let s = f64::from(i) * h;
            (t - s) * ((left + right) / 1.2 * force(turning * s * s / 2.0) - gravity)
        };
        let weight = |i: i32| match i {
            0 => 1.0,
            i if i == n => 1.0,
            i => f64::from(2 + 2 * (i % 2)),
        };
        h / 3.0 * (0..=n).map(|i| weight(i) * value(i)).sum::<f64>()
    };
    for version in VERSIONS {
        let fmu = packed(&folder, "vehicle-fmu", version);
        for (kind, tolerance) in [("CoSimulation", 1e-8), ("ModelExchange", 1e-4)] {
            let settings = [("left", left), ("right", right)];
            for row in simulated(&fmu, kind, [stop, 0.25], &settings) {
                let t = row[0];
                let exact = [
                    flown(t, f64::sin, 0.0),
                    1.0 + flown(t, f64::cos, 9.80665),
                    turning * t * t / 2.0,
                ];
                for (found, exact) in row[1..4].iter().zip(exact) {
                    let off = (found - exact).abs();
                    assert!(off < tolerance, "FMI {version} {kind} {t}: {row:?} {exact}");
                }
            }
        }
    }
}
