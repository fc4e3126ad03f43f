//! The race of the starts: all on a coarse mesh, and the best of those that ended apart on the whole one.

use super::apart::{are_apart, are_near, are_within};
use super::behind::Behind;
use super::guided::{Entrants, few, guided, of_few};
use super::raised::Begin;
use super::refine;
use super::solve::{once, rescaled, rescaled_with, solve};
use super::watch::Watch;
use crate::posed::Posed;
use crate::search::begin::begin;
use crate::search::solved::SAME;
use crate::search::solved::Solved;
use crate::search::starts::Start;
use pilotage_collocation::{Run, reduced};
use pilotage_sqp::{Iteration, Status};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::Mutex;

/// Iterations of each start before those that are behind are dropped. Few of those from the order below are behind: they go on, since
/// a pole that grows doubles with each iteration, and a new solve begins with small steps.
const HEAT: usize = 100;

/// Maximum number of starts that continue after that.
const FINALISTS: usize = 3;

/// Part of the best objective up to which others are not far behind: that of a coarse mesh or of corrected equations is another.
const CLOSE: f64 = 0.1;

/// How many times what a coarse mesh has taken from the best objective others may be behind there.
const FARTHER: f64 = 2.0;

/// Part of the objective of a few runs below which the given start has found a valley there that coarse meshes hide.
const HIDDEN: f64 = 0.8;

/// Largest violation of the scaled constraints with which starts are compared.
pub(super) const NEARLY: f64 = 0.1;

/// Objectives with a smaller relative difference are equal, and of these the parameters that a solve leaves open by as much.
const EQUAL: f64 = 1e-8;
const OPEN: f64 = 1e-4;

/// Maximum number of continuations of a start that is better than the best converged one, each with a new iteration
/// limit, and the least part of the objective that one must gain.
const EXTENSIONS: usize = 10;
const GAIN: f64 = 1e-5;

/// A start after its heat.
struct Scout {
    number: usize,
    start: Start,
    /// The runs on the whole mesh, if the heat was on a coarser one.
    whole: Option<Vec<Run>>,
    solved: Solved,
    /// The objective of a few runs alone on their whole meshes, if it was fitted to these first.
    few: Option<f64>,
    /// Whether it was given up for a better start.
    is_lost: bool,
}

/// The starts after the race.
pub(super) struct Raced {
    /// Those that were continued to the end.
    pub solved: Vec<Option<Solved>>,
    /// For each start the one that was continued in its place, since both reached the same optimum.
    pub same: Vec<usize>,
}

/// Solves all starts, from where the data lead them if instances can be corrected, and as they are if that gives no answer.
pub(super) fn raced(posed: &Posed<'_>, begin: &Begin, watch: &Watch<'_, '_>) -> Raced {
    let Begin {
        raised,
        drawn,
        unled,
        ..
    } = begin;
    let with = |own: Entrants| Entrants::new(raised).and(own).and(Entrants::new(unled));
    let led = begin.observed.as_ref();
    let led = led.map(|own| {
        race(
            posed,
            with(guided(posed, own, (raised.len(), drawn), watch)),
            watch,
        )
    });
    let is_enough = |raced: &Raced| has_answer(&raced.solved) || watch.is_over();
    if let Some(raced) = led.filter(is_enough) {
        return raced;
    }
    race(posed, with(Entrants::new(drawn)), watch)
}

