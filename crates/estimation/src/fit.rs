//! The fit of a problem: starts, the SQP from each, the best on ever finer meshes.

use crate::diagnostics::diagnostics;
use crate::file::{Mesh, Options};
use crate::posed::{Posed, Stands, State};
use crate::result::Fit;
use crate::starts::{Start, starts};
use crate::trouble;
use pilotage_collocation::{Collocation, Loss, Run, Scales, refined};
use pilotage_sqp::{Iteration, Solution, SqpOptions, Status};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::time::Instant;

/// What an observer of a fit sees.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Which start, from 0.
    pub start: usize,
    /// Of how many.
    pub starts: usize,
    /// How often the mesh has been refined.
    pub refinement: usize,
    /// The iterate.
    pub iteration: &'a Iteration,
}

/// Sees each iterate; `Break` ends the fit with the best iterate so far and that status.
pub type Observer<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<Status> + Send + 'a;

/// A start, solved.
pub struct Solved {
    /// The nonlinear program.
    pub problem: Collocation,
    /// Its solution.
    pub solution: Solution,
}

/// How often a mesh is refined at most.
const MOST_REFINEMENTS: usize = 12;

/// Most mesh intervals of all runs together.
pub(crate) const MOST_INTERVALS: usize = 400_000;

/// Fits a problem.
pub fn fit(posed: &Posed<'_>, observer: &mut Observer<'_>) -> Fit {
    let clock = Instant::now();
    let options = &posed.file.options;
    let observer = Mutex::new(observer);
    let starts = starts(posed, options.starts);
    let see = |start: usize, refinement: usize, iteration: &Iteration| {
        let progress = Progress {
            start,
            starts: starts.len(),
            refinement,
            iteration,
        };
        (observer.lock()).map_or(ControlFlow::Continue(()), |mut see| see(&progress))
    };
    let solved = raced(posed, &starts, &|start, iteration| see(start, 0, iteration));
    let ends: Vec<(Status, f64)> = (solved.iter())
        .map(|own| (own.solution.status, own.solution.iterate.f / posed.factor))
        .collect();
    let best = best_of(&solved);
    let mut solved = solved;
    let first = solved.swap_remove(best);
    let (last, refinement) = refine(posed, first, &|round, iteration| {
        see(best, round, iteration)
    });
    let trouble = match last.solution.status {
        Status::UndefinedStart => trouble::at_start(posed, &starts[0]),
        _ => None,
    };
    let mut found = Fit {
        trouble,
        starts: ends,
        refinement,
        seconds: clock.elapsed().as_secs_f64(),
        ..Fit::of(posed, &last)
    };
    found.diagnostics = diagnostics(posed, &last, &found);
    found
}

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
fn refine(posed: &Posed<'_>, mut solved: Solved, see: &See<'_>) -> (Solved, Refinement) {
    let tolerance = match posed.file.options.mesh {
        Mesh::Tolerance(tolerance) => tolerance,
        Mesh::Step(_) | Mesh::Samples => f64::INFINITY,
    };
    let mut told = Refinement {
        iterations: solved.solution.work.iterations,
        ..Refinement::default()
    };
    loop {
        let z = &solved.solution.iterate.z;
        let errors = solved.problem.mesh_errors(z);
        told.error = errors
            .iter()
            .flatten()
            .fold(0.0, |most: f64, error| most.max(*error));
        told.intervals = errors.iter().map(Vec::len).sum();
        let is_over =
            told.rounds == MOST_REFINEMENTS || solved.solution.status != Status::Converged;
        if told.error <= tolerance || is_over {
            return (solved, told);
        }
        let scheme = posed.file.options.scheme;
        let pairs = solved.problem.runs.iter().zip(&errors);
        let meshes = pairs.map(|(run, own)| refined(run, own, scheme, tolerance));
        let meshes: Vec<Vec<f64>> = meshes.collect();
        if meshes.iter().map(Vec::len).sum::<usize>() > MOST_INTERVALS {
            return (solved, told);
        }
        let finer = solved.problem.with_meshes(meshes);
        let z = solved.problem.carried(z, &finer);
        let limit = posed.file.options.max_iterations;
        let next = solve(posed, (finer, z), limit, &|iteration: &Iteration| {
            see(told.rounds + 1, iteration)
        });
        told.iterations += next.solution.work.iterations;
        if next.solution.status != Status::Converged {
            return (solved, told);
        }
        let [before, after] =
            [&solved, &next].map(|own| own.problem.theta(&own.solution.iterate.z));
        told.changes = before
            .iter()
            .zip(after)
            .map(|(a, b)| (a - b).abs())
            .collect();
        told.rounds += 1;
        solved = next;
    }
}

