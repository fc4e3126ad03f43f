//! The SQP from one point, restarted with other scales if it makes no progress.

use super::kinks::is_optimum;
use super::settled::settled;
use crate::posed::Posed;
use crate::posed::switches::Switches;
use crate::search::solved::Solved;
use pilotage_collocation::{Collocation, Run, Scales};
use pilotage_sqp::{Iteration, SqpOptions, Status, Work};
use std::ops::ControlFlow;

/// [`SqpOptions::short_step`]: with longer steps some starts fail whose states swing up.
const SHORT_STEP: f64 = 0.01;

/// [`SqpOptions::stall`]; whether the point is an optimum is judged afterwards.
const STALL: usize = 15;

/// Maximum number of restarts of a solve without progress, with scales of the current size.
const RESCALED: usize = 3;

/// Called with each iterate of a solve.
pub type SeeIterates<'a> = dyn Fn(&Iteration) -> ControlFlow<Status> + Sync + 'a;

/// Improves an initial guess on a coarser mesh, if that is much smaller. Returns the work it took as well.
pub fn nearer(
    posed: &Posed<'_>,
    (problem, z): (Collocation, Vec<f64>),
    limit: usize,
    see: &SeeIterates<'_>,
) -> ((Collocation, Vec<f64>), Work) {
    let options = sqp_options(posed, limit);
    let (z, work) = pilotage_collocation::nearer(&problem, z, &options, &mut |own| see(own));
    ((problem, z), work)
}

/// Solves from a point, with other scales if it makes no progress. Without convergence the best of these is returned.
pub fn solve(
    posed: &Posed<'_>,
    from: (Collocation, Vec<f64>),
    limit: usize,
    see: &SeeIterates<'_>,
) -> Solved {
    let mut best = once(posed, from, limit, see);
    for _ in 0..RESCALED {
        if best.solution.status != Status::NoProgress {
            break;
        }
        let mut next = once(posed, rescaled(&best), limit, see);
        next.solution.work += best.solution.work;
        best.solution.work = next.solution.work;
        let has_converged = next.solution.status == Status::Converged;
        if !has_converged && next.nearly() >= best.nearly() {
            break;
        }
        best = next;
    }
    // Other scales may lead further.
    if is_optimum(posed, &best) {
        best.solution.status = Status::Converged;
    }
    best
}

/// Solves from a point. Times that are sought agree with their boundaries at the end, if it converges.
pub(super) fn once(
    posed: &Posed<'_>,
    from: (Collocation, Vec<f64>),
    limit: usize,
    see: &SeeIterates<'_>,
) -> Solved {
    let are_sought = posed.switches.as_ref().is_some_and(Switches::are_sought);
    match are_sought {
        true => settled(posed, from, limit, |from, limit| {
            held(posed, from, limit, see)
        }),
        false => held(posed, from, limit, see),
    }
}

/// Solves from a point, with boundaries where they are.
fn held(
    posed: &Posed<'_>,
    (problem, z): (Collocation, Vec<f64>),
    limit: usize,
    see: &SeeIterates<'_>,
) -> Solved {
    let options = sqp_options(posed, limit);
    let solution =
        pilotage_collocation::solve(&problem, z, &options, &mut |iteration| see(iteration));
    let mut solved = Solved { problem, solution };
    if posed.may_have_kinks() && is_optimum(posed, &solved) {
        solved.solution.status = Status::Converged;
    }
    solved
}

/// Options of a solve with an iteration limit.
pub(crate) fn sqp_options(posed: &Posed<'_>, limit: usize) -> SqpOptions {
    SqpOptions {
        tolerance: posed.file.options.tolerance,
        max_iterations: limit,
        short_step: SHORT_STEP,
        stall: Some(STALL),
        ..SqpOptions::default()
    }
}

/// The problem of a solution with scales of the current size of states and parameters, and its variables.
pub(super) fn rescaled(solved: &Solved) -> (Collocation, Vec<f64>) {
    rescaled_with(solved, solved.problem.runs.clone())
}

/// The same on other meshes or with other samples.
pub(super) fn rescaled_with(solved: &Solved, runs: Vec<Run>) -> (Collocation, Vec<f64>) {
    /// Smallest factor by which a scale is reduced at once, so that variables passing through zero keep a scale.
    const LEAST: f64 = 1e-3;
    let problem = &solved.problem;
    let z = &solved.solution.iterate.z;
    let n = problem.n_states();
    let mut largest = vec![0.0_f64; n];
    for j in 0..problem.runs.len() {
        for vector in problem.coefficients(z, j).chunks_exact(n) {
            let pairs = largest.iter_mut().zip(vector);
            pairs.for_each(|(most, x)| *most = most.max(x.abs()));
        }
    }
    let sized = |scales: &[f64], sizes: &[f64]| {
        let pairs = scales.iter().zip(sizes);
        pairs
            .map(|(scale, size)| scale * size.abs().max(LEAST))
            .collect()
    };
    let scales = &problem.model.scales;
    let scales = Scales {
        states: sized(&scales.states, &largest),
        parameters: sized(&scales.parameters, problem.theta(z)),
    };
    let again = Collocation::new(
        problem.model.tapes.clone(),
        problem.constraints.clone(),
        problem.scheme,
        runs,
        scales,
        &problem.bounds,
    );
    let z = problem.carried(z, &again);
    (again, z)
}
