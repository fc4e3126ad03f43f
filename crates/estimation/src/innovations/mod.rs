//! The fit of what is predicted from one sample to the next, where noise drives the system.
//!
//! It begins where the responses of [`mod@crate::fit`] ended: unknowns of which these know nothing, such as densities, are
//! at their starts there. The search is Fisher's scoring by the SQP of `pilotage-sqp`, and where that is slow Newton's method.
//!
//! | module | what it holds |
//! | --- | --- |
//! | `likelihood` | innovations, and their derivatives |
//! | `limits` | ranges and constraints |
//! | `program` | both as a nonlinear program |
//! | `ahead` | predictions and innovations of a run, as results have them |
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
pub(crate) use linearised::linearised;

use crate::posed::Posed;
use crate::search::begin::initial;
use crate::search::solved::Solved;
use crate::search::starts::Start;
use pilotage_sqp::{Iteration, Solution, SparseQp, SqpOptions, Status, solve};
use program::Program;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Solutions of the response from which the search begins, at most.
const MOST_BEGINS: usize = 3;

/// Parameters that differ by less than this part are those of one solution.
const SAME: f64 = 1e-3;

/// Iterations by Fisher's information; a search that needs more goes on with the curvature itself.
const SCORED: usize = 25;

/// Searches from one begin: with other scales, with more parts of each interval, or with the curvature itself.
const ROUNDS: usize = 5;

/// Scaled unknowns beyond this want another scale.
const LARGE: f64 = 10.0;

/// What a search has come to.
pub struct Predicted<'p> {
    /// The program that was solved.
    pub(crate) program: Program<'p>,
    /// Its solution.
    pub(crate) solution: Solution,
    /// Iterations of all searches from that begin.
    pub(crate) iterations: usize,
}

impl Predicted<'_> {
    /// What was found.
    pub fn unknowns(&self) -> Vec<f64> {
        self.program.unknowns(&self.solution.iterate.z)
    }

    /// The objective `Σ weight (ln s + e²/s)`, with what is known beforehand.
    pub fn objective(&self) -> f64 {
        self.solution.iterate.f / self.program.factor
    }
}

/// The unknowns of a response, and magnitudes of them.
#[derive(Debug, Clone)]
pub(crate) struct Begin {
    unknowns: Vec<f64>,
    scales: Vec<f64>,
}

impl Begin {
    /// Of a solution of the response.
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

/// The objective at a start, free states at their guesses; not a number where no noise drives the system.
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

/// Where the search begins: at the best response, and at others that converged elsewhere.
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

/// Sees each iterate of the search from a begin, by its number.
pub(crate) type See<'a> = dyn Fn(usize, &Iteration) -> ControlFlow<Status> + Sync + 'a;

/// The searches from the best response and from other begins; the best first.
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

/// The search from one begin.
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
        let told = |own: &Iteration| Iteration {
            objective: own.objective / program.factor,
            ..*own
        };
        let solution = solve(&program, qp, z, &options, &mut |own| see(&told(own)));
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