/// Objectives that differ by less than this part are equal.
const EQUAL: f64 = 1e-8;

/// The start with the best objective; of several with the same, that with the smallest error of its mesh, since on a
/// coarse mesh other parameters may do as well.
fn best_of(solved: &[Solved]) -> usize {
    let least = solved.iter().map(rank).fold(f64::MAX, f64::min);
    let is_equal = |k: &usize| rank(&solved[*k]) - least <= EQUAL * least.abs();
    let equal: Vec<usize> = (0..solved.len()).filter(is_equal).collect();
    if let [only] = equal[..] {
        return only;
    }
    let error = |k: &usize| {
        let Solved { problem, solution } = &solved[*k];
        let errors = problem.mesh_errors(&solution.iterate.z);
        errors.into_iter().flatten().fold(0.0, f64::max)
    };
    let errors: Vec<f64> = equal.par_iter().map(error).collect();
    let best = (0..equal.len()).min_by(|a, b| errors[*a].total_cmp(&errors[*b]));
    best.map_or(0, |k| equal[k])
}

/// Converged ones before others, then by their objective.
fn rank(solved: &Solved) -> f64 {
    let objective = solved.solution.iterate.f;
    match solved.solution.status {
        Status::Converged if objective.is_finite() => objective,
        _ => f64::MAX,
    }
}

/// The nonlinear program on the samples as mesh, and its variables, where the search begins there.
pub fn begin(posed: &Posed<'_>, start: &Start) -> (Collocation, Vec<f64>) {
    let (theta, own) = start.parameters.split_at(posed.shared);
    let joint = posed.states.len() - own.len();
    let states: Vec<Vec<Vec<f64>>> = (posed.runs.par_iter().enumerate())
        .map(|(j, run)| {
            let initial: Vec<f64> = (posed.states.iter().zip(&run.initial).enumerate())
                .map(|(k, (state, known))| match k.checked_sub(joint) {
                    Some(k) => own[k],
                    None => known.unwrap_or(state.guesses[j]),
                })
                .collect();
            let size = |(state, x): (&State, &f64)| state.nominal.unwrap_or(1.0).max(x.abs());
            let sizes: Vec<f64> = posed.states.iter().zip(&initial).map(size).collect();
            let followed = posed.followed.as_ref().filter(|_| start.follows);
            let states = match followed {
                Some(followed) => followed.simulate(j, theta, &initial, &sizes),
                None => posed.model.flow(run, theta, &initial, &sizes),
            };
            tamed(states, &initial, &sizes)
        })
        .collect();
    let scales = scales(posed, &states, theta);
    let runs = posed
        .runs
        .iter()
        .map(|run| meshed(run, &posed.file.options));
    let problem = discretised(posed, runs.collect(), scales);
    let z = problem.variables(&states, theta);
    (problem, z)
}

/// Of a state that runs away, the value where it begins.
fn tamed(mut states: Vec<Vec<f64>>, initial: &[f64], sizes: &[f64]) -> Vec<Vec<f64>> {
    const FARTHEST: f64 = 1e6;
    let is_wild = |k: &usize| {
        let near = |x: &Vec<f64>| x[*k].abs() <= FARTHEST * sizes[*k];
        !states.iter().all(near)
    };
    let wild: Vec<usize> = (0..initial.len()).filter(is_wild).collect();
    for x in &mut states {
        wild.iter().for_each(|k| x[*k] = initial[*k]);
    }
    states
}