/// Solves all entrants: each on a coarse mesh, where one is much smaller, then those that are not behind on the whole one. Of
/// those that reach the same optimum the first is continued.
fn race(posed: &Posed<'_>, entrants: Entrants, watch: &Watch<'_, '_>) -> Raced {
    let Entrants { all, mut same } = entrants;
    let is_race = all.len() > 1;
    let given = all
        .first()
        .filter(|own| own.0 == 0)
        .map(|own| own.1.clone());
    let mut solved: Vec<Option<Solved>> = same.iter().map(|_| None).collect();
    // Most starts from the order below reach one optimum: the first goes there alone, the others as long as they may find
    // another.
    let (mut raised, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|own| own.1.is_raised);
    let rest = raised.split_off(raised.len().min(1));
    let mut scouts: Vec<Scout> = Vec::new();
    for some in [raised, rest, others] {
        let known = known(scouts.iter().map(|own| &own.solved)).map(|own| own.0);
        let is_first = scouts.is_empty();
        let some = some.into_par_iter().enumerate();
        let some = some.filter_map(|(place, (number, start))| {
            let is_over = (place > 0 || !is_first) && watch.is_over();
            (!is_over).then(|| scout(posed, (number, is_race, known), start, watch))
        });
        scouts.extend(some.collect::<Vec<Scout>>());
    }
    scouts
        .sort_by(|a, b| (a.is_lost.cmp(&b.is_lost)).then(a.objective().total_cmp(&b.objective())));
    let few = scouts.iter().find_map(|own| own.few);
    let best = [false, true].map(|is_coarse| best_on(&scouts, is_coarse));
    let (mut open, mut left): (Vec<Scout>, Vec<Scout>) = (Vec::new(), Vec::new());
    let mut settled: Vec<(usize, f64)> = Vec::new();
    for own in scouts {
        let first = settled
            .iter()
            .find(|(_, other)| own.is_lost && is_same(own.objective(), *other));
        let first = first.map(|(number, _)| *number).or_else(|| {
            let mut open = open.iter();
            open.find(|other| own.is_same(posed, other))
                .map(|other| other.number)
        });
        let best = best[usize::from(own.whole.is_some())];
        let is_near = match own.has_converged() {
            true => is_close(own.objective(), best),
            false => !own.is_lost && own.objective() < best || own.number == 0,
        };
        match first {
            _ if own.has_converged() && own.whole.is_none() => {
                settled.push((own.number, own.objective()));
                solved[own.number] = Some(own.solved);
            }
            Some(first) => same
                .iter_mut()
                .filter(|k| **k == own.number)
                .for_each(|k| *k = first),
            None if is_near && (open.len() < FINALISTS || own.number == 0) => open.push(own),
            None => left.push(own),
        }
    }
    // Those on a coarse mesh are compared with what others have found on the whole one.
    let known = self::known(
        open.iter()
            .filter(|own| own.whole.is_none())
            .map(|own| &own.solved),
    );
    // Of those on coarse meshes the best one alone, and the others as long as they may beat it.
    let (mut open, whole): (Vec<_>, Vec<_>) = open.into_iter().partition(|own| own.whole.is_some());
    finish(posed, (whole, known.clone()), &mut solved, watch);
    let others = open.split_off(open.len().min(1));
    let best = open.first().map(|own| (own.number, own.objective()));
    finish(posed, (open, known.clone()), &mut solved, watch);
    let first = best.and_then(|(k, coarse)| Some((solved[k].as_ref()?, coarse)));
    // Those that were behind by more than a coarse mesh takes from an objective stay so.
    let is_behind = |own: &Scout| {
        let first = first.filter(|(own, _)| has_converged(own));
        let behind = first.map_or(0.0, |(first, coarse)| {
            let taken = (first.solution.iterate.f - coarse).abs();
            own.objective() - coarse - FARTHER * taken.max(SAME * coarse.abs())
        });
        own.has_converged() && behind > 0.0
    };
    let (behind, others): (Vec<_>, Vec<_>) = others.into_iter().partition(is_behind);
    left.extend(behind);
    let first = first.map(|own| own.0);
    let is_passed = |few: f64| first.is_none_or(|own| few < HIDDEN * of_few(posed, own));
    let is_passed = few.is_some_and(is_passed);
    let known = self::known(first.into_iter()).into_iter().chain(known);
    let known = known.min_by(|a, b| a.0.total_cmp(&b.0));
    finish(posed, (others, known), &mut solved, watch);
    if let Some(given) = given.filter(|_| is_passed && !watch.is_over()) {
        as_given(posed, &given, (&mut solved, &mut same), watch);
    }
    match has_answer(&solved) {
        true => left
            .into_iter()
            .filter(|own| own.whole.is_none())
            .for_each(|own| {
                let number = own.number;
                solved[number] = Some(dropped(own.solved));
            }),
        false => finish(posed, (left, None), &mut solved, watch),
    }
    for _ in 0..EXTENSIONS {
        let Some(best) = better(&solved) else {
            break;
        };
        let objective =
            |solved: &[Option<Solved>]| solved[best].as_ref().map_or(f64::MAX, Solved::nearly);
        let before = objective(&solved);
        go_on(posed, &mut solved, vec![best], watch);
        if before - objective(&solved) <= GAIN * before.abs() {
            break;
        }
    }
    Raced { solved, same }
}

