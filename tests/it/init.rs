//! What `pilotage init` writes is what `pilotage fit` takes.

use crate::command::{Folder, example};
use crate::foreign;
use pilotage::models::library;
use pilotage_expression::Model;
use pilotage_language::Compiled;

/// A run with columns for all inputs, outputs and states of a model, of small numbers that are not all the same.
fn run_of(model: &Model) -> String {
    let mut names: Vec<&String> = Vec::new();
    for name in model
        .inputs
        .iter()
        .chain(&model.outputs)
        .chain(&model.states)
    {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let names: Vec<&str> = names.into_iter().map(String::as_str).collect();
    let row = |k: usize| {
        let time = 0.1 * k as f64;
        let cells = (0..names.len()).map(|c| format!(",{}", 0.01 * ((k + c) % 5) as f64));
        format!("{time}{}\n", cells.collect::<String>())
    };
    format!("time,{}\n", names.join(",")) + &(0..6).map(row).collect::<String>()
}

/// Writes a problem for a run and a model, and has it read.
fn is_taken(folder: &Folder, words: &[&str]) -> String {
    let to = ["-o", "problem.toml", "--force"];
    let ended = folder.pilotage(&[&["init"], words, &to].concat());
    assert_eq!(ended.code, 0, "{words:?}: {ended:?}");
    let read = folder.pilotage(&["fit", "problem.toml", "--evaluate"]);
    let text = folder.read("problem.toml");
    assert_ne!(read.code, 2, "{words:?}: {read:?}\n{text}");
    text
}

/// The same for a model file, and for the FMU that it becomes.
fn are_taken(folder: &Folder, given: &str, model: &Model) {
    folder.write("run.csv", run_of(model));
    is_taken(folder, &["run.csv", "--model", given]);
    let exported = folder.pilotage(&["export", given, "-o", "own.fmu", "--force"]);
    assert_eq!(exported.code, 0, "{given}: {exported:?}");
    is_taken(folder, &["run.csv", "--model", "own.fmu"]);
}

#[test]
fn every_model_that_is_shipped_and_its_fmu_are_taken() {
    let folder = Folder::new();
    for model in library::all() {
        let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
        let compiled: Compiled = pilotage_language::parse(model.text, model.name, &none).unwrap();
        are_taken(&folder, model.name, &compiled.model);
    }
    for entry in std::fs::read_dir(example("models")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|end| end == "toml") {
            let compiled = pilotage_language::read(&path).unwrap();
            are_taken(&folder, &path.display().to_string(), &compiled.model);
        }
    }
}

#[test]
fn every_pilot_and_vehicle_that_is_shipped_is_taken_in_a_loop() {
    let folder = Folder::new();
    let run = example("trials").join("10m-run1.csv").display().to_string();
    let flown = |model: &&library::BuiltIn| model.kind != library::Kind::Helicopter;
    for model in library::all().iter().filter(flown) {
        let role = match model.kind {
            library::Kind::Pilot => "--pilot",
            _ => "--vehicle",
        };
        is_taken(&folder, &[&run, role, model.name]);
    }
}

const TANK: &str = "[model]\nname = \"tank\"\n[parameters]\nrate = 1\nidle = 2\n[states]\n\
                    x = { start = 1, unit = \"m\", der = \"-rate * x\" }\n\
                    [outputs]\nx = {}\ndouble = { value = \"2 * x\", unit = \"m\" }\n";

#[test]
fn what_a_fit_refuses_is_a_comment() {
    let folder = Folder::new();
    folder.write("tank.toml", TANK);
    folder.write(
        "run.csv",
        "time,x [kg],double [cm]\n0,1,200\n1,0.5,100\n2,0.2,40\n",
    );
    let text = is_taken(&folder, &["run.csv", "--model", "tank.toml"]);
    for lines in [
        "# run.csv: the column `x` is in kg; expected a unit of m:\n# [[measured]]\n# signal = \"model.x\"\n",
        "\n[[measured]]\nsignal = \"model.double\"\n",
        "# no measured signal depends on `model.idle`; leave it out, or write fixed = true:\n# \"model.idle\" = ",
        "\n\"model.rate\" = ",
    ] {
        assert!(text.contains(lines), "{lines}\n{text}");
    }
    folder.write("run.csv", "time,x [kg]\n0,1\n1,0.5\n");
    let ended = folder.pilotage(&["init", "run.csv", "--model", "tank.toml"]);
    let why = "error: run.csv: the column `x` is in kg; expected a unit of m\n";
    assert_eq!((ended.code, ended.stderr.as_str()), (2, why));
}

