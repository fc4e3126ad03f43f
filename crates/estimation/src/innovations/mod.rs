//! The fit of one-step predictions, for systems driven by noise.
//!
//! It begins at the responses fitted by [`mod@crate::fit`]. Unknowns that do not affect the response, such as
//! densities, begin at their start values. The search is Fisher scoring with the SQP of `pilotage-sqp`, and Newton's
//! method if that is slow.
//!
//! | module | contents |
//! | --- | --- |
//! | `likelihood` | innovations and their derivatives |
//! | `limits` | ranges and constraints |
//! | `program` | both as a nonlinear program |
//! | `ahead` | predictions and innovations of a run, for results |
//! | `linearised` | a solution as a least-squares problem, for its covariance |
//! | `again` | a solution, solved again: profiles and bootstraps |

mod again;
mod ahead;
mod likelihood;
mod limits;
mod linearised;
mod program;
#[cfg(test)]
mod tests;

pub(crate) use again::Again;
pub use again::Optimum;
pub use ahead::Ahead;
pub(crate) use ahead::ahead;
pub use likelihood::Likelihood;
pub(crate) use linearised::{linearised, timed};

use crate::posed::Posed;
use crate::search::begin::initial;
use crate::search::solved::Solved;
use crate::search::starts::Start;
use pilotage_sqp::{Iteration, Solution, SparseQp, SqpOptions, Status, solve};
use program::Program;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Maximum number of response solutions from which the search begins.
const MOST_BEGINS: usize = 3;

/// Parameters with a smaller relative difference belong to the same solution.
const SAME: f64 = 1e-3;

/// Maximum number of iterations with Fisher information. A search that needs more continues with the Hessian.
const SCORED: usize = 25;

/// Maximum number of searches from one initial guess: with other scales, more parts of each interval, or the Hessian.
const ROUNDS: usize = 5;

/// Scaled unknowns above this require another scale.
const LARGE: f64 = 10.0;

/// The result of a search.
pub struct Predicted<'p> {
    /// The program that was solved.
    pub(crate) program: Program<'p>,
    /// Its solution.
    pub(crate) solution: Solution,
    /// Iterations of all searches from that initial guess.
    pub(crate) iterations: usize,
}

impl Predicted<'_> {
    /// The estimated unknowns.
    pub fn unknowns(&self) -> Vec<f64> {
        self.program.unknowns(&self.solution.iterate.z)
    }

    /// The objective `Σ weight (ln s + e²/s)`, plus the priors.
    pub fn objective(&self) -> f64 {
        self.solution.iterate.f / self.program.factor
    }
}

/// An initial guess: the unknowns of a response, and their magnitudes.
#[derive(Debug, Clone)]
pub(crate) struct Begin {
    unknowns: Vec<f64>,
    scales: Vec<f64>,
}

impl Begin {
    /// From a solution of the response.
    fn of(likelihood: &Likelihood<'_>, runs: usize, solved: &Solved) -> Self {
        let (problem, z) = (&solved.problem, &solved.solution.iterate.z);
        let mut unknowns = problem.physical_theta(z);
        let mut scales = problem.model.scales.parameters.clone();
        let initial = solved.initial();
        for (j, initial) in initial.iter().enumerate().take(runs) {
            let free = likelihood.free(j);
            unknowns.extend(free.iter().map(|k| initial[*k]));
            scales.extend(free.iter().map(|k| problem.model.scales.states[*k]));
        }
        Self { unknowns, scales }
    }

    fn is_same(&self, other: &Self) -> bool {
        let pairs = self.unknowns.iter().zip(&other.unknowns).zip(&self.scales);
        pairs
            .into_iter()
            .all(|((a, b), s)| (a - b).abs() <= SAME * s)
    }
}

/// The objective at a start, with free states at their guesses; NaN if no noise drives the system.
pub(crate) fn value(posed: &Posed<'_>, start: &Start) -> f64 {
    let Some(likelihood) = Likelihood::of(posed) else {
        return f64::NAN;
    };
    let (theta, own) = start.parameters.split_at(posed.shared);
    let mut unknowns = theta.to_vec();
    for j in 0..posed.runs.len() {
        let initial = initial(posed, own, j);
        unknowns.extend(likelihood.free(j).iter().map(|k| initial[*k]));
    }
    likelihood.refined(&unknowns).value(&unknowns)
}