/// Magnitudes of states and parameters.
fn scales(posed: &Posed<'_>, states: &[Vec<Vec<f64>>], theta: &[f64]) -> Scales {
    let largest = |k: usize| {
        states
            .iter()
            .flatten()
            .fold(0.0_f64, |most, x| most.max(x[k].abs()))
    };
    let state = |k: usize| {
        let seen = Some(largest(k)).filter(|size| *size > 0.0);
        posed.states[k].nominal.or(seen).unwrap_or(1.0)
    };
    let mut parameters: Vec<f64> = theta.iter().map(|value| value.abs()).collect();
    for (unknown, stands) in &posed.unknowns {
        let size = unknown.searched_nominal();
        let range = unknown
            .max
            .zip(unknown.min)
            .map(|(max, min)| 0.5 * (max - min));
        let size = size.or(range).unwrap_or(1.0);
        match stands {
            Stands::Shared(k) => parameters[*k] = size,
            Stands::Subjects(all) => all.iter().for_each(|(_, k)| parameters[*k] = size),
            Stands::State(_) => {}
        }
    }
    Scales {
        states: (0..posed.states.len()).map(state).collect(),
        parameters,
    }
}

/// A run on the mesh that the options ask for.
fn meshed(run: &Run, options: &Options) -> Run {
    let mut run = run.clone();
    if let Mesh::Step(step) = options.mesh {
        run.mesh = spread(&run, step);
    }
    run
}

/// Nodes about this far apart, and wherever inputs jump.
fn spread(run: &Run, step: f64) -> Vec<f64> {
    let jumps = run.time.windows(2).zip(run.inputs.windows(2));
    let jumps = jumps.filter(|(time, inputs)| time[0] == time[1] && inputs[0] != inputs[1]);
    let mut hard: Vec<f64> = vec![run.time[0]];
    hard.extend(jumps.map(|(time, _)| time[0]));
    hard.push(run.time[run.time.len() - 1]);
    hard.dedup();
    let mut mesh = vec![hard[0]];
    for ends in hard.windows(2) {
        let intervals = ((ends[1] - ends[0]) / step).round().max(1.0);
        let intervals = intervals.min(MOST_INTERVALS as f64) as usize;
        let inner =
            (1..intervals).map(|k| ends[0] + (ends[1] - ends[0]) * k as f64 / intervals as f64);
        mesh.extend(inner);
        mesh.push(ends[1]);
    }
    mesh
}

/// The nonlinear program of these runs, its objective multiplied by [`Posed::factor`].
fn discretised(posed: &Posed<'_>, mut runs: Vec<Run>, scales: Scales) -> Collocation {
    for recording in runs.iter_mut().flat_map(|run| &mut run.measured) {
        recording.weight *= posed.factor;
    }
    Collocation::new(
        posed.model.clone(),
        posed.constraints.clone(),
        posed.file.options.scheme,
        runs,
        scales,
        &posed.bounds,
    )
}

/// Iterations of each start before those that are behind are left.
const HEAT: usize = 30;
/// Starts that go on after that, at most.
const FINALISTS: usize = 3;

/// Largest violation of the scaled constraints with which a start is compared with others.
const NEARLY: f64 = 0.1;

type See<'a> = dyn Fn(usize, &Iteration) -> ControlFlow<Status> + Sync + 'a;

/// All starts, solved: those that are behind after some iterations are left, but never the given one.
fn raced(posed: &Posed<'_>, starts: &[Start], see: &See<'_>) -> Vec<Solved> {
    let limit = posed.file.options.max_iterations;
    if let [only] = starts {
        return vec![solve(posed, begin(posed, only), limit, &|iteration| {
            see(0, iteration)
        })];
    }
    let mut solved: Vec<Solved> = (starts.par_iter().enumerate())
        .map(|(k, start)| {
            once(posed, begin(posed, start), limit.min(HEAT), &|own| {
                see(k, own)
            })
        })
        .collect();
    let best = solved.iter().map(rank).fold(f64::MAX, f64::min);
    let is_open = |k: &usize| solved[*k].solution.status != Status::Converged;
    // An objective counts where the states nearly fulfil the equations.
    let objective = |k: &usize| match &solved[*k].solution {
        own if own.kkt.primal <= NEARLY => own.iterate.f,
        _ => f64::INFINITY,
    };
    let mut open: Vec<usize> = (0..solved.len()).filter(is_open).collect();
    open.sort_by(|a, b| objective(a).total_cmp(&objective(b)));
    let is_finalist =
        |(place, k): &(usize, usize)| *k == 0 || (*place < FINALISTS && objective(k) < best);
    let finalists: Vec<usize> = (open.into_iter().enumerate())
        .filter(is_finalist)
        .map(|(_, k)| k)
        .collect();
    let finished: Vec<(usize, Solved)> = (finalists.into_par_iter())
        .map(|k| {
            let Solved { problem, solution } = &solved[k];
            let from = rescaled(posed, problem, &solution.iterate.z);
            (k, solve(posed, from, limit, &|iteration| see(k, iteration)))
        })
        .collect();
    for (k, own) in finished {
        solved[k] = own;
    }
    solved
}

