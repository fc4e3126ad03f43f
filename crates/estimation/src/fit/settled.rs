//! Solves in which times of conditions are sought, such as that of a switch: a boundary of the mesh stands where the time was, and
//! is moved to where it is, until both agree (`posed::switches`).

use crate::posed::Posed;
use crate::posed::switches::Switches;
use crate::search::solved::Solved;
use pilotage_collocation::{Collocation, Run};
use pilotage_sqp::Status;

/// Maximum number of moves of the boundaries.
const MOST: usize = 60;

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

/// Solves from a point, and again with moved boundaries until the sought times agree with them. Without convergence, the last
/// solve.
pub(super) fn settled(
    posed: &Posed<'_>,
    from: (Collocation, Vec<f64>),
    mut solve: impl FnMut((Collocation, Vec<f64>)) -> Solved,
) -> Solved {
    let Some(switches) = &posed.switches else {
        return solve(from);
    };
    let start = crate::search::solved::initial(&from.0, &from.1);
    let mut place = Place {
        theta: from.0.physical_theta(&from.1),
        initial: start,
    };
    let mut solved = solve(from);
    let (mut part, mut last): (f64, Vec<f64>) = (1.0, Vec::new());
    for _ in 0..MOST {
        let end = Place::of(&solved);
        let offsets = offsets(switches, &solved.problem.runs, &end);
        if solved.solution.status != Status::Converged || Switches::agree(&offsets) {
            return solved;
        }
        let own: Vec<f64> = offsets.iter().map(|(offset, _)| *offset).collect();
        // Times that come back were moved too far: beyond a sample the objective has a kink.
        let product: f64 = own.iter().zip(&last).map(|(a, b)| a * b).sum();
        part = if product < 0.0 {
            0.5 * part
        } else {
            (1.5 * part).min(1.0)
        };
        last = own;
        // No time leaves its run, where nothing depends on it.
        let (mut next, mut way) = (place.towards(&end, part), part);
        while way > LEAST && !are_inside(switches, &solved.problem.runs, &next) {
            way *= 0.5;
            next = place.towards(&end, way);
        }
        if way <= LEAST {
            break;
        }
        let from = moved((posed, switches), &solved, &next);
        let before = solved.solution.work;
        solved = solve(from);
        solved.solution.work += before;
        place = next;
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
