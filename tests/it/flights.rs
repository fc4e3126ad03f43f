//! The problem that flights pose in memory is the one that `pilotage init` writes; pilot and vehicle files are models in problems.

use crate::command::{Folder, example};
use crate::fitted::{fitted, theta, with};
use pilotage::estimation::file::{Limits, Options};
use pilotage::estimation::{Posed, ProblemFile};
use pilotage::flights::options::{InitialPosition, InitialState, Objective};
use pilotage::flights::trials::ColumnNames;
use pilotage::flights::{FlightOptions, TrialSet, open};

/// The objective of the shipped flights.
const OBJECTIVE: f64 = 258.505_967;

fn shipped() -> TrialSet {
    TrialSet::read(&[example("trials/trials.toml")]).unwrap()
}

/// The stick saturates at its limit, or is held within it as in the paper.
#[test]
fn the_limit_of_the_stick_is_a_constraint_where_that_is_asked_for() {
    let set = shipped();
    for (limits, expected) in [
        (Limits::Saturate, vec![]),
        (Limits::Constrain, vec![[-0.7, 0.7]]),
    ] {
        let options = with(|own| {
            own.stick_limit = 0.7;
            own.fit.limits = limits;
        });
        let file = options.problem(&set).unwrap();
        let posed = Posed::new(&file, &open).unwrap();
        let bounds: Vec<_> = posed
            .bounds
            .iter()
            .map(|own| [own.lower, own.upper])
            .collect();
        assert_eq!(bounds, expected);
    }
}

/// What is known of each state of vehicle and pilot at the first sample, for each thing that may be said of it.
#[test]
fn what_is_said_of_the_start_is_known_of_the_states() {
    let set = shipped();
    for initial_state in InitialState::ALL {
        for initial_position in InitialPosition::ALL {
            for objective in Objective::ALL {
                let options = with(|own| {
                    own.initial_state = initial_state;
                    own.initial_position = initial_position;
                    own.objective = objective;
                });
                let what = format!("{initial_state:?}, {initial_position:?}, {objective:?}");
                let file = options.problem(&set).unwrap();
                let posed = Posed::new(&file, &open).unwrap();
                let is_free = |name: &str| {
                    let k = posed.joint.model.states.iter().position(|own| own == name);
                    k.map(|k| posed.runs[0].initial[k].is_none())
                };
                let of_pilot = initial_state != InitialState::AtRest;
                assert_eq!(is_free("pilot.x1"), Some(of_pilot), "{what}");
                let of_vehicle = initial_state == InitialState::Free;
                let is_known = initial_position == InitialPosition::Known && !of_vehicle;
                let expected = match objective {
                    Objective::Response => [Some(!is_known), Some(of_vehicle)],
                    Objective::Stick => [None; 2],
                };
                assert_eq!(
                    [is_free("vehicle.z"), is_free("vehicle.v")],
                    expected,
                    "{what}"
                );
                let is_closed = file.stability.closed_loop.is_some();
                assert_eq!(is_closed, objective == Objective::Response, "{what}");
                let bounds: Vec<_> = posed
                    .bounds
                    .iter()
                    .map(|own| [own.lower, own.upper])
                    .collect();
                assert!(bounds.is_empty(), "{what}");
            }
        }
    }
}

