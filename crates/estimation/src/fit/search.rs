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
use crate::search::solved::{SAME, Solved};
use crate::search::starts::{BLOCK, Start};
use pilotage_collocation::Collocation;
use pilotage_sqp::Problem;
use rayon::prelude::*;

/// Maximum number of starts where none is given.
const MOST_DRAWN: usize = 96;

/// Iterations times variables of all starts after which no more are added: some ten seconds.
const MOST_WORK: usize = 10_000_000;

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
        let (best, _) = best_of(posed, &found.solved, &watch);
        let own = found.solved[best].take();
        found.solved[best] = own.map(|own| tumbles.improved(posed, own, best, &watch));
    }
    let mut found = Searched {
        raced: found,
        starts: begin.starts(),
        watch,
    };
    // A race of its own for each block: what fewer starts find more of them find, too.
    let mut drawn = begin.drawn.len();
    let is_wide = || posed.unknowns.iter().any(|(own, _)| own.is_wide());
    let most = match posed.file.options.starts {
        Some(starts) => starts,
        None if is_wide() => MOST_DRAWN,
        None => BLOCK,
    };
    let is_given = posed.file.options.starts.is_some();
    while (BLOCK..most).contains(&drawn) && (is_given || has_more(&found)) && !found.watch.is_over()
    {
        begin = begin.next(posed, drawn, BLOCK.min(most - drawn));
        drawn += begin.drawn.len();
        found.watch = found.watch.of(found.starts.len() + begin.count());
        let raced = raced(posed, &begin, &found.watch);
        found.add(raced, begin.starts());
    }
    found
}

impl Searched<'_, '_> {
    /// Adds other starts.
    fn add(&mut self, mut raced: Raced, mut starts: Vec<Start>) {
        let (first, own) = (self.starts.len(), &mut self.raced);
        own.same.extend(raced.same.iter().map(|k| k + first));
        own.solved.append(&mut raced.solved);
        self.starts.append(&mut starts);
    }
}

/// Whether more starts probably find more optima, by the number of those that ended and of the optima that they found: the Bayesian
/// rule of Boender & Rinnooy Kan (Math. Programming 37, 1987).
fn has_more(found: &Searched<'_, '_>) -> bool {
    let solved = || found.raced.solved.iter().flatten();
    let work = solved().map(|own| own.solution.work.iterations * own.solution.iterate.z.len());
    let ended = found.raced.same.iter();
    let ended = ended.filter_map(|k| found.raced.solved[*k].as_ref());
    let objectives = ended.filter(|own| has_converged(own));
    let mut objectives: Vec<f64> = objectives.map(|own| own.solution.iterate.f).collect();
    let n = objectives.len();
    objectives.sort_by(f64::total_cmp);
    objectives.dedup_by(|a, b| (*a - *b).abs() <= SAME * b.abs());
    let w = objectives.len();
    let is_known = n > w + 2 && 2 * w * (n - 1) < (2 * w + 1) * (n - w - 2);
    !is_known && work.sum::<usize>() < MOST_WORK
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
        if has_converged(&before) && is_solution_of(&problem, &before) {
            let solution = before.solution;
            return Some(Solved { problem, solution });
        }
        let from = (problem, before.solution.iterate.z.clone());
        let see = |iteration: &_| watch.see(k, 0, iteration);
        let mut own = solve(posed, from, limit, &see);
        own.solution.work += before.solution.work;
        Some(own)
    });
    found.raced.solved = solved.collect();
    let (best, _) = best_of(posed, &found.raced.solved, &found.watch);
    let best = found.raced.solved[best].as_ref();
    let is_answer = best.is_some_and(|own| {
        let at = (&own.problem, &own.solution.iterate.z[..]);
        has_answer(&found.raced.solved) && saturated::saturated(posed, at.0, at.1).is_empty()
    });
    if is_answer || found.watch.is_over() {
        return found;
    }
    let Searched {
        raced,
        starts,
        watch,
    } = search(posed, found.watch);
    let mut found = Searched {
        raced: found.raced,
        starts: found.starts,
        watch,
    };
    found.add(raced, starts);
    found
}

/// Whether a solution is that of the same problem with equations that saturate, too: none of its outputs comes near a limit, where
/// they would differ by much more than by rounding.
fn is_solution_of(saturating: &Collocation, own: &Solved) -> bool {
    const ROUNDING: f64 = 1e-12;
    let z = &own.solution.iterate.z;
    let evaluated = |problem: &Collocation| {
        let mut c = vec![0.0; problem.n_equalities()];
        let mut g = vec![0.0; problem.limits().0.len()];
        let f = problem.evaluate(z, &mut c, &mut g);
        (f, c, g)
    };
    let [(f, c, g), (of, oc, og)] = [saturating, &own.problem].map(evaluated);
    let is_same = |a: &[f64], b: &[f64]| {
        let pairs = a.iter().zip(b);
        a.len() == b.len() && pairs.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs())) < ROUNDING
    };
    (f - of).abs() <= ROUNDING * of.abs() && is_same(&c, &oc) && is_same(&g, &og)
}
