//! The race of the starts: those that are behind after some iterations are left.

use super::See;
use super::begin::begin;
use super::solve::{Solved, once, rescaled, solve};
use crate::posed::Posed;
use crate::starts::Start;
use pilotage_sqp::Status;
use rayon::prelude::*;

/// Iterations of each start before those that are behind are left.
const HEAT: usize = 30;

/// Starts that go on after that, at most.
const FINALISTS: usize = 3;

/// Largest violation of the scaled constraints with which a start is compared with others.
const NEARLY: f64 = 0.1;

/// Objectives that differ by less than this part are equal.
const EQUAL: f64 = 1e-8;

/// All starts, solved: those that are behind after some iterations are left, but never the given one.
pub(super) fn raced(posed: &Posed<'_>, starts: &[Start], see: &See<'_>) -> Vec<Solved> {
    let limit = posed.file.options.max_iterations;
    if let [only] = starts {
        let from = begin(posed, only);
        return vec![solve(posed, from, limit, &|iteration| see(0, iteration))];
    }
    let heat = |(k, start): (usize, &Start)| {
        let from = begin(posed, start);
        once(posed, from, limit.min(HEAT), &|iteration| see(k, iteration))
    };
    let mut solved: Vec<Solved> = starts.par_iter().enumerate().map(heat).collect();
    let finish = |k: usize| {
        let from = rescaled(posed, &solved[k]);
        (k, solve(posed, from, limit, &|iteration| see(k, iteration)))
    };
    let finalists = finalists(&solved).into_par_iter();
    let finished: Vec<(usize, Solved)> = finalists.map(finish).collect();
    for (k, own) in finished {
        solved[k] = own;
    }
    solved
}

/// The starts that go on: of those that have not converged the given one, and the first few that are better than the
/// best that has.
fn finalists(solved: &[Solved]) -> Vec<usize> {
    let best = solved.iter().map(rank).fold(f64::MAX, f64::min);
    let is_open = |k: &usize| solved[*k].solution.status != Status::Converged;
    // An objective counts where the states nearly fulfil the equations.
    let objective = |k: &usize| match &solved[*k].solution {
        own if own.kkt.primal <= NEARLY => own.iterate.f,
        _ => f64::INFINITY,
    };
    let mut open: Vec<usize> = (0..solved.len()).filter(is_open).collect();
    open.sort_by(|a, b| objective(a).total_cmp(&objective(b)));
    let is_finalist =
        |(place, k): &(usize, usize)| *k == 0 || (*place < FINALISTS && objective(k) < best);
    let finalists = open.into_iter().enumerate().filter(is_finalist);
    finalists.map(|(_, k)| k).collect()
}

/// The start with the best objective; of several with the same, that with the smallest error of its mesh, since on a
/// coarse mesh other parameters may do as well.
pub(super) fn best_of(solved: &[Solved]) -> usize {
    let least = solved.iter().map(rank).fold(f64::MAX, f64::min);
    let is_equal = |k: &usize| rank(&solved[*k]) - least <= EQUAL * least.abs();
    let equal: Vec<usize> = (0..solved.len()).filter(is_equal).collect();
    if let [only] = equal[..] {
        return only;
    }
    let error = |k: &usize| {
        let Solved { problem, solution } = &solved[*k];
        let errors = problem.mesh_errors(&solution.iterate.z);
        errors.into_iter().flatten().fold(0.0, f64::max)
    };
    let errors: Vec<f64> = equal.par_iter().map(error).collect();
    let best = (0..equal.len()).min_by(|a, b| errors[*a].total_cmp(&errors[*b]));
    best.map_or(0, |k| equal[k])
}

/// Converged ones before others, then by their objective.
fn rank(solved: &Solved) -> f64 {
    let objective = solved.solution.iterate.f;
    match solved.solution.status {
        Status::Converged if objective.is_finite() => objective,
        _ => f64::MAX,
    }
}