#[test]
fn weights_validation_and_missing_cells_stand_in_the_problem_of_flights() {
    let folder = Folder::new();
    for run in ["10m-run1.csv", "10m-run2.csv", "20m-run1.csv"] {
        let text = std::fs::read_to_string(example("trials").join(run)).unwrap();
        folder.write(run, text.replace("position [m]", "height [m]"));
    }
    folder.write(
        "all.toml",
        "[[run]]\nfile = \"10m-run1.csv\"\nweight = 2.5\n[[run]]\nfile = \"10m-run2.csv\"\nuse = \"validation\"\n\
         [[run]]\nfile = \"20m-run1.csv\"\n",
    );
    let columns = ColumnNames::new(&[("position".into(), "height".into())]).unwrap();
    let mut set = TrialSet::read_with(&[folder.path("all.toml")], &columns).unwrap();
    for k in [0, 1, 2, 57, 58, 300] {
        set.fit[0].position[k] = f64::NAN;
    }
    for initial_position in InitialPosition::ALL {
        for objective in Objective::ALL {
            let flights = FlightOptions {
                initial_position,
                objective,
                columns: columns.clone(),
                ..FlightOptions::default()
            };
            let file = flights.problem(&set).unwrap();
            let runs = file.runs.iter();
            let runs: Vec<(&str, bool, f64)> = runs
                .map(|own| (own.name.as_str(), own.fits, own.weight))
                .collect();
            let expected = [
                ("10m-run1", true, 2.5),
                ("20m-run1", true, 1.0),
                ("10m-run2", false, 1.0),
            ];
            assert_eq!(runs, expected);
        }
    }
}

/// The optimum is that of every start, and the problem stays there.
#[test]
fn the_optimum_of_the_shipped_flights_is_known() {
    let set = shipped();
    let found = fitted(&set.fit, &FlightOptions::default());
    assert!(found.is_answer(), "{}", found.verdict());
    assert_eq!(found.agreeing(), found.starts.len());
    let off = |objective: f64| (objective / OBJECTIVE - 1.0).abs();
    assert!(off(found.objective) < 1e-8, "{}", found.objective);
    let again = with(|own| {
        own.theta = Some(theta(&found));
        own.fit.starts = Some(1);
    });
    let again = fitted(&set.fit, &again);
    assert!(off(again.objective) < 1e-8, "{}", again.objective);
    for (own, theta) in theta(&again).into_iter().zip(theta(&found)) {
        assert!((own / theta - 1.0).abs() < 1e-3, "{own} and {theta}");
    }
}

#[test]
fn what_init_writes_is_the_problem_of_flights_but_for_its_mesh() {
    let set = shipped();
    let folder = Folder::new();
    let runs: Vec<String> = set.fit.iter().map(|own| own.origin.clone()).collect();
    let words: Vec<&str> = ["init"]
        .into_iter()
        .chain(runs.iter().map(String::as_str))
        .collect();
    let ended = folder.pilotage(&words);
    assert_eq!(ended.code, 0, "{ended:?}");
    let flights = FlightOptions {
        fit: Options::default(),
        ..FlightOptions::default()
    };
    let file: ProblemFile = flights.problem(&set).unwrap();
    assert_eq!(ended.stdout, file.text);
    // The same flights, listed.
    let listed = example("trials/trials.toml").display().to_string();
    assert_eq!(folder.pilotage(&["init", &listed]).stdout, file.text);
    let run = |more: &str| format!("[[run]]\nfile = \"run.csv\"\n{more}");
    for (file, flight) in [("some/run.csv", "10m-run1"), ("others/run.csv", "10m-run2")] {
        let path = example("trials").join(flight).with_extension("csv");
        folder.write(file, std::fs::read(path).unwrap());
    }
    folder.write("some/all.toml", run("weight = 2\n"));
    folder.write(
        "others/all.toml",
        run("") + &run("use = \"validation\"\n").replace("run.csv", "../some/run.csv"),
    );
    for (list, lines) in [
        (
            "some/all.toml",
            "[[run]]\nfile = \"some/run.csv\"\nweight = 2.0\n",
        ),
        (
            "others/all.toml",
            "[[run]]\nfile = \"others/../some/run.csv\"\nuse = \"validation\"\n",
        ),
    ] {
        let written = folder.pilotage(&["init", list]);
        assert!(written.stdout.contains(lines), "{written:?}");
    }
}

const PILOT: &str = "# A pilot: by hand\nstick_limit = 0.9\n[theta]\ntheta1 = 0.25\ntheta2 = 1.25\ntheta3 = 1.0\n\
                     theta4 = -0.005\ntheta5 = -0.028\ntheta6 = -0.042\n";