/// Solves the given start on the whole mesh, for which a better valley was found than coarse meshes have led to. What else it has found
/// is left to the next start that has found it, too.
fn as_given(
    posed: &Posed<'_>,
    start: &Start,
    (solved, same): (&mut [Option<Solved>], &mut [usize]),
    watch: &Watch<'_, '_>,
) {
    let see = |iteration: &_| watch.see(0, 0, iteration);
    let from = begin(posed, start, &|| watch.is_over());
    let own = solve(posed, from, posed.most_iterations, &see);
    let others = (1..same.len()).filter(|k| same[*k] == 0);
    let others: Vec<usize> = others.collect();
    match (others.first(), &solved[0]) {
        (None, Some(before)) if before.nearly() <= own.nearly() => return,
        (None, _) => {}
        (Some(next), _) => {
            solved[*next] = solved[0].take();
            others.iter().for_each(|k| same[*k] = *next);
        }
    }
    (same[0], solved[0]) = (0, Some(own));
}

/// The lowest objective of those that have converged on such a mesh, where objectives are others than on the other one; of all
/// if none has.
fn best_on(scouts: &[Scout], is_coarse: bool) -> f64 {
    let converged = || scouts.iter().filter(|own| own.has_converged());
    let own = converged().filter(|own| own.whole.is_some() == is_coarse);
    let least = |all: &mut dyn Iterator<Item = f64>| all.min_by(f64::total_cmp);
    let own = least(&mut own.map(Scout::objective));
    own.or_else(|| least(&mut converged().map(Scout::objective)))
        .unwrap_or(f64::INFINITY)
}

/// Whether two objectives belong to the same optimum.
fn is_same(f: f64, g: f64) -> bool {
    (f - g).abs() <= SAME * f.abs().min(g.abs())
}

/// Whether an objective is not far behind the best.
pub(super) fn is_close(objective: f64, best: f64) -> bool {
    objective - best <= CLOSE * best.abs()
}

/// Solves a start, of several for some iterations, on a coarse mesh if that is much smaller. If there are several starts, the
/// given one is solved as it is, since a coarser mesh could lead all of them past a narrow valley (of long runs a few are solved so,
/// which tells whether it does); and so is one from the order below, which may have a pole that is too fast for a coarse mesh.
fn scout(
    posed: &Posed<'_>,
    (number, is_race, known): (usize, bool, Option<f64>),
    start: Start,
    watch: &Watch<'_, '_>,
) -> Scout {
    let limit = posed.most_iterations;
    let limit = match is_race && !start.is_raised {
        true => limit.min(HEAT),
        false => limit,
    };
    let behind = Mutex::new(Behind::new(known.filter(|_| start.is_raised)));
    let see = |iteration: &_| ahead(&behind, watch, number, iteration);
    let is_as_it_is = start.is_raised || is_race && number == 0 && !start.is_fitted;
    let few = match is_as_it_is && !start.is_raised {
        true => few(posed, (number, &start), watch),
        false => None,
    };
    let is_as_it_is = is_as_it_is && few.is_none();
    let (whole, z) = begin(posed, &start, &|| watch.is_over());
    let coarse = if is_as_it_is {
        None
    } else {
        reduced(&whole, &z)
    };
    let (from, whole) = match coarse {
        Some(coarse) => (coarse, Some(whole.runs)),
        None => ((whole, z), None),
    };
    let solved = match is_race {
        true => once(posed, from, limit, &see),
        false => solve(posed, from, limit, &see),
    };
    Scout {
        number,
        start,
        whole,
        few,
        is_lost: solved.solution.status == Status::Stopped,
        solved,
    }
}

/// Passes on an iterate of a start, and ends the solve where it is lost.
fn ahead(
    behind: &Mutex<Behind>,
    watch: &Watch<'_, '_>,
    number: usize,
    iteration: &Iteration,
) -> ControlFlow<Status> {
    watch.see(number, 0, iteration)?;
    match behind.lock().is_ok_and(|mut own| own.is_lost(iteration)) {
        true => ControlFlow::Break(Status::Stopped),
        false => ControlFlow::Continue(()),
    }
}

/// The lowest objective of those that have converged, and the parameters there.
fn known<'s>(solved: impl Iterator<Item = &'s Solved>) -> Option<(f64, Vec<f64>)> {
    let converged = solved.filter(|own| has_converged(own));
    let objective = |own: &&Solved| own.solution.iterate.f;
    let best = converged.min_by(|a, b| objective(a).total_cmp(&objective(b)))?;
    Some((objective(&best), best.theta()))
}

impl Scout {
    fn has_converged(&self) -> bool {
        has_converged(&self.solved)
    }

    fn objective(&self) -> f64 {
        self.solved.within(NEARLY)
    }

    /// Whether both have converged to the same optimum.
    fn is_same(&self, posed: &Posed<'_>, other: &Self) -> bool {
        let [f, g] = [self, other].map(|own| own.solved.solution.iterate.f);
        is_same(f, g)
            && self.has_converged()
            && other.has_converged()
            && self.whole.is_some() == other.whole.is_some()
            && !are_apart(posed, &self.solved, &other.solved)
    }

