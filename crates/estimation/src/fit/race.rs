//! The race of the starts: those that are behind after some iterations are dropped.

use super::solve::{nearer, once, rescaled, solve};
use super::watch::Watch;
use crate::posed::Posed;
use crate::search::begin::begin;
use crate::search::solved::SAME;
use crate::search::solved::Solved;
use crate::search::starts::Start;
use pilotage_sqp::Status;
use rayon::prelude::*;

/// Iterations of each start before those that are behind are dropped.
const HEAT: usize = 30;

/// Maximum number of starts that continue after that.
const FINALISTS: usize = 3;

/// Largest violation of the scaled constraints with which starts are compared.
const NEARLY: f64 = 0.1;

/// Objectives with a smaller relative difference are equal.
const EQUAL: f64 = 1e-8;

/// Maximum number of continuations of a start that is better than the best converged one, each with a new iteration
/// limit.
const EXTENSIONS: usize = 3;

/// Solves all starts. Those that are behind after some iterations are dropped, except the given one. None for a start
/// not begun before the fit was ended.
pub(super) fn raced(
    posed: &Posed<'_>,
    starts: &[Start],
    watch: &Watch<'_, '_>,
) -> Vec<Option<Solved>> {
    let limit = posed.file.options.max_iterations;
    let is_race = starts.len() > 1;
    let heat = |(k, start): (usize, &Start)| {
        if k > 0 && watch.is_over() {
            return None;
        }
        let from = begin(posed, start, &|| watch.is_over());
        let see = |iteration: &_| watch.see(k, 0, iteration);
        let limit = if is_race { limit.min(HEAT) } else { limit };
        // If there are several starts, the given one is solved as it is: a coarser mesh could lead all of them past a
        // narrow valley.
        if is_race && k == 0 {
            return Some(once(posed, from, limit, &see));
        }
        let (from, before) = nearer(posed, from, limit, &see);
        let mut solved = match is_race {
            true => once(posed, from, limit, &see),
            false => solve(posed, from, limit, &see),
        };
        solved.solution.work += before;
        Some(solved)
    };
    let mut solved: Vec<Option<Solved>> = starts.par_iter().enumerate().map(heat).collect();
    if is_race {
        let open = finalists(&solved);
        go_on(posed, &mut solved, open.clone(), watch);
        let left = (0..starts.len()).filter(|k| !open.contains(k) && is_unfinished(&solved[*k]));
        let left: Vec<usize> = left.collect();
        match has_answer(&solved) {
            true => left.iter().for_each(|k| leave(&mut solved[*k])),
            false => go_on(posed, &mut solved, left, watch),
        }
    }
    for _ in 0..EXTENSIONS {
        let Some(better) = better(&solved) else {
            break;
        };
        go_on(posed, &mut solved, vec![better], watch);
    }
    solved
}

/// Whether the iteration limit ended a start.
fn is_unfinished(solved: &Option<Solved>) -> bool {
    let status = solved.as_ref().map(|own| own.solution.status);
    status == Some(Status::IterationLimit)
}

/// Marks a start as dropped: it was behind, and no limit set by the user ended it.
fn leave(solved: &mut Option<Solved>) {
    if let Some(own) = solved {
        own.solution.status = Status::Stopped;
    }
}

/// Continues these starts from their current iterates.
fn go_on(
    posed: &Posed<'_>,
    solved: &mut [Option<Solved>],
    open: Vec<usize>,
    watch: &Watch<'_, '_>,
) {
    let limit = posed.file.options.max_iterations;
    let finish = |k: usize| {
        let own = solved[k].as_ref().filter(|_| !watch.is_over())?;
        let see = |iteration: &_| watch.see(k, 0, iteration);
        Some((k, solve(posed, rescaled(posed, own), limit, &see)))
    };
    let finished: Vec<(usize, Solved)> = open.into_par_iter().filter_map(finish).collect();
    for (k, own) in finished {
        solved[k] = Some(own);
    }
}

/// The unconverged starts that continue: the given one, and the first few that are better than the best converged one.
fn finalists(solved: &[Option<Solved>]) -> Vec<usize> {
    let best = least(solved);
    let is_open = |k: &usize| solved[*k].as_ref().is_some_and(|own| !has_converged(own));
    let objective = |k: &usize| {
        solved[*k]
            .as_ref()
            .map_or(f64::INFINITY, |own| own.within(NEARLY))
    };
    let mut open: Vec<usize> = (0..solved.len()).filter(is_open).collect();
    open.sort_by(|a, b| objective(a).total_cmp(&objective(b)));
    let is_finalist =
        |(place, k): &(usize, usize)| *k == 0 || (*place < FINALISTS && objective(k) < best);
    let finalists = open.into_iter().enumerate().filter(is_finalist);
    finalists.map(|(_, k)| k).collect()
}

