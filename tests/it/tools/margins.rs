//! Margins of fitted loops, their standard deviations and Bode plots, against python-control.

use super::python;
use crate::command::{CONNECTIONS, Folder, example};
use serde_json::Value;

#[test]
fn margins_of_fits_are_those_of_python_control() {
    let folder = Folder::new();
    let trials = example("trials/trials.toml").to_str().unwrap().to_owned();
    let write = |name: &str, arguments: &[&str]| {
        let ended = folder.pilotage(arguments);
        assert_eq!(ended.code, 0, "{ended:?}");
        folder.write(name, ended.stdout);
    };
    write("vehicle.toml", &["vehicle", "show"]);
    write(
        "short.json",
        &["fit", &trials, "--json", "--covariance", "ar"],
    );
    let problem = ["fit", "problem.toml", "--json", "-o", "model.toml"];
    let runs = ["10m-run1", "10m-run2", "20m-run1", "20m-run2"];
    let runs = runs.map(|run| example(&format!("trials/{run}.csv")));
    let runs = runs.each_ref().map(|run| run.to_str().unwrap());
    write(
        "init.txt",
        &[&["init", "-o", "problem.toml"], &runs[..]].concat(),
    );
    write("problem.json", &problem);
    let cut = ["--loop", "pilot.stick=quadcopter.stick", "--json"];
    let linearize = ["linearize", "pilot=pilot.toml", "quadcopter=vehicle.toml"];
    write("loop.json", &[&linearize[..], &CONNECTIONS, &cut].concat());
    let names = ["vehicle.toml", "short.json", "problem.json", "loop.json"];
    let errors = python::run("margins.py", names.map(|name| folder.path(name)));
    let errors: Value = serde_json::from_str(&errors).unwrap();
    for (what, figure, tolerance) in [
        // At the end of the first run the vehicle does not quite hover.
        ("short", "value", 1e-4),
        ("short", "sd", 1e-3),
        ("short", "poles", 1e-4),
        ("problem", "value", 1e-4),
        ("problem", "sd", 1e-3),
        ("problem", "poles", 1e-4),
        ("bode", "gain", 1e-8),
        ("bode", "phase", 1e-8),
    ] {
        let found = errors[what][figure].as_f64().unwrap();
        assert!(found < tolerance, "{what} {figure}: {found}");
    }
}
