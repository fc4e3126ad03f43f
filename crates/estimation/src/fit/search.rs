//! The search from all starts.
//!
//! Where an output saturates nothing tells how much further it wishes to go, so that a search may get stuck there. It begins
//! without limits, and goes on with them from what that finds.

use super::race::{Raced, best_of, has_answer, has_converged, raced};
use super::raised::Begin;
use super::solve::solve;
use super::tumbles::Tumbles;
use super::watch::Watch;
use crate::posed::Posed;
use crate::result::saturated;
use crate::search::solved::Solved;
use crate::search::starts::Start;
use pilotage_collocation::Collocation;
use rayon::prelude::*;

/// The solutions from all starts.
pub(super) struct Searched<'a, 'o> {
    /// How they ended.
    pub raced: Raced,
    /// The starts.
    pub starts: Vec<Start>,
    /// The watch, which knows their number.
    pub watch: Watch<'a, 'o>,
}

/// Searches from all starts.
pub(super) fn search<'a, 'o>(posed: &Posed<'_>, watch: Watch<'a, 'o>) -> Searched<'a, 'o> {
    let mut begin = Begin::new(posed, &watch);
    let mut watch = watch.of(begin.count());
    let tumbles = Tumbles::of(posed);
    let mut raced = match tumbles.as_ref().filter(|_| begin.drawn.is_empty()) {
        Some(tumbles) => tumbles.race(posed, &begin.raised, &watch),
        None => raced(posed, &begin, &watch),
    };
    if begin.drawn.is_empty() && !has_answer(&raced.solved) && !watch.is_over() {
        begin = Begin::drawn(posed);
        watch = watch.of(begin.count());
        raced = super::race::raced(posed, &begin, &watch);
    }
    if !begin.drawn.is_empty()
        && let Some(tumbles) = tumbles
    {
        let (best, _) = best_of(&raced.solved, &watch);
        let own = raced.solved[best].take();
        raced.solved[best] = own.map(|own| tumbles.improved(posed, own, best, &watch));
    }
    Searched {
        raced,
        starts: begin.starts(),
        watch,
    }
}

/// Searches without limits, and goes on from there with outputs that saturate. Where the best solution saturates, or there is
/// none, all starts are tried with saturation, too.
pub(super) fn saturated<'a, 'o>(
    posed: &Posed<'_>,
    free: &Posed<'_>,
    watch: Watch<'a, 'o>,
) -> Searched<'a, 'o> {
    let mut found = search(free, watch);
    let limit = posed.file.options.max_iterations;
    let watch = &found.watch;
    let has_any = has_answer(&found.raced.solved);
    let solved = std::mem::take(&mut found.raced.solved).into_par_iter();
    let solved = solved.enumerate().map(|(k, own)| {
        let before = own?;
        if has_any && !has_converged(&before) {
            return Some(before);
        }
        let see = |iteration: &_| watch.see(k, 0, iteration);
        let mut own = solve(posed, carried(posed, &before), limit, &see);
        own.solution.work += before.solution.work;
        Some(own)
    });
    found.raced.solved = solved.collect();
    let (best, _) = best_of(&found.raced.solved, &found.watch);
    let best = found.raced.solved[best].as_ref();
    let is_answer = best.is_some_and(|own| {
        let at = (&own.problem, &own.solution.iterate.z[..]);
        has_answer(&found.raced.solved) && saturated::saturated(posed, at.0, at.1).is_empty()
    });
    if is_answer || found.watch.is_over() {
        return found;
    }
    let other = search(posed, found.watch);
    let first = found.starts.len();
    let mut raced = found.raced;
    raced.solved.extend(other.raced.solved);
    (raced.same).extend(other.raced.same.into_iter().map(|k| first + k));
    let mut starts = found.starts;
    starts.extend(other.starts);
    Searched {
        raced,
        starts,
        watch: other.watch,
    }
}

/// The point of a solution without limits in the equations that saturate.
fn carried(posed: &Posed<'_>, solved: &Solved) -> (Collocation, Vec<f64>) {
    let own = &solved.problem;
    let problem = Collocation::new(
        posed.model.clone(),
        own.constraints.clone(),
        own.scheme,
        own.runs.clone(),
        own.model.scales.clone(),
        &own.bounds,
    );
    (problem, solved.solution.iterate.z.clone())
}