/// Initial guesses of the search: the best response, and others that converged elsewhere.
pub(crate) fn begins(posed: &Posed<'_>, solved: &[Option<Solved>]) -> Vec<Begin> {
    let Some(likelihood) = Likelihood::of(posed) else {
        return Vec::new();
    };
    let converged = solved.iter().flatten();
    let converged = converged.filter(|own| own.solution.status == Status::Converged);
    let mut all: Vec<&Solved> = converged.collect();
    all.sort_by(|a, b| a.solution.iterate.f.total_cmp(&b.solution.iterate.f));
    let mut begins: Vec<Begin> = Vec::new();
    for own in all {
        let begin = Begin::of(&likelihood, posed.runs.len(), own);
        if begins.len() < MOST_BEGINS && !begins.iter().any(|other| other.is_same(&begin)) {
            begins.push(begin);
        }
    }
    begins
}

/// Called with each iterate of a search and the number of its initial guess.
pub(crate) type See<'a> = dyn Fn(usize, &Iteration) -> ControlFlow<Status> + Sync + 'a;

/// Searches from the best response and from other initial guesses. The best result comes first.
pub(crate) fn predicted<'p>(
    posed: &'p Posed<'p>,
    best: &Solved,
    others: Vec<Begin>,
    see: &See<'_>,
) -> Vec<Predicted<'p>> {
    let Some(likelihood) = Likelihood::of(posed) else {
        return Vec::new();
    };
    let first = Begin::of(&likelihood, posed.runs.len(), best);
    let others = others.into_iter().filter(|own| !own.is_same(&first));
    let mut begins = vec![first.clone()];
    begins.extend(others);
    let search = |(k, begin)| searched(posed, likelihood, begin, &|own| see(k, own));
    let all = begins.into_par_iter().enumerate().map(search);
    let mut all: Vec<Predicted<'p>> = all.collect();
    let key = |own: &Predicted<'_>| (own.solution.status != Status::Converged, own.objective());
    all.sort_by(|a, b| {
        let (a, b) = (key(a), key(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    all
}

/// Searches from one initial guess.
fn searched<'p>(
    posed: &'p Posed<'p>,
    likelihood: Likelihood<'p>,
    begin: Begin,
    see: &(dyn Fn(&Iteration) -> ControlFlow<Status> + Sync),
) -> Predicted<'p> {
    let Begin {
        mut unknowns,
        mut scales,
    } = begin;
    let mut options = SqpOptions {
        tolerance: posed.file.options.tolerance,
        max_iterations: posed.file.options.max_iterations.min(SCORED),
        ..SqpOptions::default()
    };
    let mut is_exact = false;
    let (mut likelihood, mut iterations, mut round) = (likelihood.refined(&unknowns), 0, 0);
    loop {
        let mut program = Program::new(posed, likelihood, scales.clone(), &unknowns);
        program.is_exact = is_exact;
        let z = program.scaled(&unknowns);
        let qp = &mut SparseQp::default();
        let unscaled = |own: &Iteration| Iteration {
            objective: own.objective / program.factor,
            ..*own
        };
        let solution = solve(&program, qp, z, &options, &mut |own| see(&unscaled(own)));
        iterations += solution.work.iterations;
        round += 1;
        let z = &solution.iterate.z;
        unknowns = program.unknowns(z);
        let finer = likelihood.refined(&unknowns);
        let is_scaled = z.iter().all(|own| own.abs() <= LARGE);
        let is_done =
            is_scaled && solution.status == Status::Converged && finer.parts == likelihood.parts;
        let is_limited = solution.status == Status::IterationLimit && !is_exact;
        let is_open = matches!(solution.status, Status::Converged | Status::NoProgress);
        let is_over = !is_open && !is_limited;
        if is_done || is_over || round == ROUNDS {
            return Predicted {
                program,
                solution,
                iterations,
            };
        }
        likelihood = finer;
        if solution.status != Status::Converged {
            is_exact = true;
            options.max_iterations = posed.file.options.max_iterations;
        }
        let sized = |(s, z): (&f64, &f64)| s * z.abs().max(SAME);
        scales = scales.iter().zip(z).map(sized).collect();
    }
}