    /// Continues to the end, on the whole mesh.
    fn finished(
        self,
        posed: &Posed<'_>,
        known: Option<&(f64, Vec<f64>)>,
        watch: &Watch<'_, '_>,
    ) -> Solved {
        let limit = posed.most_iterations;
        let behind = Mutex::new(Behind::new(known.map(|own| own.0)));
        let see = |iteration: &_| ahead(&behind, watch, self.number, iteration);
        let (before, has_converged) = (self.solved.solution.work, self.has_converged());
        let is_used_up = before.iterations >= limit;
        let from = match self.whole {
            None if has_converged || is_used_up => return self.solved,
            // A parameter that grows without end keeps the size that it had where it was fitted: it makes ever less difference.
            None if self.start.is_raised => {
                let Solved { problem, solution } = self.solved;
                (problem, solution.iterate.z)
            }
            None => rescaled(&self.solved),
            Some(whole) if has_converged => rescaled_with(&self.solved, whole),
            // A coarse mesh may have no solution.
            Some(_) => begin(posed, &self.start, &|| watch.is_over()),
        };
        let mut own = solve(posed, from, limit, &see);
        own.solution.work += before;
        let is_tie = own.solution.status == Status::Stopped && !watch.is_over();
        match known.filter(|(best, _)| is_tie && is_same(*best, own.solution.iterate.f)) {
            Some((_, theta)) if !are_near(theta, &own.theta()) => {
                onward(posed, own, self.number, watch)
            }
            _ => own,
        }
    }
}

/// Continues a start that was given up beside one of the same height, but has other parameters.
fn onward(posed: &Posed<'_>, own: Solved, number: usize, watch: &Watch<'_, '_>) -> Solved {
    let Solved { problem, solution } = own;
    let see = |iteration: &_| watch.see(number, 0, iteration);
    let limit = posed.most_iterations;
    let mut own = solve(posed, (problem, solution.iterate.z), limit, &see);
    own.solution.work += solution.work;
    own
}

/// Marked as dropped if only its limit in the race ended it: it was behind, and no limit set by the user ended it.
pub(super) fn dropped(mut solved: Solved) -> Solved {
    if solved.solution.status == Status::IterationLimit {
        solved.solution.status = Status::Stopped;
    }
    solved
}

/// Continues these starts to the end, or until they are lost against a known objective.
fn finish(
    posed: &Posed<'_>,
    (scouts, known): (Vec<Scout>, Option<(f64, Vec<f64>)>),
    solved: &mut [Option<Solved>],
    watch: &Watch<'_, '_>,
) {
    let finished = scouts
        .into_par_iter()
        .map(|own| (own.number, own.finished(posed, known.as_ref(), watch)));
    let finished: Vec<(usize, Solved)> = finished.collect();
    for (k, own) in finished {
        solved[k] = Some(own);
    }
}

/// Continues these starts from their current iterates.
fn go_on(
    posed: &Posed<'_>,
    solved: &mut [Option<Solved>],
    open: Vec<usize>,
    watch: &Watch<'_, '_>,
) {
    let limit = posed.most_iterations;
    let finish = |k: usize| {
        let own = solved[k].as_ref().filter(|_| !watch.is_over())?;
        let see = |iteration: &_| watch.see(k, 0, iteration);
        Some((k, solve(posed, rescaled(own), limit, &see)))
    };
    let finished: Vec<(usize, Solved)> = open.into_par_iter().filter_map(finish).collect();
    for (k, own) in finished {
        solved[k] = Some(own);
    }
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
    posed: &Posed<'_>,
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
    // Those with the same parameters are one solution.
    let theta = solved
        .get(first)
        .and_then(|own| Some(own.as_ref()?.theta()));
    let theta = theta.unwrap_or_default();
    let is_first =
        |(k, own): &(usize, &Solved)| *k == first || !are_within(&theta, &own.theta(), OPEN);
    let equal: Vec<(usize, &Solved)> = equal.into_iter().filter(is_first).collect();
    if class > 0 || equal.len() < 2 || watch.is_over() {
        return (first, None);
    }
    let errors = |(k, own): (usize, &Solved)| {
        let errors =
            own.problem
                .mesh_errors(&own.solution.iterate.z, refine::tolerance(posed), &|| {
                    watch.is_over()
                });
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

pub(super) fn has_converged(solved: &Solved) -> bool {
    solved.solution.status == Status::Converged && solved.solution.iterate.f.is_finite()
}

#[cfg(test)]
mod tests;
