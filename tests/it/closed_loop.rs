//! The whole loop of exported FMUs: our master against fmpy's doStep, and against the joint equations.

use crate::command::Folder;
use crate::python;
use pilotage::cosim::{
    Algorithm, Clock, Control, Coupling, FmuSlave, NativeSlave, SeriesRecorder, Slave, System, run,
};
use pilotage::export::{Provenance, export};
use pilotage::models::{Model, Quadcopter};

/// A pilot who brings the vehicle to its target.
const THETA: [f64; 6] = [0.3, 1.2, 1.0, -0.006, -0.03, -0.04];

fn folder_with_fmus() -> Folder {
    let folder = Folder::new();
    let provenance = Provenance::fit("nobody.toml".to_owned(), true);
    export(
        &Model::pilot(&THETA, 1.0),
        &provenance,
        &folder.path("pilot.fmu"),
    )
    .unwrap();
    let vehicle = Model::quadcopter(&Quadcopter::default());
    export(
        &vehicle,
        &Provenance::vehicle(None),
        &folder.path("quadcopter.fmu"),
    )
    .unwrap();
    folder
}

/// The issue's own command.
fn simulate(folder: &Folder, algorithm: &str) {
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
        "--algorithm",
        algorithm,
        "-o",
        "result.csv",
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

/// What the native slaves' convergence to the joint equations shows (`cosim::joint`) then holds for the
/// FMUs.
#[test]
fn fmus_and_native_slaves_give_the_same_bits() {
    let folder = folder_with_fmus();
    let clock = Clock::new(0.0, 15.0, 0.05).unwrap();
    let controlled = Coupling {
        control: Some(Control::new(1e-6, &clock)),
        ..Algorithm::Strong.into()
    };
    let extrapolated = Coupling {
        extrapolation: Some(2),
        ..Algorithm::GaussSeidel.into()
    };
    for coupling in [
        Algorithm::Jacobi.into(),
        Algorithm::Strong.into(),
        extrapolated,
        controlled,
    ] {
        let slaves: [[Box<dyn Slave>; 2]; 2] = [
            ["pilot", "quadcopter"].map(|name| {
                let path = folder.path(&format!("{name}.fmu"));
                Box::new(FmuSlave::open(&path, name).unwrap()) as Box<dyn Slave>
            }),
            [
                Model::pilot(&THETA, 1.0),
                Model::quadcopter(&Quadcopter::default()),
            ]
            .map(|model| Box::new(NativeSlave::new(model)) as Box<dyn Slave>),
        ];
        let [fmus, natives] = slaves.map(|[pilot, quadcopter]| {
            let mut system = System::new();
            system.add("pilot", pilot).unwrap();
            system.add("quadcopter", quadcopter).unwrap();
            system.connect("pilot.stick", "quadcopter.stick").unwrap();
            system.connect("quadcopter.z", "pilot.position").unwrap();
            system.set("pilot.target", "10").unwrap();
            let mut recorder = SeriesRecorder::default();
            let run = run(system, &clock, Some(1e-9), coupling, &mut recorder).unwrap();
            assert_eq!(run.report.irrevocable, Vec::<String>::new());
            (run.report.steps, recorder.series)
        });
        assert_eq!(fmus.1.time.len(), 301);
        assert_eq!(fmus.0, natives.0, "{coupling:?}");
        if coupling.control.is_none() {
            assert_eq!(fmus.1, natives.1, "{coupling:?}");
        }
        // An FMU takes a step's length from its own clock, which rounds.
        for (fmu, native) in fmus.1.columns.iter().zip(&natives.1.columns) {
            for (fmu, native) in fmu.values.iter().zip(&native.values) {
                assert!((fmu - native).abs() < 1e-9, "{coupling:?}: {fmu} {native}");
            }
        }
    }
}

#[test]
fn exported_fmus_are_valid_and_run() {
    let folder = folder_with_fmus();
    let ended = folder.pilotage(&["validate", "pilot.fmu", "quadcopter.fmu"]);
    assert_eq!(
        ended.stdout,
        "pilot.fmu: valid, and runs\nquadcopter.fmu: valid, and runs\n"
    );
    assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
}
