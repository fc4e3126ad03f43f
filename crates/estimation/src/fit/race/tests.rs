//! Starts that are better than the best converged one.

use super::*;
use crate::{Posed, ProblemFile, part};
use std::ops::ControlFlow;

const MODEL: &str = "[model]\nname = \"oscillator\"\n[parameters]\nw = 2.7512\n[states]\n\
                     x = { start = 1, der = \"v\" }\nv = { start = 0, der = \"-w^2 * x\" }\n";
const PROBLEM: &str = "[system.m]\nmodel = \"model.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n\
                       [parameters]\n\"m.w\" = {}\n[[run]]\nfile = \"run.csv\"\n";

/// `Σ (cos 2t - cos wt)²` has a minimum at 2.7512, and one at 2.
#[test]
fn a_start_that_is_better_and_has_not_converged_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    let rows = (0..101).map(|k| 0.1 * f64::from(k));
    let rows = rows.map(|t| format!("{t},{}\n", (2.0 * t).cos()));
    write("model.toml", MODEL);
    write(
        "run.csv",
        &("time,x\n".to_owned() + &rows.collect::<String>()),
    );
    let file = ProblemFile::parse(PROBLEM, &folder.path().join("problem.toml")).expect("a problem");
    let posed = Posed::new(&file, &part::open).expect("a problem");
    let from = |w: f64, iterations: usize| {
        let start = Start {
            parameters: vec![w],
            follows: false,
            is_fitted: false,
            is_raised: false,
        };
        let from = begin(&posed, &start, &|| false);
        Some(once(&posed, from, iterations, &|_| {
            ControlFlow::Continue(())
        }))
    };
    let (bad, unfinished, finished) = (from(2.7512, 50), from(2.01, 1), from(2.01, 50));
    let objective = |own: &Option<Solved>| own.as_ref().map(|own| own.solution.iterate.f);
    assert!(objective(&unfinished) < objective(&bad));
    let mut solved = [bad, None, unfinished];
    assert_eq!(better(&solved), Some(2));
    solved[2] = finished;
    assert_eq!(better(&solved), None);
}
