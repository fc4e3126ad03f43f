//! Refines the mesh of a solution.

use super::race::has_converged;
use super::solve::solve;
use super::watch::Watch;
use crate::posed::MOST_INTERVALS;
use crate::posed::Posed;
use crate::problem::file::Mesh;
use crate::search::begin::{Point, at_point};
use crate::search::solved::{Refinement, SAME, STIFF_SCHEME, Solved};
use pilotage_collocation::{Collocation, refined};
use pilotage_sqp::Status;

/// A solution, and the local errors of its mesh if known.
type Estimated = (Solved, Option<Vec<Vec<f64>>>);

/// How many times a mesh that is fine enough is refined further where parameters still move, and the part of its tolerance then.
const FURTHER: usize = 2;
const FINER: f64 = 0.1;

/// Maximum number of other optima whose mesh is refined.
const OTHERS: usize = 4;

/// Refines the mesh of the best start. Another that is better than what comes of that is refined, too: on a coarse mesh an optimum
/// may lie lower than it is. Returns the start, and its solution on the final mesh.
pub(super) fn finest(
    posed: &Posed<'_>,
    solved: &mut [Option<Solved>],
    (best, errors): (usize, Option<Vec<Vec<f64>>>),
    watch: &Watch<'_, '_>,
) -> (usize, (Solved, Refinement)) {
    let objective = |own: &Solved| own.solution.iterate.f;
    let (mut k, mut errors) = (best, errors);
    let (mut seen, mut found) = (Vec::new(), Vec::new());
    loop {
        let own = solved[k].take().expect("a start that was solved");
        seen.push(objective(&own));
        found.push((k, refine(posed, (own, errors.take()), k, watch)));
        // A mesh that stays coarse, or has no error that is known, comes after all others, unless the iteration limit alone ended its
        // refinement.
        let rank = |own: &(usize, (Solved, Refinement))| {
            let (solved, refinement) = &own.1;
            let is_fine = refinement.error <= tolerance(posed) && has_converged(solved);
            let is_fine = is_fine || refinement.is_limited;
            (!is_fine, objective(solved))
        };
        found.sort_by(|a, b| (rank(a).0.cmp(&rank(b).0)).then(rank(a).1.total_cmp(&rank(b).1)));
        // Where none is fine, a worse one may be.
        let least = match rank(&found[0]) {
            (true, _) => f64::INFINITY,
            (false, own) => own - SAME * own.abs(),
        };
        let is_new = |f: f64| seen.iter().all(|own| (f - own).abs() > SAME * own.abs());
        let others = solved.iter().enumerate().filter_map(|(k, own)| {
            let f = objective(own.as_ref().filter(|own| has_converged(own))?);
            (is_new(f) && f < least).then_some((k, f))
        });
        match others.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((next, _)) if seen.len() <= OTHERS && !watch.is_over() => k = next,
            _ => return found.swap_remove(0),
        }
    }
}

/// The error up to which a mesh is refined.
pub(super) fn tolerance(posed: &Posed<'_>) -> f64 {
    match posed.file.options.mesh {
        Mesh::Tolerance(tolerance) => tolerance,
        Mesh::Step(_) | Mesh::Samples => f64::INFINITY,
    }
}

