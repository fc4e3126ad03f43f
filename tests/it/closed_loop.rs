//! The whole loop of exported FMUs: our master against fmpy's doStep, and against the joint equations.

use crate::command::Folder;
use crate::python;
use pilotage::export::{Provenance, export};
use pilotage::models::{Model, Quadcopter};

/// A pilot who brings the vehicle to its target.
const THETA: [f64; 6] = [0.3, 1.2, 1.0, -0.006, -0.03, -0.04];

fn folder_with_fmus() -> Folder {
    let folder = Folder::new();
    let provenance = Provenance::fit("nobody.toml".to_owned(), true);
    export(&Model::pilot(&THETA, 1.0), &provenance, &folder.path("pilot.fmu")).unwrap();
    let vehicle = Model::quadcopter(&Quadcopter::default());
    export(&vehicle, &Provenance::vehicle(None), &folder.path("quadcopter.fmu")).unwrap();
    folder
}

/// The issue's own command.
fn simulate(folder: &Folder, algorithm: &str) {
    let ended = folder.pilotage(&[
        "cosim", "pilot.fmu", "quadcopter.fmu", "--connect", "pilot.stick=quadcopter.stick", "--connect",
        "quadcopter.z=pilot.position", "--set", "pilot.target=10", "--stop-time", "15", "--step",
        "0.05", "--algorithm", algorithm, "-o", "result.csv",
    ]);
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
}

#[test]
fn fmpy_closes_the_loop_to_the_same_numbers_and_reads_our_csv() {
    let folder = folder_with_fmus();
    for algorithm in ["jacobi", "gauss-seidel"] {
        simulate(&folder, algorithm);
        let file = |name: &str| folder.path(name).into_os_string();
        let printed = python::run(
            "closed_loop.py",
            [
                file("pilot.fmu"),
                file("quadcopter.fmu"),
                file("result.csv"),
                algorithm.into(),
                "10".into(),
                "15".into(),
                "0.05".into(),
            ],
        );
        let difference: f64 = printed.trim().parse().unwrap();
        assert!(difference < 1e-12, "{algorithm}: {difference}");
    }
}

#[test]
fn exported_fmus_are_valid_and_run() {
    let folder = folder_with_fmus();
    let ended = folder.pilotage(&["validate", "pilot.fmu", "quadcopter.fmu"]);
    assert_eq!(ended.stdout, "pilot.fmu: valid, and runs\nquadcopter.fmu: valid, and runs\n");
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
}
