//! A Boolean variable of an exported model, `landed` of the example `landing-fmu`: in both versions of FMI, for
//! both kinds, in the commands.

use super::pack::packed;
use super::python;
use crate::command::{Folder, example};
use pilotage::fmi::description::{Causality, FmiVersion, Initial, Variability, VariableKind};
use pilotage::fmi::fmu::Library;
use pilotage::fmi::instance::Instance;
use pilotage::fmi::{CallError, Fmu, InterfaceType};

const VERSIONS: [FmiVersion; 2] = [FmiVersion::V2, FmiVersion::V3];
const KINDS: [InterfaceType; 2] = [InterfaceType::CoSimulation, InterfaceType::ModelExchange];

fn lander(version: FmiVersion) -> (Folder, Library) {
    let folder = Folder::new();
    let path = packed(&example("landing-fmu"), version, folder.path("lander.fmu"));
    (folder, Fmu::open(&path).unwrap().load().unwrap())
}

fn reference(library: &Library, name: &str) -> u32 {
    let (_, variable) = library.description().variable(name).unwrap();
    variable.value_reference
}

/// In initialization mode.
fn begun(library: &Library, kind: InterfaceType) -> Instance {
    let mut instance = library.instantiate("lander", kind).unwrap();
    instance.setup_experiment(None, 0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance
}

/// FMI rules 7 to 9: a discrete Boolean output with a start value, which is no state.
#[test]
fn a_mode_is_described_as_a_discrete_boolean() {
    for version in VERSIONS {
        let (_folder, library) = lander(version);
        let (_, landed) = library.description().variable("landed").unwrap();
        assert!(
            matches!(&landed.kind, VariableKind::Boolean { start, .. } if *start == [false]),
            "{landed:?}"
        );
        let found = (landed.causality, landed.variability, landed.initial);
        let expected = (
            Causality::Output,
            Variability::Discrete,
            Some(Initial::Exact),
        );
        assert_eq!(found, expected);
        for name in ["landed_start", "der(landed)"] {
            assert!(library.description().variable(name).is_none());
        }
    }
}

/// Set before the start it holds: what lies on the ground with little thrust stays there. Afterwards events alone
/// change it.
#[test]
fn a_mode_is_set_before_the_start_alone() {
    for version in VERSIONS {
        let (_folder, library) = lander(version);
        let [landed, height] = ["landed", "height"].map(|name| reference(&library, name));
        for kind in KINDS {
            let mut instance = begun(&library, kind);
            assert!(!instance.get_boolean(landed).unwrap());
            instance.set_boolean(landed, true).unwrap();
            assert!(instance.get_boolean(landed).unwrap());
            let saved = instance.save().unwrap();
            let bytes = instance.serialize(saved).unwrap();
            instance.set_boolean(landed, false).unwrap();
            let saved = instance.deserialize(&bytes).unwrap();
            instance.restore(saved).unwrap();
            assert!(instance.get_boolean(landed).unwrap(), "it is in the state");
            instance.exit_initialization_mode().unwrap();
            if kind == InterfaceType::CoSimulation {
                instance.do_step(0.0, 1.0).unwrap();
                let mut found = [f64::NAN];
                instance.get_real(&[height], &mut found).unwrap();
                assert_eq!(found, [1.0], "{version}: it does not fall");
            }
            let error = instance.set_boolean(landed, false).unwrap_err().to_string();
            assert!(
                error.contains("landed is changed by events alone and cannot be set"),
                "{error}"
            );
        }
    }
}

/// FMI rule 26: the functions of the other type refuse it, as those of its own refuse the real variables.
#[test]
fn functions_of_the_other_type_refuse() {
    type Call = fn(&mut Instance, u32, u32) -> Result<(), CallError>;
    let boolean = "landed is Boolean; use the functions for Boolean variables";
    let real = "height_start [m] is real; use the functions for real variables";
    let wrong: [(Call, &str); 6] = [
        (|i, landed, _| i.get_real(&[landed], &mut [0.0]), boolean),
        (|i, landed, _| i.set_real(&[landed], &[1.0]), boolean),
        (|i, _, start| i.get_boolean(start).map(|_| ()), real),
        (|i, _, start| i.set_boolean(start, true), real),
        (
            |i, landed, start| i.directional_derivative(&[landed], &[start], &[1.0], &mut [0.0]),
            "landed is not an unknown",
        ),
        (
            |i, landed, _| {
                let unknown = landed - 1;
                i.directional_derivative(&[unknown], &[landed], &[1.0], &mut [0.0])
            },
            "landed is not a known",
        ),
    ];
    for version in VERSIONS {
        let (_folder, library) = lander(version);
        let [landed, start] = ["landed", "height_start"].map(|name| reference(&library, name));
        for kind in KINDS {
            for (call, message) in wrong {
                let mut instance = begun(&library, kind);
                let error = call(&mut instance, landed, start).unwrap_err().to_string();
                assert!(error.contains(message), "{version} {kind:?}: {error}");
            }
        }
    }
}

/// The rows of a result: time, height, landed.
fn rows(csv: &str) -> Vec<[f64; 3]> {
    let rows = csv.lines().skip(1).map(|line| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        cells.try_into().unwrap()
    });
    rows.collect()
}

