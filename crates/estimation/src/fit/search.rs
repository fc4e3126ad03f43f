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
use crate::search::starts::Start;
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
    let mut found = match tumbles.as_ref().filter(|_| begin.drawn.is_empty()) {
        Some(tumbles) => tumbles.race(posed, &begin.raised, &watch),
        None => raced(posed, &begin, &watch),
    };
    if begin.drawn.is_empty() && !has_answer(&found.solved) && !watch.is_over() {
        begin = Begin::drawn(posed);
        watch = watch.of(begin.count());
        found = raced(posed, &begin, &watch);
    }
    if !begin.drawn.is_empty()
        && let Some(tumbles) = tumbles
    {
        let (best, _) = best_of(&found.solved, &watch);
        let own = found.solved[best].take();
        found.solved[best] = own.map(|own| tumbles.improved(posed, own, best, &watch));
    }
    Searched {
        raced: found,
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
        // The same point in the equations that saturate.
        let free = &before.problem;
        let problem = free.with_equations(posed.model.clone(), free.runs.clone());
        let from = (problem, before.solution.iterate.z.clone());
        let see = |iteration: &_| watch.see(k, 0, iteration);
        let mut own = solve(posed, from, limit, &see);
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
    let mut all = search(posed, found.watch);
    let (first, own) = (found.starts.len(), &mut all.raced);
    own.same.iter_mut().for_each(|k| *k += first);
    found.raced.same.append(&mut own.same);
    found.raced.solved.append(&mut own.solved);
    found.starts.append(&mut all.starts);
    Searched {
        raced: found.raced,
        starts: found.starts,
        watch: all.watch,
    }
}
