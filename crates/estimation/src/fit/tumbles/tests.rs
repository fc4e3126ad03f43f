//! What tumbles, and what is found otherwise.

use super::*;
use crate::{Posed, ProblemFile, part};

/// A pendulum, seen by a point that moves as it points.
const MODEL: &str = "[model]\nname = \"turn\"\n[parameters]\nc = 0.5\n[states]\nx = { start = 0, der = \"SEEN\" }\n\
                     phi = { start = 0, der = \"w\" }\nw = { start = 0, der = \"-4 * TURNED - c * w\" }\n";
const PROBLEM: &str = "[system.m]\nmodel = \"model.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\n[parameters]\n\
                       \"m.c\" = {}\n[initial]\n\"m.*\" = \"free\"\n[[run]]\nfile = \"run0.csv\"\n[[run]]\nfile = \"run1.csv\"\n[fit]\nstarts = 1\n";

/// Two runs of `x' = sin φ, φ'' = -4 sin φ - 0.5 φ'` from these rates \[rad/s\], by the classical Runge–Kutta method.
fn with([seen, turned]: [&str; 2], rates: [f64; 2], more: &str, check: impl Fn(&Posed<'_>)) {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).expect("written");
    };
    let model = MODEL.replace("SEEN", seen).replace("TURNED", turned);
    write("model.toml", &model);
    let slope = |[_, phi, w]: [f64; 3]| [phi.sin(), w, -4.0 * phi.sin() - 0.5 * w];
    let along = |x: [f64; 3], h: f64, d: [f64; 3]| [0, 1, 2].map(|k| x[k] + h * d[k]);
    for (run, rate) in rates.into_iter().enumerate() {
        let (mut x, h) = ([0.0, 0.0, rate], 0.01);
        let mut rows = String::from("time,x,phi\n");
        for k in 0..=500 {
            if k % 5 == 0 {
                rows += &format!("{},{},{}\n", h * f64::from(k), x[0], x[1]);
            }
            let a = slope(x);
            let b = slope(along(x, 0.5 * h, a));
            let c = slope(along(x, 0.5 * h, b));
            let d = slope(along(x, h, c));
            x = along(
                x,
                h / 6.0,
                [0, 1, 2].map(|k| a[k] + 2.0 * (b[k] + c[k]) + d[k]),
            );
        }
        write(&format!("run{run}.csv"), &rows);
    }
    let text = PROBLEM.replace("[parameters]", &format!("{more}[parameters]"));
    let file = ProblemFile::parse(&text, &folder.path().join("problem.toml"));
    let file = file.expect("a problem");
    check(&Posed::new(&file, &part::open).expect("a problem"));
}

const SINE: [&str; 2] = ["sin(phi)", "sin(phi)"];

#[test]
fn only_what_acts_nonlinearly_and_is_not_recorded_tumbles() {
    let names = |posed: &Posed<'_>| {
        let kicked = Tumbles::of(posed)?.kicked.into_iter();
        Some(
            kicked
                .map(|k| posed.states[k].name.clone())
                .collect::<Vec<String>>(),
        )
    };
    with(SINE, [1.0, 2.0], "", |posed| {
        let expected = ["m.phi", "m.w"].map(str::to_owned);
        assert_eq!(names(posed), Some(expected.to_vec()));
    });
    with(["phi", "phi"], [1.0, 2.0], "", |posed| {
        assert_eq!(names(posed), None)
    });
    let recorded = "[[measured]]\nsignal = \"m.phi\"\ncolumn = \"phi\"\n";
    with(SINE, [1.0, 2.0], recorded, |posed| {
        assert_eq!(names(posed), None)
    });
}

/// From rest, where both pendulums hang, a search ends at an optimum of each run. Others have half its objective.
#[test]
fn pendulums_swing_where_a_search_from_rest_leaves_them() {
    with(SINE, [3.0, 6.0], "", |posed| {
        let start = crate::search::starts::given(posed);
        let from = begin(posed, &start, &|| false);
        let alone = solve(posed, from, 200, &|_| ControlFlow::Continue(()));
        let fit = crate::fit(posed, &mut |_| ControlFlow::Continue(()));
        assert_eq!(fit.status, Status::Converged);
        assert!(fit.agrees(), "the states are those of a simulation");
        let before = alone.within(1e-6) / posed.factor;
        assert!(fit.objective < 0.6 * before, "{} {before}", fit.objective);
    });
}

/// At the same parameters the objectives of the runs are those of the whole problem.
#[test]
fn runs_by_themselves_are_the_whole_problem() {
    with(SINE, [1.0, 2.0], "", |posed| {
        let start = crate::search::starts::given(posed);
        let (problem, z) = begin(posed, &start, &|| false);
        let model = Arc::new(problem.model.tapes.at(&problem.physical_theta(&z)));
        let runs = (0..2).map(|j| OneRun::of(&problem, model.clone(), &z, j).objective);
        let whole = pilotage_sqp::Iterate::new(&problem, z.clone()).f;
        let sum: f64 = runs.sum();
        assert!((sum / whole - 1.0).abs() < 1e-12, "{sum} {whole}");
    });
}
