//! Parameters without effect at an optimum, as a limit on the rate where nothing moves so fast: no search leaves such a plateau, and
//! the optimum may lie beyond it. Other values across the range are simulated, and the best of those that have an effect is solved.

use super::check;
use super::race::has_converged;
use super::solve::solve;
use super::watch::Watch;
use crate::posed::unknowns::Unknown;
use crate::posed::{Posed, Stands};
use crate::result::uncertainty::linearised;
use crate::search::begin::{Point, at_point};
use crate::search::solved::{SAME, Solved};
use pilotage_inference::Inference;

/// Number of values that are tried.
const VALUES: u32 = 12;
/// Factor from the typical magnitude to an end of the range that is not given, or is 0.
const FAR: f64 = 1e3;
/// Relative change of the objective that is an effect.
const EFFECT: f64 = 1e-6;

/// A better solution with another value of a parameter that has no effect at this one, which start `number` has led to.
pub(super) fn beyond(
    posed: &Posed<'_>,
    solved: &Solved,
    number: usize,
    watch: &Watch<'_, '_>,
) -> Option<Solved> {
    if !has_converged(solved) || !posed.may_have_kinks() {
        return None;
    }
    let mut best = None;
    for (unknown, k) in idle(posed, solved) {
        let Some(own) = tried(posed, solved, (unknown, k), number, watch) else {
            continue;
        };
        let least = best.as_ref().unwrap_or(solved).solution.iterate.f;
        if has_converged(&own) && own.solution.iterate.f < least - SAME * least.abs() {
            best = Some(own);
        }
    }
    best
}

/// The shared parameters without effect.
fn idle<'p>(posed: &'p Posed<'_>, solved: &Solved) -> Vec<(&'p Unknown, usize)> {
    let linear = linearised(posed, &solved.problem, &solved.solution.iterate);
    let directions = linear.and_then(|own| Some(Inference::new(&own.data).ok()?.directions));
    let is_idle = |k: usize| {
        directions.iter().flatten().any(|own| {
            let mut parts = own.0.iter().enumerate().filter(|(_, part)| **part != 0.0);
            parts.all(|(place, _)| place == k)
        })
    };
    let unknowns = posed.unknowns.iter().flat_map(|(unknown, stands)| {
        let places = match stands {
            Stands::State(_) => Vec::new(),
            shared => shared.variables(0),
        };
        places.into_iter().map(move |k| (unknown, k))
    });
    unknowns.filter(|(_, k)| is_idle(*k)).collect()
}

/// The solution from the value with the best simulation among those that have an effect.
fn tried(
    posed: &Posed<'_>,
    solved: &Solved,
    (unknown, k): (&Unknown, usize),
    number: usize,
    watch: &Watch<'_, '_>,
) -> Option<Solved> {
    let theta = solved.theta();
    let with = |value: f64| {
        let mut theta = theta.clone();
        theta[k] = value;
        theta
    };
    let simulated = |value: f64| check::with(posed, solved, &with(value), watch);
    let here = simulated(theta[k])?;
    let known = values(unknown).filter_map(|value| Some((value, simulated(value)?)));
    let has_effect = |own: &(f64, f64)| (own.1 - here).abs() > EFFECT * here.abs();
    let best = known
        .filter(has_effect)
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let point = Point {
        theta: &with(best.0),
        runs: (0..posed.runs.len()).collect(),
        initial: solved.initial(),
        follows: false,
        is_fitted: true,
        is_raised: false,
        is_kept: false,
    };
    let from = at_point(posed, &point, None, &|| watch.is_over());
    let see = |iteration: &_| watch.see(number, 0, iteration);
    (!watch.is_over()).then(|| solve(posed, from, posed.file.options.max_iterations, &see))
}

/// Values across the range of a parameter, with the sign of its start, in equal ratios; in the coordinates of the search.
fn values(unknown: &Unknown) -> impl Iterator<Item = f64> {
    let sign = if unknown.start < 0.0 { -1.0 } else { 1.0 };
    let ends = match sign > 0.0 {
        true => [unknown.min, unknown.max],
        false => [unknown.max, unknown.min],
    };
    let [near, far] = ends.map(|end| end.map(|end| sign * end));
    let size = match unknown.start == 0.0 {
        true => unknown.nominal.unwrap_or(1.0),
        false => unknown.start.abs(),
    };
    let low = near.filter(|own| *own > 0.0).unwrap_or(size / FAR);
    let high = far
        .filter(|own| *own > low)
        .unwrap_or((size * FAR).max(low));
    let value = move |k: u32| low * (high / low).powf(f64::from(k) / f64::from(VALUES - 1));
    let all: Vec<f64> = (0..VALUES)
        .map(|k| unknown.searched(unknown.kept(sign * value(k))))
        .collect();
    all.into_iter()
}
