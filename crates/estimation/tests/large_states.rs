//! States far larger than a unit: no simulation of theirs is dropped.

use pilotage_estimation::evaluate::{Evaluation, evaluate};
use pilotage_estimation::{Posed, ProblemFile, fit, part};
use std::ops::ControlFlow;

const TIMES: [f64; 6] = [0.0, 1.0, 2.0, 3.0, 5.0, 8.0];

/// A model of one state `x` with a parameter `k`, measured as `x / scale` with these values.
fn problem<T>(model: &str, scale: &str, values: [f64; 6], of: impl FnOnce(&Posed<'_>) -> T) -> T {
    let folder = tempfile::tempdir().expect("a folder");
    let write =
        |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    write("m.toml", &format!("[model]\nname = \"m\"\n{model}"));
    let rows = TIMES.iter().zip(values).map(|(t, y)| format!("{t},{y}\n"));
    write(
        "run.csv",
        &format!("time [s],y\n{}", rows.collect::<String>()),
    );
    let text = format!(
        "[system.m]\nmodel = \"m.toml\"\n[[measured]]\nexpression = \"m.x / {scale}\"\ncolumn = \"y\"\n\
         [parameters]\n\"m.k\" = {{}}\n[[run]]\nfile = \"run.csv\"\n[fit]\nstarts = 1\n"
    );
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).expect("a problem");
    of(&Posed::new(&file, &part::open).expect("a problem"))
}

fn squares(values: [f64; 6], of: impl Fn(f64) -> f64) -> f64 {
    let pairs = TIMES.iter().zip(values);
    pairs.map(|(t, y)| (y - of(*t)).powi(2)).sum()
}

/// From 0 to 1.1e6, so that nothing at the start tells its size.
#[test]
fn a_state_that_grows_beyond_a_million_is_evaluated() {
    let model = "[parameters]\nk = { start = 1.0 }\n[states]\nx = { start = 0, der = \"k * (1.1e6 - x)\" }\n";
    let values = [0.0, 0.6, 0.8, 0.95, 1.0, 1.0];
    let found = problem(model, "1.1e6", values, evaluate);
    let expected = squares(values, |t| 1.0 - (-t).exp());
    assert!(
        (found.objective / expected - 1.0).abs() < 1e-4,
        "{} for {expected}",
        found.objective
    );
}

/// From one individual to 8e7: logistic growth, whose solution is known.
#[test]
fn a_population_is_evaluated_and_fitted_from_one_individual() {
    let model = |k: f64| {
        format!(
            "[parameters]\nk = {{ start = {k} }}\n[states]\nx = {{ start = 1, der = \"k * x * (1 - x / 8e7)\" }}\n"
        )
    };
    let of = |k: f64| move |t: f64| 8e7 / (1.0 + (8e7 - 1.0) * (-k * t).exp());
    let values = TIMES.map(of(4.0));
    let found = problem(&model(3.7), "1", values, evaluate);
    let expected = squares(values, of(3.7));
    assert!(
        (found.objective / expected - 1.0).abs() < 1e-3,
        "{} for {expected}",
        found.objective
    );
    let fitted = problem(&model(3.7), "1", values, |posed| {
        fit(posed, &mut |_| ControlFlow::Continue(()))
    });
    // The error of a mesh is relative to the largest magnitude, beside which one individual is nothing.
    let k = fitted.value("m.k").expect("a parameter");
    assert!((k - 4.0).abs() < 2e-3, "{k}: {:?}", fitted.status);
}

/// `ẋ = k x²` from 1 is infinite at 1/k = 2.5: there is no objective beyond.
#[test]
fn a_simulation_that_ends_early_has_no_objective() {
    let model =
        "[parameters]\nk = { start = 0.4 }\n[states]\nx = { start = 1, der = \"k * x^2\" }\n";
    let found: Evaluation = problem(model, "1", [1.0; 6], evaluate);
    assert_eq!(found.objective, f64::INFINITY);
    // The last sample before.
    assert_eq!(found.end, Some((0, 2.0)));
}