/// Results hold 0 and 1, at the times at which fmpy's do; a wire makes a number of it; it is no output of the linear
/// system.
#[test]
fn commands_take_a_mode_as_what_it_is() {
    for version in VERSIONS {
        let (folder, _library) = lander(version);
        let validated = folder.pilotage(&["validate", "--strict", "lander.fmu"]);
        assert_eq!(validated.code, 0, "{}", validated.stdout);
        let fly = [
            "cosim",
            "lander.fmu",
            "--record",
            "lander.height,lander.landed",
            "--stop-time",
            "2.5",
            "--step",
            "0.05",
            "-o",
            "r.csv",
        ];
        let flown = folder.pilotage(&fly);
        assert_eq!(flown.code, 0, "{flown:?}");
        let ours = rows(&folder.read("r.csv"));
        let path = folder.path("lander.fmu").display().to_string();
        let theirs = python::run("simulate.py", [&path, "CoSimulation", "2.5", "0.05"]);
        // The columns: time, the reals (x, height, pitch, power), the Booleans.
        let theirs = theirs.lines().map(|line| {
            let cells: Vec<f64> = line.split(' ').map(|cell| cell.parse().unwrap()).collect();
            [cells[0], cells[2], cells[5]]
        });
        let theirs: Vec<[f64; 3]> = theirs.collect();
        assert_eq!(ours.len(), theirs.len());
        for (ours, theirs) in ours.iter().zip(&theirs) {
            assert!((ours[1] - theirs[1]).abs() < 1e-12, "{ours:?} {theirs:?}");
            assert_eq!(ours[2], theirs[2], "{ours:?} {theirs:?}");
        }
        let landed: Vec<f64> = ours.iter().map(|row| row[2]).collect();
        assert!(landed.is_sorted() && landed[0] == 0.0 && landed.ends_with(&[1.0, 1.0]));
        // A wire makes a number of it: the stick goes to 1 when the lander lies.
        assert_eq!(folder.pilotage(&["export", "quadcopter"]).code, 0);
        let wire = "lander.landed=quadcopter.stick";
        let wired = [
            &fly[..2],
            &["quadcopter.fmu", "--connect", wire],
            &["--record", "quadcopter.phi,lander.landed"],
            &fly[4..],
        ];
        let wired = folder.pilotage(&wired.concat());
        assert_eq!(wired.code, 0, "{wired:?}");
        let moved = rows(&folder.read("r.csv"));
        assert!(
            moved
                .iter()
                .any(|[_, phi, landed]| *phi != 0.0 && *landed == 1.0)
        );
        assert!(
            moved
                .iter()
                .all(|[_, phi, landed]| *phi == 0.0 || *landed == 1.0)
        );
        let linear = folder.pilotage(&["linearize", "lander.fmu", "--csv", "m.csv"]);
        let matrices = folder.read("m.csv");
        assert!(
            matrices.contains("height") && !matrices.contains("landed"),
            "{linear:?} {matrices}"
        );
    }
}
