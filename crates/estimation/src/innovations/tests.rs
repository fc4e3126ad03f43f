//! Compares the program's derivatives with differences of the objective.

use super::likelihood::Likelihood;
use super::program::Program;
use crate::{Posed, ProblemFile, part};
use pilotage_sqp::{Hessian, Problem, SparseProblem};
use std::fmt::Write;

const MODEL: &str = r#"
[model]
name = "pendulum"
[inputs]
push = {}
[parameters]
damping = 0.4
length = 0.9
[states]
angle = { start = "0.3 * length", der = "rate" }
rate = { der = "push - sin(angle) * 9.81 / length - damping * rate" }
"#;

const PROBLEM: &str = r#"
[system.m]
model = "m.toml"
[[measured]]
signal = "m.angle"
column = "angle"
sd = "s * (1 + 0.1 * abs(y))"
gain = { per = "run" }
[process_noise]
"m.push" = { density = "q" }
"m.angle" = { density = "0.1 * q" }
[parameters]
"m.damping" = { per = "run", prior = { normal = [0.5, 0.1] } }
"m.length" = { scale = "log", prior = { log-normal = [0, 0.3] } }
q = { start = 0.02, min = 0 }
s = { start = 0.05 }
[initial]
"m.rate" = "free"
[[constraint]]
expression = "m.damping * m.length"
min = 0.1
at = "parameters"
[fit]
objective = "prediction-error"
[[run]]
file = "a.csv"
[[run]]
file = "b.csv"
weight = 0.5
"#;

#[test]
fn derivatives_of_the_program_are_those_of_differences() {
    let folder = tempfile::tempdir().expect("a folder");
    let write =
        |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("a file");
    write("m.toml", MODEL);
    for (name, count) in [("a.csv", 25), ("b.csv", 15)] {
        let mut text = "time,angle\n".to_owned();
        for k in 0..count {
            let t = 0.1 * f64::from(k);
            writeln!(
                text,
                "{t},{}",
                0.3 * (3.1 * t).cos() + 0.04 * f64::from(7 * k % 5)
            )
            .expect("text");
        }
        write(name, &text);
    }
    let file = ProblemFile::parse(PROBLEM, &folder.path().join("p.toml")).expect("a problem");
    let posed = Posed::new(&file, &part::open).expect("a problem");
    let mut likelihood = Likelihood::of(&posed).expect("noise");
    likelihood.parts = 2;
    // Length, q, s; then rate, damping and gain of each run.
    let unknowns = vec![-0.1, 0.03, 0.06, 0.1, 1.1, 0.5, -0.2, 0.9, 0.35];
    let program = Program::new(&posed, likelihood, vec![1.0; 9], &unknowns);
    let mut gradient = vec![0.0; 9];
    program.gradient(&unknowns, &mut gradient);
    let rows = Problem::limits(&program).0.len();
    let value = |z: &[f64]| {
        let mut g = vec![0.0; rows];
        let f = program.evaluate(z, &mut [], &mut g);
        (f, g)
    };
    let mut jacobian = vec![0.0; 9 * rows];
    program.jacobians(&unknowns, &mut [], &mut jacobian);
    for k in 0..9 {
        let at = |by: f64| {
            let mut moved = unknowns.clone();
            moved[k] += by;
            value(&moved)
        };
        let d = 1e-4;
        let ((up, g_up), (down, g_down)) = (at(d), at(-d));
        let difference = (up - down) / (2.0 * d);
        let error = (gradient[k] - difference).abs();
        assert!(
            error < 1e-5 * (1.0 + difference.abs()),
            "{k}: {} {difference}",
            gradient[k]
        );
        for i in 0..rows {
            let slope = (g_up[i] - g_down[i]) / (2.0 * d);
            assert!((jacobian[9 * i + k] - slope).abs() < 1e-6, "{i} {k}");
        }
    }
    // The Hessian by differences agrees with second differences of the objective.
    let (mut values, lambda) = (vec![0.0; program.hessian_pattern().len()], []);
    let mut exact = program;
    exact.is_exact = true;
    exact.hessian(
        &unknowns,
        &lambda,
        &vec![0.0; rows],
        Hessian::Exact,
        &mut values,
    );
    let place = exact
        .hessian_pattern()
        .iter()
        .position(|own| *own == (1, 2))
        .expect("a pair");
    let mixed = |a: f64, b: f64| {
        let mut moved = unknowns.clone();
        moved[1] += a;
        moved[2] += b;
        exact.evaluate(&moved, &mut [], &mut vec![0.0; rows])
    };
    let d = 1e-4;
    let second = (mixed(d, d) - mixed(d, -d) - mixed(-d, d) + mixed(-d, -d)) / (4.0 * d * d);
    assert!(
        (values[place] - second).abs() < 1e-4 * second.abs(),
        "{} {second}",
        values[place]
    );
}
