//! The result of a fit in which no start has converged. Iterates on the way to an optimum do not satisfy the equations,
//! and their objectives do not belong to any run. The best parameters so far are therefore those with the best
//! simulation.

use super::check::simulation;
use super::watch::Watch;
use crate::posed::{Posed, Stands};
use crate::search::begin::begin;
use crate::search::solved::{MET, SAME, Solved};
use crate::search::starts::Start;
use pilotage_collocation::{Collocation, Stop};
use pilotage_sqp::iterate::violation;
use pilotage_sqp::{Iterate, Kkt, Problem, Solution, Status};
use rayon::prelude::*;
use std::time::Instant;

/// If no start has converged, the one with the lowest objective that satisfies the equations: as the solver left it, or
/// simulated with its parameters. The given start in its initial state is also considered. None if none satisfies the
/// equations, or if the constraints are infeasible.
pub(super) fn best_met(
    posed: &Posed<'_>,
    given: &Start,
    solved: &[Option<Solved>],
    watch: &Watch<'_, '_>,
) -> Option<(usize, Solved)> {
    let clock = Instant::now();
    let stop = || watch.is_late(clock);
    let is_open = |own: &&Solved| {
        !matches!(
            own.solution.status,
            Status::UndefinedStart | Status::Infeasible
        )
    };
    let open = solved.par_iter().enumerate();
    let open = open.filter_map(|(k, own)| Some((k, own.as_ref().filter(is_open)?)));
    let settled = open.filter_map(|(k, own)| Some((k, settled(posed, own, &stop)?)));
    let mut met: Vec<(usize, Solved)> = settled.collect();
    if let Some(own) = solved.first().and_then(Option::as_ref).filter(is_open) {
        let begun = begun(posed, given, &own.solution, &stop);
        met.extend(begun.map(|begun| (0, begun)));
    }
    met.retain(|(_, own)| own.within(MET).is_finite());
    let objective = |own: &Solved| own.solution.iterate.f / posed.factor;
    met.into_iter()
        .min_by(|(_, a), (_, b)| objective(a).total_cmp(&objective(b)))
}

/// The solver's last iterate if it satisfies the equations, else a simulation with its parameters.
pub(super) fn settled(posed: &Posed<'_>, own: &Solved, stop: &Stop<'_>) -> Option<Solved> {
    let (problem, solution) = (&own.problem, &own.solution);
    let z = &solution.iterate.z;
    if own.within(MET).is_finite() {
        return Some(Solved {
            problem: problem.clone(),
            solution: solution.clone(),
        });
    }
    let mut theta = problem.physical_theta(z);
    keep_ranges(posed, &mut theta);
    let found = simulation(posed, (problem, z), &theta, stop)?;
    Some(at(found, solution))
}

/// Whether a solution that satisfies the equations is better than another.
pub(super) fn is_better(own: &Solved, other: &Solved) -> bool {
    let best = other.solution.iterate.f;
    own.within(MET) < best - SAME * best.abs()
}

/// The given start, simulated.
fn begun(posed: &Posed<'_>, given: &Start, left: &Solution, stop: &Stop<'_>) -> Option<Solved> {
    let start = Start {
        follows: false,
        ..given.clone()
    };
    let (problem, z) = begin(posed, &start, stop);
    let theta = problem.physical_theta(&z);
    let found = simulation(posed, (&problem, &z), &theta, stop)?;
    Some(at(found, left))
}

/// A simulation in place of the solver's last iterate. It satisfies the equations, though not those of a mesh, but may
/// violate the constraints.
fn at((problem, z): (Collocation, Vec<f64>), left: &Solution) -> Solved {
    let iterate = Iterate::new(&problem, z);
    let (lower, upper) = problem.limits();
    let outside = iterate.g.iter().zip(lower.iter().zip(upper));
    let outside = outside.map(|(g, (lower, upper))| violation(*g, *lower, *upper));
    let primal = match iterate.is_finite() {
        true => outside.fold(0.0, f64::max),
        false => f64::INFINITY,
    };
    let solution = Solution {
        kkt: Kkt { primal, ..left.kkt },
        curvature: None,
        iterate,
        ..left.clone()
    };
    Solved { problem, solution }
}

/// Clamps shared parameters to their ranges.
fn keep_ranges(posed: &Posed<'_>, theta: &mut [f64]) {
    for (unknown, stands) in &posed.unknowns {
        if let Stands::Shared(_) | Stands::Subjects(_) = stands {
            let [low, high] = unknown.searched_range();
            let places = stands.variables(0);
            places
                .into_iter()
                .for_each(|k| theta[k] = theta[k].clamp(low, high));
        }
    }
}