/// [`SqpOptions::short_step`]: with longer ones some starts whose states swing up fail.
const SHORT_STEP: f64 = 0.01;

/// How often a solve that makes no progress is begun again, with scales of the size that it has found.
const RESCALED: usize = 3;

/// The nonlinear program solved from these variables in at most so many iterations, without a refinement of its mesh.
pub fn solve(
    posed: &Posed<'_>,
    mut from: (Collocation, Vec<f64>),
    limit: usize,
    see: &(dyn Fn(&Iteration) -> ControlFlow<Status> + Sync),
) -> Solved {
    let mut round = 0;
    loop {
        let solved = once(posed, from, limit, see);
        if solved.solution.status != Status::NoProgress || round == RESCALED {
            return solved;
        }
        from = rescaled(posed, &solved.problem, &solved.solution.iterate.z);
        round += 1;
    }
}

fn once(
    posed: &Posed<'_>,
    (problem, z): (Collocation, Vec<f64>),
    limit: usize,
    see: &(dyn Fn(&Iteration) -> ControlFlow<Status> + Sync),
) -> Solved {
    let options = SqpOptions {
        tolerance: posed.file.options.tolerance,
        max_iterations: limit,
        short_step: SHORT_STEP,
        ..SqpOptions::default()
    };
    let solution =
        pilotage_collocation::solve(&problem, z, &options, &mut |iteration| see(iteration));
    Solved { problem, solution }
}

/// The same problem with scales of the size that states and parameters have now, and its variables there.
fn rescaled(posed: &Posed<'_>, problem: &Collocation, z: &[f64]) -> (Collocation, Vec<f64>) {
    /// A scale falls to this part at once, at most: what passes through zero keeps a size.
    const LEAST: f64 = 1e-3;
    let n = problem.n_states();
    let scales = &problem.model.scales;
    let mut largest = vec![0.0_f64; n];
    for j in 0..problem.runs.len() {
        for vector in problem.coefficients(z, j).chunks_exact(n) {
            let pairs = largest.iter_mut().zip(vector);
            pairs.for_each(|(most, x)| *most = most.max(x.abs()));
        }
    }
    let sized = |scale: &f64, size: f64| scale * size.max(LEAST);
    let states = scales
        .states
        .iter()
        .zip(&largest)
        .map(|(scale, size)| sized(scale, *size));
    let theta = scales.parameters.iter().zip(problem.theta(z));
    let parameters = theta.map(|(scale, value)| sized(scale, value.abs()));
    let scales = Scales {
        states: states.collect(),
        parameters: parameters.collect(),
    };
    let sized = Collocation::new(
        posed.model.clone(),
        posed.constraints.clone(),
        problem.scheme,
        problem.runs.clone(),
        scales,
        &posed.bounds,
    );
    let z = problem.carried(z, &sized);
    (sized, z)
}

/// What the objective is multiplied with, so that residuals are not all tiny against the solver's tolerance: they are
/// where the noise level is not told and the data are small.
pub fn factor(runs: &[Run]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for recording in runs.iter().flat_map(|run| &run.measured) {
        if recording.loss != Loss::Square {
            return 1.0;
        }
        let known: Vec<f64> = recording
            .values
            .iter()
            .copied()
            .filter(|y| y.is_finite())
            .collect();
        let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
        sum += recording.weight * known.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
        count += known.len() as f64;
    }
    match sum > 0.0 {
        true => (count / sum).max(1.0),
        false => 1.0,
    }
}