/// Refines the mesh until its errors are small enough, each solve starting from the previous one. If a solve does not
/// converge, the search continues from a simulation of the last solution. If that does not converge either, the
/// previous mesh is kept.
fn refine(
    posed: &Posed<'_>,
    (mut solved, mut known): Estimated,
    start: usize,
    watch: &Watch<'_, '_>,
) -> (Solved, Refinement) {
    let (mut tolerance, mut further) = (tolerance(posed), FURTHER);
    let mut refinement = Refinement::new(&solved);
    loop {
        let errors = known
            .take()
            .unwrap_or_else(|| errors(posed, &solved, watch));
        refinement.is_done = watch.over().is_none();
        refinement.take(&solved, &errors);
        let is_end =
            refinement.rounds == Refinement::MOST || solved.solution.status != Status::Converged;
        let moves = refinement.error <= tolerance && refinement.left() > Refinement::MOVES;
        if moves && further > 0 {
            (tolerance, further) = (FINER * tolerance, further - 1);
        }
        if !refinement.is_done || is_end || refinement.error <= tolerance {
            return (solved, refinement);
        }
        let mut solve_from = |from: (Collocation, Vec<f64>)| {
            let see = |iteration: &_| watch.see(start, refinement.rounds + 1, iteration);
            let next = solve(posed, from, posed.file.options.max_iterations, &see);
            refinement.iterations += next.solution.work.iterations;
            refinement.is_limited |= next.solution.status == Status::IterationLimit;
            (next.solution.status == Status::Converged).then_some(next)
        };
        let next = finer(&solved, &errors, tolerance).and_then(&mut solve_from);
        let next = next.or_else(|| solve_from(simulated(posed, &solved, watch)));
        refinement.is_done = watch.over().is_none();
        let Some(next) = next else {
            return (solved, refinement);
        };
        refinement.is_limited = false;
        refinement.changes = changes(&solved, &next);
        refinement.rounds += 1;
        solved = next;
    }
}

impl Refinement {
    /// Records the data of a mesh.
    fn take(&mut self, solved: &Solved, errors: &[Vec<f64>]) {
        let largest = errors.iter().flatten().copied().fold(0.0, f64::max);
        self.gain = match self.rounds {
            0 => 1.0,
            _ => largest / self.error,
        };
        self.error = if self.is_done { largest } else { f64::NAN };
        self.intervals = errors.iter().map(Vec::len).sum();
        self.scheme = solved.problem.scheme;
    }
}

fn errors(posed: &Posed<'_>, solved: &Solved, watch: &Watch<'_, '_>) -> Vec<Vec<f64>> {
    let z = &solved.solution.iterate.z;
    (solved.problem).mesh_errors(z, tolerance(posed), &|| watch.is_over())
}

/// The problem on a mesh refined where its errors are large, and its variables there. None if it has too many
/// intervals.
fn finer(solved: &Solved, errors: &[Vec<f64>], tolerance: f64) -> Option<(Collocation, Vec<f64>)> {
    let problem = &solved.problem;
    let pairs = problem.runs.iter().zip(errors);
    let meshes = pairs.map(|(run, own)| refined(run, own, problem.scheme, tolerance));
    let meshes: Vec<Vec<f64>> = meshes.collect();
    if meshes.iter().map(Vec::len).sum::<usize>() > MOST_INTERVALS {
        return None;
    }
    let finer = problem.with_meshes(meshes);
    let z = problem.carried(&solved.solution.iterate.z, &finer);
    Some((finer, z))
}

/// The problem along a simulation with the estimates, on a mesh for that simulation, with the scheme for stiff
/// equations unless the user selected another.
fn simulated(posed: &Posed<'_>, solved: &Solved, watch: &Watch<'_, '_>) -> (Collocation, Vec<f64>) {
    let theta = solved.problem.physical_theta(&solved.solution.iterate.z);
    let point = Point {
        theta: &theta,
        runs: (0..posed.runs.len()).collect(),
        initial: solved.initial(),
        follows: false,
        is_fitted: false,
        is_raised: false,
        is_kept: false,
    };
    let scheme = posed.file.options.scheme.unwrap_or(STIFF_SCHEME);
    at_point(posed, &point, Some(scheme), &|| watch.is_over())
}

/// Change of each scaled shared parameter.
fn changes(before: &Solved, after: &Solved) -> Vec<f64> {
    let [before, after] = [before, after].map(|own| {
        let theta = own.problem.physical_theta(&own.solution.iterate.z);
        let scales = &own.problem.model.scales.parameters;
        theta.into_iter().zip(scales.clone()).collect::<Vec<_>>()
    });
    let pairs = before.iter().zip(&after);
    pairs
        .map(|((a, scale), (b, _))| (a - b).abs() / scale)
        .collect()
}
