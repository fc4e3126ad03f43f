//! Stiff problems with few samples, none of which says how it is to be solved, against SciPy (`stiff.json`, printed by
//! tests/python/stiff_reference.py from right-hand sides written by hand).

use pilotage_collocation::Scheme;
use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use serde_json::Value;
use std::ops::ControlFlow;

fn reference(name: &str) -> Value {
    let all: Value = serde_json::from_str(include_str!("stiff.json")).unwrap();
    all[name].clone()
}

/// The columns as a CSV file.
fn table(problem: &Value) -> String {
    let columns = problem["data"].as_object().unwrap();
    let names: Vec<&str> = columns.keys().map(String::as_str).collect();
    let mut text = format!("time,{}\n", names.join(","));
    for (row, time) in problem["time"].as_array().unwrap().iter().enumerate() {
        let cells: Vec<String> = columns.values().map(|own| own[row].to_string()).collect();
        text += &format!("{time},{}\n", cells.join(","));
    }
    text
}

/// The problem file: each signal with its noise, all logarithms sought.
fn problem_file(problem: &Value, options: &str) -> String {
    let mut text = String::from("[system.m]\nmodel = \"model.toml\"\n");
    for (name, sd) in problem["noise"].as_object().unwrap() {
        text += &format!("[[measured]]\nsignal = \"m.{name}\"\ncolumn = \"{name}\"\nsd = {sd}\n");
    }
    text += "[parameters]\n";
    for name in problem["parameters"].as_object().unwrap().keys() {
        text += &format!("\"m.{name}\" = {{ scale = \"log\" }}\n");
    }
    text + "[[run]]\nfile = \"run.csv\"\n" + options
}

fn fitted(problem: &Value, options: &str) -> Fit {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("model.toml"),
        problem["model"].as_str().unwrap(),
    )
    .unwrap();
    std::fs::write(folder.path().join("run.csv"), table(problem)).unwrap();
    let text = problem_file(problem, options);
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).unwrap();
    let posed = Posed::new(&file, &part::open).unwrap();
    fit(&posed, &mut |_| ControlFlow::Continue(()))
}

/// Without doubt, by the scheme for stiff equations, where SciPy's optimum is as far as the mesh is asked to be exact.
fn assert_as_scipy(name: &str) {
    let expected = reference(name);
    let found = fitted(&expected, "");
    assert!(
        found.is_answer() && found.diagnostics.is_empty(),
        "{name}: {:?}",
        found.diagnostics
    );
    assert_eq!(found.refinement.scheme, Scheme::Radau(3));
    let near = |what: &str, found: f64, expected: &Value, tolerance: f64| {
        let expected = expected.as_f64().unwrap();
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{name}, {what}: {found} and not {expected}"
        );
    };
    near("objective", found.objective, &expected["objective"], 1e-4);
    near(
        "simulated",
        found.simulated_objective.unwrap(),
        &expected["objective"],
        1e-5,
    );
    for own in &found.parameters {
        let key = own.name.strip_prefix("m.").unwrap();
        near(key, own.mean(), &expected["parameters"][key], 2e-4);
    }
}

#[test]
fn robertsons_reaction_is_that_of_scipy() {
    assert_as_scipy("robertson");
}

#[test]
fn fast_binding_is_that_of_scipy() {
    assert_as_scipy("binding");
}

#[test]
fn high_irradiance_responses_are_those_of_scipy() {
    assert_as_scipy("hires");
}

/// On the samples alone the trapezoid fits what no solution does, and says so.
#[test]
fn a_mesh_that_is_too_coarse_is_found_out() {
    let problem = reference("binding");
    let rough = fitted(
        &problem,
        "[fit]\nmesh = \"samples\"\nscheme = \"trapezoid\"\n",
    );
    let codes: Vec<&str> = rough.diagnostics.iter().map(|own| own.code()).collect();
    assert!(codes.contains(&"simulation"), "{codes:?}");
}