/// A problem of the shipped flights with these models.
fn problem_of(pilot: &str, vehicle: &str, parameters: &str) -> String {
    let run = example("trials").join("10m-run1.csv");
    format!(
        "[system.pilot]\nmodel = {pilot}\n[system.vehicle]\nmodel = {vehicle}\n[connect]\n\
         \"pilot.stick\" = \"vehicle.stick\"\n\"vehicle.z\" = \"pilot.position\"\n[inputs]\n\"pilot.target\" = \"target\"\n\
         [[measured]]\nsignal = \"vehicle.z\"\ncolumn = \"position\"\n[parameters]\n{parameters}\n[[run]]\nfile = {:?}\n\
         [fit]\nstarts = 1\n",
        run.display().to_string()
    )
}

#[test]
fn pilot_and_vehicle_files_are_the_built_in_models_with_their_values() {
    let folder = Folder::new();
    folder.write("pilot.toml", PILOT);
    let shown = folder.pilotage(&["vehicle", "show"]);
    folder.write(
        "vehicle.toml",
        shown.stdout.replace("mass = 1.2", "mass = 1.5"),
    );
    let values = "set = { theta1 = 0.25, theta2 = 1.25, theta3 = 1.0, theta4 = -0.005, theta5 = -0.028, theta6 = -0.042, \
                  stick_limit = 0.9 }";
    let all = "\"pilot.*\" = {}";
    folder.write(
        "built_in.toml",
        problem_of(
            &format!("\"linear\"\n{values}"),
            "\"quadcopter\"\nset = { mass = 1.5 }",
            all,
        ),
    );
    folder.write(
        "files.toml",
        problem_of("\"pilot.toml\"", "\"vehicle.toml\"", all),
    );
    let [built_in, files] = ["built_in.toml", "files.toml"].map(|problem| {
        let ended = folder.pilotage(&["fit", problem, "--evaluate", "--json"]);
        assert_eq!(ended.code, 0, "{ended:?}");
        let note = "note: nothing measured depends on `pilot.stick_limit`, which is not sought\n";
        assert_eq!(ended.stderr, note);
        ended.json()
    });
    assert_eq!(built_in, files);
    assert_eq!(files["left_out"], serde_json::json!(["pilot.stick_limit"]));
    let gradient = files["gradient"].as_object().unwrap();
    let names: Vec<&str> = gradient.keys().map(String::as_str).collect();
    let theta = [1, 2, 3, 4, 5, 6].map(|k| format!("pilot.theta{k}"));
    assert_eq!(names, theta);
    // The same where all that the pattern seeks starts at values that the command gives.
    let start = "--start=0.25,1.25,1,-0.005,-0.028,-0.042";
    let begun = folder.pilotage(&["fit", "files.toml", "--evaluate", "--json", start]);
    assert_eq!(begun.json(), files);

    let written = folder.pilotage(&[
        "init",
        example("trials").join("10m-run1.csv").to_str().unwrap(),
        "--pilot",
        "pilot.toml",
        "--vehicle",
        "vehicle.toml",
        "-o",
        "written.toml",
    ]);
    assert_eq!(written.code, 0, "{written:?}");
    let text = folder.read("written.toml");
    for line in [
        "model = \"pilot.toml\"",
        "model = \"vehicle.toml\"",
        "\"pilot.theta4\" = { start = -0.005 }",
        "\"pilot.stick_limit\" = { start = 0.9, fixed = true }",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
    assert_eq!(
        folder.pilotage(&["fit", "written.toml", "--evaluate"]).code,
        0
    );
}

#[test]
fn a_mistake_in_a_pilot_or_vehicle_file_of_a_problem_is_told_with_its_line() {
    let folder = Folder::new();
    let evaluate = |pilot: &str| {
        folder.write("pilot.toml", pilot);
        folder.write(
            "p.toml",
            problem_of("\"pilot.toml\"", "\"quadcopter\"", "\"pilot.theta1\" = {}"),
        );
        let ended = folder.pilotage(&["fit", "p.toml", "--evaluate"]);
        (ended.code, ended.stderr)
    };
    let theta: String = (1..=26).map(|k| format!("theta{k} = 1.0\n")).collect();
    for (pilot, error) in [
        (
            PILOT.replace("theta6 = -0.042\n", ""),
            "error: pilot.toml:3: [theta] has 5 parameters; a pilot of order n has 2n: theta1 to theta2n\n".to_owned(),
        ),
        (
            format!("[theta]\n{theta}"),
            "error: pilot.toml: a pilot of order 13 cannot run; the highest order is 12\n".to_owned(),
        ),
    ] {
        assert_eq!(evaluate(&pilot), (2, error));
    }
    folder.write("vehicle.toml", "mass = 1.2\n");
    folder.write(
        "p.toml",
        problem_of("\"linear\"", "\"vehicle.toml\"", "\"pilot.theta1\" = {}"),
    );
    let ended = folder.pilotage(&["fit", "p.toml", "--evaluate"]);
    assert_eq!(ended.code, 2, "{ended:?}");
    assert!(ended.stderr.starts_with("error: vehicle.toml"), "{ended:?}");
}

#[test]
fn a_pattern_of_which_nothing_is_needed_is_a_mistake() {
    let folder = Folder::new();
    let model = "[model]\nname = \"tank\"\n[parameters]\nrate = 1\nidle = 2\n[states]\nx = { start = 1, der = \"-rate * x\" }\n";
    folder.write("tank.toml", model);
    folder.write("run.csv", "time,x\n0,1\n1,0.5\n2,0.2\n3,0.1\n");
    let problem = |instance: &str, more: &str| {
        format!(
            "[system.a]\nmodel = \"tank.toml\"\n[system.b]\nmodel = \"tank.toml\"\n[[measured]]\nsignal = \"a.x\"\n\
             column = \"x\"\n[parameters]\n\"{instance}.*\" = {{ start = 3 }}\n{more}[[run]]\nfile = \"run.csv\"\n"
        )
    };
    folder.write("p.toml", problem("b", "\"a.rate\" = {}\n"));
    let ended = folder.pilotage(&["fit", "p.toml", "--evaluate"]);
    let error = "error: p.toml:9:1: no measured signal depends on `b.rate`; leave it out, or write fixed = true\n";
    assert_eq!((ended.code, ended.stderr.as_str()), (2, error));

    folder.write("p.toml", problem("a", ""));
    let ended = folder.pilotage(&["fit", "p.toml", "--json", "-o", "a-fitted.toml"]);
    assert_eq!(ended.code, 0, "{ended:?}");
    let fit = ended.json();
    assert_eq!(fit["left_out"], serde_json::json!(["a.idle"]));
    assert_eq!(fit["parameters"].as_object().unwrap().len(), 1);
    // What is left out keeps the model's value, whatever the pattern says.
    assert!(folder.read("a-fitted.toml").contains("idle = 2\n"));
}

#[test]
fn the_folder_of_several_fitted_models_is_made() {
    let folder = Folder::new();
    folder.write("pilot.toml", PILOT);
    let parameters = "\"pilot.theta4\" = {}\n\"vehicle.mass\" = {}";
    folder.write(
        "p.toml",
        problem_of("\"pilot.toml\"", "\"quadcopter\"", parameters),
    );
    let fit =
        |output: &str| folder.pilotage(&["fit", "p.toml", "--time-limit", "60", "-o", output]);
    let ended = fit("one.toml");
    let error = "error: 2 models are fitted, and one.toml is one file\nhint: give -o a folder\n";
    assert_eq!((ended.code, ended.stderr.as_str()), (2, error));
    let ended = fit("new/folder");
    assert_ne!(ended.code, 2, "{ended:?}");
    for name in ["pilot", "vehicle"] {
        let text = folder.read(&format!("new/folder/{name}-fitted.toml"));
        assert!(text.starts_with("# Fitted by pilotage"), "{text}");
    }
}
