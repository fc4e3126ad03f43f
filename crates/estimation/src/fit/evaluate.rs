//! Evaluates a problem at its start values, without a solve.

use crate::innovations;
use crate::posed::{Posed, Stands};
use crate::result::{Fit, RunFit};
use crate::search::begin::flown;
use crate::search::starts::{Start, given};
use pilotage_collocation::Collocation;
use pilotage_sqp::Problem;

/// A problem at its start values. The states are simulated from the initial values of the problem or from their
/// guesses.
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// The objective; infinite if a simulation ends early.
    pub objective: f64,
    /// The first run whose simulation ends early, and the time \[s\].
    pub end: Option<(usize, f64)>,
    /// Its derivative with respect to each sought parameter, in the coordinates of the search, by central differences
    /// that stay in the range.
    pub gradient: Vec<(String, f64)>,
    /// The runs, simulated.
    pub runs: Vec<RunFit>,
    /// The nonlinear program and its variables along these simulations.
    pub at: (Collocation, Vec<f64>),
}

/// Step of the differences, relative to the size of a parameter.
const STEP: f64 = 1e-5;

/// Evaluates the problem at its start values.
pub fn evaluate(posed: &Posed<'_>) -> Evaluation {
    let start = given(posed);
    let at = |start: &Start| match posed.filter {
        Some(_) => innovations::value(posed, start),
        None => match flown(posed, start) {
            (at, None) => objective(posed, &at),
            (_, Some(_)) => f64::INFINITY,
        },
    };
    let mut gradient = Vec::new();
    for (unknown, stands) in &posed.unknowns {
        let size = unknown.searched_nominal().unwrap_or(1.0) * STEP;
        for (k, place) in posed.places(stands).into_iter().enumerate() {
            let own = start.parameters[place];
            let [least, most] = unknown.searched_range();
            let moved = |value: f64| {
                let mut theta = start.clone();
                theta.parameters[place] = value;
                at(&theta)
            };
            // One-sided at a bound of the range.
            let (up, down) = ((own + size).min(most), (own - size).max(least));
            let name = match stands {
                Stands::Subjects(all) => format!("{} ({})", unknown.name, all[k].0),
                Stands::Shared(_) | Stands::State(_) => unknown.name.clone(),
            };
            gradient.push((name, (moved(up) - moved(down)) / (up - down)));
        }
    }
    let (at_start, end) = flown(posed, &start);
    let runs = Fit::runs(posed, &at_start.0, &at_start.1);
    Evaluation {
        objective: at(&start),
        end,
        gradient,
        runs,
        at: at_start,
    }
}

/// The objective of a nonlinear program at its variables.
pub(crate) fn objective(posed: &Posed<'_>, (problem, z): &(Collocation, Vec<f64>)) -> f64 {
    let mut equalities = vec![0.0; problem.n_equalities()];
    let mut inequalities = vec![0.0; problem.limits().0.len()];
    problem.evaluate(z, &mut equalities, &mut inequalities) / posed.factor
}
