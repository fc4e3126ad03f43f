//! A solution on ever finer meshes.

use super::solve::{Solved, solve};
use super::{MOST_INTERVALS, See};
use crate::file::Mesh;
use crate::posed::Posed;
use pilotage_collocation::{Collocation, refined};
use pilotage_sqp::Status;

/// How often a mesh is refined at most.
const MOST_REFINEMENTS: usize = 12;

/// How a mesh was refined.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Refinement {
    /// How often.
    pub rounds: usize,
    /// Intervals of all runs.
    pub intervals: usize,
    /// Largest estimated relative error of a state.
    pub error: f64,
    /// Largest change of each shared parameter by the last refinement, relative to its scale.
    pub changes: Vec<f64>,
    /// Iterations of all solves.
    pub iterations: usize,
}

/// The same on meshes that are refined until their errors are small enough, each solve from the one before. One that
/// does not converge is left, with the mesh before it.
pub(super) fn refine(posed: &Posed<'_>, mut solved: Solved, see: &See<'_>) -> (Solved, Refinement) {
    let tolerance = match posed.file.options.mesh {
        Mesh::Tolerance(tolerance) => tolerance,
        Mesh::Step(_) | Mesh::Samples => f64::INFINITY,
    };
    let mut told = Refinement {
        iterations: solved.solution.work.iterations,
        ..Refinement::default()
    };
    loop {
        let errors = solved.problem.mesh_errors(&solved.solution.iterate.z);
        told.error = errors.iter().flatten().copied().fold(0.0, f64::max);
        told.intervals = errors.iter().map(Vec::len).sum();
        let is_over =
            told.rounds == MOST_REFINEMENTS || solved.solution.status != Status::Converged;
        if told.error <= tolerance || is_over {
            return (solved, told);
        }
        let Some(from) = finer(posed, &solved, &errors, tolerance) else {
            return (solved, told);
        };
        let limit = posed.file.options.max_iterations;
        let next = solve(posed, from, limit, &|iteration| {
            see(told.rounds + 1, iteration)
        });
        told.iterations += next.solution.work.iterations;
        if next.solution.status != Status::Converged {
            return (solved, told);
        }
        told.changes = changes(&solved, &next);
        told.rounds += 1;
        solved = next;
    }
}

/// The problem on a mesh that is finer where its errors are large, and its variables there; none where that has too
/// many intervals.
fn finer(
    posed: &Posed<'_>,
    solved: &Solved,
    errors: &[Vec<f64>],
    tolerance: f64,
) -> Option<(Collocation, Vec<f64>)> {
    let scheme = posed.file.options.scheme;
    let pairs = solved.problem.runs.iter().zip(errors);
    let meshes = pairs.map(|(run, own)| refined(run, own, scheme, tolerance));
    let meshes: Vec<Vec<f64>> = meshes.collect();
    if meshes.iter().map(Vec::len).sum::<usize>() > MOST_INTERVALS {
        return None;
    }
    let finer = solved.problem.with_meshes(meshes);
    let z = solved.problem.carried(&solved.solution.iterate.z, &finer);
    Some((finer, z))
}

/// By how much each scaled shared parameter differs.
fn changes(before: &Solved, after: &Solved) -> Vec<f64> {
    let [before, after] = [before, after].map(|own| own.problem.theta(&own.solution.iterate.z));
    let pairs = before.iter().zip(after);
    pairs.map(|(a, b)| (a - b).abs()).collect()
}