/// A start that has not converged but is better than the best converged one.
pub(super) fn better(solved: &[Option<Solved>]) -> Option<usize> {
    let best = least(solved);
    let objective = |own: &Option<Solved>| match own {
        Some(own) if !has_converged(own) => own.nearly(),
        _ => f64::INFINITY,
    };
    let open = solved.iter().map(objective).enumerate();
    let (k, own) = open.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (best < f64::MAX && own < best - SAME * best.abs()).then_some(k)
}

/// The start with the best objective among the converged ones, or among all if none converged. Among equal objectives,
/// the one with the smallest mesh error is selected, since on a coarse mesh other parameters may fit equally well.
/// These errors are returned too.
pub(super) fn best_of(
    solved: &[Option<Solved>],
    watch: &Watch<'_, '_>,
) -> (usize, Option<Vec<Vec<f64>>>) {
    let ranks = solved.iter().map(rank).enumerate();
    let ahead = |a: Rank, b: Rank| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
    let best = ranks.min_by(|(_, a), (_, b)| ahead(*a, *b));
    let (first, (class, least)) = best.unwrap_or_default();
    let is_equal = |own: Rank| own.0 == class && own.1 - least <= EQUAL * least.abs();
    let equal = solved
        .iter()
        .enumerate()
        .filter(|(_, own)| is_equal(rank(own)));
    let equal: Vec<(usize, &Solved)> = equal
        .filter_map(|(k, own)| Some((k, own.as_ref()?)))
        .collect();
    if class > 0 || equal.len() < 2 || watch.is_over() {
        return (first, None);
    }
    let errors = |(k, own): (usize, &Solved)| {
        let errors = own
            .problem
            .mesh_errors(&own.solution.iterate.z, &|| watch.is_over());
        (k, errors)
    };
    let all: Vec<(usize, Vec<Vec<f64>>)> = equal.into_par_iter().map(errors).collect();
    let largest = |errors: &[Vec<f64>]| errors.iter().flatten().copied().fold(0.0, f64::max);
    let best = all
        .into_iter()
        .min_by(|(_, a), (_, b)| largest(a).total_cmp(&largest(b)));
    best.map_or((first, None), |(k, errors)| (k, Some(errors)))
}

/// Whether a start has converged.
pub(super) fn has_answer(solved: &[Option<Solved>]) -> bool {
    solved.iter().flatten().any(has_converged)
}

/// Class of a start, and its objective in that class.
type Rank = (u8, f64);

/// Converged starts come first, then those whose states satisfy the equations, then the others by their violation.
fn rank(solved: &Option<Solved>) -> Rank {
    match solved {
        Some(own) if has_converged(own) => (0, own.solution.iterate.f),
        Some(own) if own.nearly().is_finite() => (1, own.solution.iterate.f),
        Some(own) => (2, own.solution.kkt.primal),
        None => (3, 0.0),
    }
}

/// The lowest objective of the converged starts.
fn least(solved: &[Option<Solved>]) -> f64 {
    let converged = solved.iter().flatten().filter(|own| has_converged(own));
    let objectives = converged.map(|own| own.solution.iterate.f);
    objectives.fold(f64::MAX, f64::min)
}

fn has_converged(solved: &Solved) -> bool {
    solved.solution.status == Status::Converged && solved.solution.iterate.f.is_finite()
}

#[cfg(test)]
mod tests {
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
        let write =
            |name, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
        let rows = (0..101).map(|k| 0.1 * f64::from(k));
        let rows = rows.map(|t| format!("{t},{}\n", (2.0 * t).cos()));
        write("model.toml", MODEL);
        write(
            "run.csv",
            &("time,x\n".to_owned() + &rows.collect::<String>()),
        );
        let file =
            ProblemFile::parse(PROBLEM, &folder.path().join("problem.toml")).expect("a problem");
        let posed = Posed::new(&file, &part::open).expect("a problem");
        let from = |w: f64, iterations: usize| {
            let start = Start {
                parameters: vec![w],
                follows: false,
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
}