#[test]
fn what_is_no_model_is_told() {
    let folder = Folder::new();
    folder.write("run.csv", "time,x0,y\n0,1,1\n1,0.5,0.5\n");
    let ended = folder.pilotage(&["init", "run.csv", "--pilot", "crosover"]);
    let why = "error: `crosover` is neither a file nor a built-in model; did you mean `crossover`?\nhint: `pilotage models` \
               lists the built-in ones\n";
    assert_eq!((ended.code, ended.stderr.as_str()), (2, why));
}

#[test]
fn an_fmu_that_a_fit_refuses_is_refused() {
    let folder = Folder::new();
    folder.write("run.csv", "time,x0,y\n0,1,1\n1,0.5,0.5\n");
    for (fmu, why) in [
        (foreign::fmu("good"), "it is not for model exchange"),
        (
            foreign::model_exchange("endless", 0, 0),
            "it gives no values at its start",
        ),
    ] {
        folder.write("own.fmu", fmu);
        let ended = folder.pilotage(&["init", "run.csv", "--model", "own.fmu"]);
        assert_eq!((ended.code, ended.stdout.as_str()), (2, ""), "{ended:?}");
        assert!(ended.stderr.contains(why), "{ended:?}");
    }
}

const PILOT: &str = "[model]\nname = \"pilot\"\n[inputs]\ntarget = {}\nbank = {}\n[parameters]\ngain = { start = 1, min = 0 }\n\
                     [outputs]\nroll = \"gain * (target - bank)\"\n";
const ROLL: &str = "[model]\nname = \"roll\"\n[inputs]\nroll = {}\n[states]\nbank.der = \"roll\"\n";

/// Pilot and vehicle share `roll` and `bank`; the target jumps at 1 s. `bank = 1 - e^{-2 (t - 1)}` from there.
#[test]
fn what_has_one_name_is_connected_and_a_target_that_jumps_is_no_line() {
    let folder = Folder::new();
    folder.write("pilot.toml", PILOT);
    folder.write("roll.toml", ROLL);
    let row = |k: usize| {
        let time = 0.1 * k as f64;
        let since = (time - 1.0).max(0.0);
        format!(
            "{time},{},{}\n",
            u8::from(k >= 10),
            1.0 - (-2.0 * since).exp()
        )
    };
    folder.write(
        "run.csv",
        "time,target,bank\n".to_owned() + &(0..40).map(row).collect::<String>(),
    );
    let models = ["--pilot", "pilot.toml", "--vehicle", "roll.toml"];
    let text = is_taken(&folder, &[&["run.csv"], &models[..]].concat());
    for lines in [
        "\"pilot.roll\" = \"vehicle.roll\"\n\"vehicle.bank\" = \"pilot.bank\"\n",
        "\"pilot.target\" = { column = \"target\", hold = \"zero-order\" } ",
    ] {
        assert!(text.contains(lines), "{lines}\n{text}");
    }
    let fitted = |text: &str| {
        folder.write("problem.toml", text);
        let json = folder
            .pilotage(&["fit", "problem.toml", "--json", "--force"])
            .json();
        let doubts = json["doubts"].as_array().unwrap();
        let is_told = doubts.iter().any(|own| own["code"] == "stepped-input");
        (
            json["parameters"]["pilot.gain"]["value"].as_f64().unwrap(),
            is_told,
        )
    };
    let (gain, is_told) = fitted(&text);
    assert!((gain - 2.0).abs() < 1e-4 && !is_told, "{gain}");
    let line = text.replace(
        "{ column = \"target\", hold = \"zero-order\" }",
        "\"target\"",
    );
    let (gain, is_told) = fitted(&line);
    assert!((gain - 2.0).abs() > 1e-2 && is_told, "{gain}");
    let said = text.replace("zero-order", "linear");
    assert!(!fitted(&said).1);
    // A gap in what alone drives the loop leaves no problem; what is written by hand then is no answer.
    let row = |k: usize| match k {
        15..30 => format!("{},,0\n", 0.1 * k as f64),
        _ => format!("{0},{0},{0}\n", 0.1 * k as f64),
    };
    folder.write(
        "gap.csv",
        "time,target,bank\n".to_owned() + &(0..40).map(row).collect::<String>(),
    );
    let ended = folder.pilotage(&[&["init", "gap.csv", "-o", "gap.toml"], &models[..]].concat());
    let why = "error: gap.csv: the column `target` is empty from 1.4000000000000001 to 3 s";
    assert!(ended.stderr.starts_with(why), "{ended:?}");
    assert_eq!(ended.code, 2);
    assert!(!folder.path("gap.toml").exists());
    let undriven = text.replace("\"pilot.target\"", "# \"pilot.target\"");
    folder.write("gap.toml", undriven.replace("run.csv", "gap.csv"));
    let ended = folder.pilotage(&["fit", "gap.toml", "--force", "--json"]);
    let why = "note: nothing drives `pilot.target`, which keeps its start value: ";
    assert!(ended.stderr.contains(why), "{ended:?}");
    let json = ended.json();
    assert_eq!(
        (ended.code, &json["status"]),
        (1, &"nothing-explained".into())
    );
}

