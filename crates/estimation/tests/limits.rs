//! What ends a fit before it is done, and what it then says.

use pilotage_estimation::fit::Progress;
use pilotage_estimation::{Fit, Posed, ProblemFile, fit, part};
use pilotage_sqp::Status;
use std::ops::ControlFlow;

const OSCILLATOR: &str = "[model]\nname = \"oscillator\"\n[parameters]\nw = 3.0\n[states]\nx = { start = 1, der = \"v\" }\n\
                          v = { start = 0, der = \"-w^2 * x\" }\n";
const PROBLEM: &str = "[system.m]\nmodel = \"model.toml\"\n[[measured]]\nsignal = \"m.x\"\ncolumn = \"x\"\nsd = 0.01\n\
                       [[run]]\nfile = \"run.csv\"\n";

/// The fit of `x(t) = cos 2t` at these times.
fn fitted(
    times: &[f64],
    rest: &str,
    observer: &mut (dyn FnMut(&Progress<'_>) -> ControlFlow<Status> + Send),
) -> Fit {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let rows = times.iter().map(|t| format!("{t},{}\n", (2.0 * t).cos()));
    std::fs::write(path("model.toml"), OSCILLATOR).unwrap();
    std::fs::write(
        path("run.csv"),
        "time,x\n".to_owned() + &rows.collect::<String>(),
    )
    .unwrap();
    let text = format!("{PROBLEM}{rest}");
    let file = ProblemFile::parse(&text, &path("problem.toml")).unwrap();
    let posed = Posed::new(&file, &part::open).unwrap();
    fit(&posed, observer)
}

fn times(count: u32) -> Vec<f64> {
    (0..count).map(|k| 0.1 * f64::from(k)).collect()
}

fn codes(fit: &Fit) -> Vec<&str> {
    fit.diagnostics.iter().map(|own| own.code()).collect()
}

#[test]
fn a_fit_that_is_cut_while_its_mesh_is_refined_is_no_answer() {
    let rest =
        "[parameters]\n\"m.w\" = { start = 2.1 }\n[fit]\nstarts = 1\nmesh_tolerance = 1e-9\n";
    let whole = fitted(&times(40), rest, &mut |_| ControlFlow::Continue(()));
    assert!(
        whole.is_answer() && whole.refinement.rounds > 0,
        "{:?}",
        whole.diagnostics
    );
    let cut = fitted(
        &times(40),
        rest,
        &mut |progress| match progress.refinement {
            0 => ControlFlow::Continue(()),
            _ => ControlFlow::Break(Status::TimeLimit),
        },
    );
    assert_eq!(cut.starts[0].status, Status::Converged);
    assert!(
        !cut.is_answer() && codes(&cut).contains(&"cut"),
        "{:?}",
        codes(&cut)
    );
    assert_eq!(cut.ending(), "time-limit");
}

#[test]
fn a_fit_that_is_cut_during_its_starts_is_no_answer() {
    let rest = "[parameters]\n\"m.w\" = { start = 2.1 }\n[fit]\nstarts = 6\n";
    let mut seen = 0;
    let cut = fitted(&times(40), rest, &mut |progress| {
        seen += usize::from(progress.iteration.is_some());
        match seen > 12 {
            true => ControlFlow::Break(Status::Interrupted),
            false => ControlFlow::Continue(()),
        }
    });
    assert!(
        !cut.is_answer() && codes(&cut).contains(&"cut"),
        "{:?}",
        codes(&cut)
    );
    assert_eq!(cut.ending(), "interrupted");
    assert!(
        cut.starts
            .iter()
            .any(|own| own.status == Status::Interrupted)
    );
}

/// Half a million periods between two samples: nobody waits for them to be told.
#[test]
fn a_simulation_asks_whether_to_go_on() {
    let mut asked = 0;
    let far = [0.0, 1.0, 3e6, 3e6 + 1.0];
    let rest = "[parameters]\n\"m.w\" = { start = 2.1 }\n[fit]\nstarts = 1\n";
    let cut = fitted(&far, rest, &mut |progress| {
        assert!(progress.iteration.is_none(), "no iterate before it is over");
        asked += 1;
        match asked > 20 {
            true => ControlFlow::Break(Status::Interrupted),
            false => ControlFlow::Continue(()),
        }
    });
    assert_eq!((asked, cut.ending()), (21, "interrupted"));
}

/// `Σ (cos 2t - cos wt)²` has a minimum at 2.7512 besides that at 2. One start begins there, and the others have too few
/// iterations; the better one of them goes on.
#[test]
fn a_better_start_goes_on() {
    let start = "[parameters]\n\"m.w\" = { start = 2.75120 }\n[fit]\nmax_iterations = 3\n";
    let found = fitted(&times(101), start, &mut |_| ControlFlow::Continue(()));
    assert!(
        found.is_answer(),
        "{:?} {:?}",
        found.starts,
        found.diagnostics
    );
    assert!(
        (found.parameters[0].mean() - 2.0).abs() < 1e-5,
        "{:?}",
        found.parameters
    );
}

/// The objective of the oscillator with a frequency, by its solution.
fn objective(times: &[f64], w: f64) -> f64 {
    let residuals = times
        .iter()
        .map(|t| ((2.0 * t).cos() - (w * t).cos()) / 0.01);
    residuals.map(|r| r * r).sum()
}

/// Wherever a fit is stopped, what it tells is the objective of a run with the parameters that it tells, and none that is
/// worse than the given start.
#[test]
fn what_a_stopped_fit_tells_is_a_run_with_its_parameters() {
    let times = times(40);
    for (starts, iterations) in [(1, 1), (1, 2), (1, 3), (4, 2), (4, 5), (4, 9)] {
        let rest = format!("[parameters]\n\"m.w\" = {{ start = 2.6 }}\n[fit]\nstarts = {starts}\n");
        let mut seen = 0;
        let cut = fitted(&times, &rest, &mut |progress| {
            seen += usize::from(progress.iteration.is_some());
            match seen > iterations {
                true => ControlFlow::Break(Status::TimeLimit),
                false => ControlFlow::Continue(()),
            }
        });
        assert!(cut.is_met(), "{:?}", codes(&cut));
        let w = cut.parameters[0].mean();
        let own = objective(&times, w);
        assert!(
            (cut.objective - own).abs() < 1e-3 * (1.0 + own),
            "{} {own}",
            cut.objective
        );
        assert!(own < 1.001 * objective(&times, 2.6), "{w}");
    }
}
