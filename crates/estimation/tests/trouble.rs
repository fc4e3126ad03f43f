//! Models that are no numbers: a fit ends, and says which expression it is.

use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use pilotage_sqp::Status;
use std::ops::ControlFlow;

/// Fits a model of one state with that derivative, and that noise level.
fn fitted(derivative: &str, sd: &str) -> Fit {
    let folder = tempfile::tempdir().expect("a folder");
    let write =
        |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    let model = format!(
        "[model]\nname = \"tank\"\n[parameters]\nrate = 1\n[states]\nlevel = {{ start = 1, der = \"{derivative}\" }}\n"
    );
    write("tank.toml", &model);
    write("run.csv", "time [s],level\n0,1\n1,0.5\n2,0.3\n3,0.1\n");
    let text = format!(
        r#"
[system.tank]
model = "tank.toml"
[[measured]]
signal = "tank.level"
column = "level"
sd = {sd}
[parameters]
"tank.rate" = {{}}
[[run]]
file = "run.csv"
[fit]
mesh = "samples"
"#
    );
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml")).expect("a problem");
    let posed = Posed::new(&file, &part::open).expect("a problem");
    fit(&posed, &mut |_| ControlFlow::Continue(()))
}

#[test]
fn a_model_that_is_finite_has_no_trouble() {
    let found = fitted("-rate * level", "0.1");
    assert!(found.is_answer(), "{:?}", found.status);
    assert_eq!(found.trouble, None);
}

#[test]
fn the_expression_that_is_not_finite_is_named_with_its_instance() {
    let everywhere = fitted("-rate * level + sqrt(-rate^2)", "0.1");
    assert_eq!(everywhere.status, Status::UndefinedStart);
    assert_eq!(
        everywhere.trouble.expect("trouble"),
        "run.csv at 0 s: `tank` (tank.toml), line 6, column 45: `sqrt(-rate^2)` is NaN, where -rate^2 = -1.0"
    );
    let later = fitted("-rate * level + rate / (time - 2)", "0.1");
    assert_eq!(later.status, Status::UndefinedStart);
    assert_eq!(
        later.trouble.expect("trouble"),
        "run.csv at 2 s: `tank` (tank.toml), line 6, column 45: `rate / (time - 2)` is inf, where rate = 1.0, (time - 2) = 0.0"
    );
}

#[test]
fn a_noise_level_that_is_not_finite_is_named_with_its_column() {
    let found = fitted("-rate * level", "\"log(y - 1)\"");
    assert_eq!(found.status, Status::UndefinedStart);
    assert_eq!(
        found.trouble.expect("trouble"),
        "run.csv at 0 s: the standard deviation of `level` is -inf"
    );
}
