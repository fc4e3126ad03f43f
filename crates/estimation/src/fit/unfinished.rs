//! What stands for a fit in which no start has converged. Iterates on the way to an optimum do not fulfil the equations,
//! and their objectives are those of no run; so the best parameters so far are those with which a simulation is best.

use super::check::simulation;
use super::watch::Watch;
use crate::posed::{Posed, Stands};
use crate::search::begin::begin;
use crate::search::solved::{MET, Solved};
use crate::search::starts::Start;
use pilotage_collocation::{Collocation, Stop};
use pilotage_sqp::iterate::violation;
use pilotage_sqp::{Iterate, Kkt, Problem, Solution, Status};
use rayon::prelude::*;
use std::time::Instant;

/// Of starts of which none has converged the one with the least objective where the equations are met: as the solver
/// left it, or simulated with its parameters. The given start as it begins is among them. None where nothing is met, or
/// the constraints are what cannot be met.
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

/// What the solver left where that fulfils the equations, else a simulation with its parameters.
fn settled(posed: &Posed<'_>, own: &Solved, stop: &Stop<'_>) -> Option<Solved> {
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

/// A simulation in place of the solution to which a solver has come. It fulfils the equations, if not those of a mesh;
/// what it may violate are the constraints.
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

/// Puts shared parameters that an iterate has out of their ranges on their ends.
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
