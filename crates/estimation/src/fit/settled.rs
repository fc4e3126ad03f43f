//! Solves in which times of conditions are sought, such as that of a switch: a boundary of the mesh stands where the time was, and
//! is moved to where it is, until both agree (`posed::switches`).

use crate::posed::Posed;
use crate::posed::switches::Switches;
use crate::search::solved::Solved;
use pilotage_collocation::{Collocation, Run};
use pilotage_sqp::Status;

/// Maximum number of moves of the boundaries.
const MOST: usize = 100;

/// Iterations of a solve while times are far from their boundaries.
const STRIDE: usize = 2;

/// Distance of a time from its boundary, relative to the run, from which on a solve goes on to its end.
const CLOSE: f64 = 1e-3;

/// Smallest part of a move.
const LEAST: f64 = 1e-4;

/// Parameters and initial states of each run at which boundaries stand.
struct Place {
    theta: Vec<f64>,
    initial: Vec<Vec<f64>>,
}

impl Place {
    fn of(solved: &Solved) -> Self {
        Self {
            theta: solved.theta(),
            initial: solved.initial(),
        }
    }

    /// The place at this part of the way to another one.
    fn towards(&self, other: &Self, part: f64) -> Self {
        let mixed = |from: &[f64], to: &[f64]| -> Vec<f64> {
            let pairs = from.iter().zip(to);
            pairs.map(|(from, to)| from + part * (to - from)).collect()
        };
        let pairs = self.initial.iter().zip(&other.initial);
        Self {
            theta: mixed(&self.theta, &other.theta),
            initial: pairs.map(|(from, to)| mixed(from, to)).collect(),
        }
    }
}

/// Solves from a point with at most `limit` iterations, and again with moved boundaries until the sought times agree with them. As
/// long as they move far a solve ends after a few iterations, since what it knows of a time holds near its boundary alone.
pub(super) fn settled(
    posed: &Posed<'_>,
    from: (Collocation, Vec<f64>),
    limit: usize,
    mut solve: impl FnMut((Collocation, Vec<f64>), usize) -> Solved,
) -> Solved {
    let Some(switches) = &posed.switches else {
        return solve(from, limit);
    };
    let start = crate::search::solved::initial(&from.0, &from.1);
    let mut place = Place {
        theta: from.0.physical_theta(&from.1),
        initial: start,
    };
    let mut solved = solve(from, STRIDE.min(limit));
    let (mut part, mut last): (f64, Vec<f64>) = (1.0, Vec::new());
    for _ in 0..MOST {
        let end = Place::of(&solved);
        let runs = &solved.problem.runs;
        let offsets = offsets(switches, runs, &end);
        let used = solved.solution.work.iterations;
        let status = solved.solution.status;
        let does_go_on = match status {
            Status::Converged => !Switches::agree(&offsets),
            Status::IterationLimit => used < limit,
            _ => false,
        };
        if !does_go_on {
            return solved;
        }
        let own: Vec<f64> = offsets.iter().map(|(offset, _)| *offset).collect();
        // Times that come back were moved too far: beyond a sample the objective has a kink.
        let product: f64 = own.iter().zip(&last).map(|(a, b)| a * b).sum();
        part = match product < 0.0 {
            true => 0.5 * part,
            false => (1.5 * part).min(1.0),
        };
        // No time leaves its run, where nothing depends on it.
        let mut next = place.towards(&end, part);
        while !are_inside(switches, runs, &next) {
            part *= 0.5;
            if part < LEAST {
                solved.solution.status = Status::NoProgress;
                return solved;
            }
            next = place.towards(&end, part);
        }
        let farthest = own.iter().fold(0.0, |most: f64, own| most.max(own.abs()));
        let stride = if farthest > CLOSE { STRIDE } else { limit };
        let from = moved((posed, switches), &solved, &next);
        let before = solved.solution.work;
        solved = solve(from, stride.min(limit - used.min(limit)).max(1));
        solved.solution.work += before;
        (place, last) = (next, own);
    }
    solved.solution.status = Status::NoProgress;
    solved
}

fn offsets(switches: &Switches, runs: &[Run], at: &Place) -> Vec<(f64, bool)> {
    let pairs = runs.iter().zip(&at.initial);
    pairs
        .flat_map(|(run, initial)| switches.offsets(run, &at.theta, initial))
        .collect()
}

fn are_inside(switches: &Switches, runs: &[Run], at: &Place) -> bool {
    offsets(switches, runs, at)
        .iter()
        .all(|(_, is_inside)| *is_inside)
}

/// The problem of a solution with boundaries at this place, and its variables.
fn moved(
    (posed, switches): (&Posed<'_>, &Switches),
    solved: &Solved,
    place: &Place,
) -> (Collocation, Vec<f64>) {
    let (problem, system) = (&solved.problem, &posed.model.system);
    let runs = problem.runs.iter().zip(&place.initial);
    let runs = runs.map(|(run, initial)| switches.placed(system, run, &place.theta, initial));
    let next = problem.with_runs(runs.collect());
    let z = problem.carried(&solved.solution.iterate.z, &next);
    (next, z)
}