/// A parameter, a state and an input that are called as start values of states are variables like others, in a model file and in
/// the FMU of it.
#[test]
fn names_that_end_in_start_are_names() {
    let folder = Folder::new();
    let model = |name: &str, lines: &str| {
        folder.write(
            &format!("{name}.toml"),
            format!("[model]\nname = \"{name}\"\n{lines}"),
        );
    };
    model(
        "a",
        "[parameters]\nx_start = 2\nk = 0.5\n[states]\nx = { start = \"x_start\", der = \"-k * x\" }\n[outputs]\nx = {}\n",
    );
    model(
        "b",
        "[parameters]\nk = 0.5\n[states]\nx = { start = 2, der = \"-k * x\" }\nx_start = { start = 3, der = \"-k * x_start\" }\n[outputs]\nx = {}\n",
    );
    model(
        "c",
        "[inputs]\nx_start = {}\n[parameters]\nk = 0.5\n[states]\nx = { start = 2, der = \"x_start - k * x\" }\n[outputs]\nx = {}\n",
    );
    // With k = 0.7 and without any input.
    let row = |k: u32| {
        let t = 0.1 * f64::from(k);
        format!("{t},{}\n", 2.0 * (-0.7 * t).exp())
    };
    let rows: String = (0..40).map(row).collect();
    folder.write("run.csv", format!("time,x\n{rows}"));
    for name in ["a", "b", "c"] {
        let (file, fmu) = (format!("{name}.toml"), format!("{name}.fmu"));
        let exported = folder.pilotage(&["export", &file, "-o", &fmu]);
        assert_eq!(exported.code, 0, "{exported:?}");
        let valid = folder.pilotage(&["validate", &fmu]);
        assert_eq!(valid.code, 0, "{valid:?}");
        for given in [&file, &fmu] {
            is_taken(&folder, &["run.csv", "--model", given]);
            let json = folder
                .pilotage(&["fit", "problem.toml", "--json", "--force"])
                .json();
            let sought = json["parameters"].as_object().unwrap();
            let k = sought["model.k"]["value"].as_f64().unwrap();
            assert!((k - 0.7).abs() < 1e-5, "{given}: {json}");
            let expected = if name == "a" { 2 } else { 1 };
            assert_eq!(sought.len(), expected, "{given}: {json}");
        }
        // The start value of the state: 2 at first, and 5.
        for (set, first) in [("k=0.5", 2.0), ("x.start=5", 5.0)] {
            let ended = folder.pilotage(&[
                "cosim",
                &fmu,
                "--set",
                &format!("{name}.{set}"),
                "--stop-time",
                "1",
                "--step",
                "1",
                "-o",
                "o.csv",
                "--force",
            ]);
            assert_eq!(ended.code, 0, "{ended:?}");
            let series = pilotage::series::Series::read(&folder.path("o.csv")).unwrap();
            let x = series.column(&format!("{name}.x"));
            assert!(x.is_some_and(|x| x.values[0] == first), "{set}");
        }
    }
}
