//! The fit of a problem: starts, the SQP from each, the best on ever finer meshes.

use crate::file::{Mesh, Options};
use crate::posed::{Posed, Stands};
use crate::result::Fit;
use crate::starts::{Start, starts};
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
const MOST_INTERVALS: usize = 400_000;

/// Fits a problem.
pub fn fit(posed: &Posed<'_>, observer: &mut Observer<'_>) -> Fit {
    let clock = Instant::now();
    let options = &posed.file.options;
    let observer = Mutex::new(observer);
    let starts = starts(posed, options.starts);
    let solved: Vec<Solved> = (starts.par_iter().enumerate())
        .map(|(k, start)| {
            let (problem, z) = begin(posed, start);
            let see = |iteration: &Iteration| {
                let progress = Progress {
                    start: k,
                    starts: starts.len(),
                    refinement: 0,
                    iteration,
                };
                observer
                    .lock()
                    .map_or(ControlFlow::Continue(()), |mut see| see(&progress))
            };
            solve(posed, problem, z, see)
        })
        .collect();
    let ends: Vec<(Status, f64)> = (solved.iter())
        .map(|own| (own.solution.status, own.solution.iterate.f / posed.factor))
        .collect();
    let best = (0..solved.len())
        .min_by(|a, b| rank(&solved[*a]).total_cmp(&rank(&solved[*b])))
        .unwrap_or_default();
    let mut solved = solved;
    let first = solved.swap_remove(best);
    let (last, refinement) = refine(posed, first, |progress| {
        observer
            .lock()
            .map_or(ControlFlow::Continue(()), |mut see| see(progress))
    });
    Fit {
        starts: ends,
        refinement,
        seconds: clock.elapsed().as_secs_f64(),
        ..Fit::of(posed, &last)
    }
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
fn refine(
    posed: &Posed<'_>,
    mut solved: Solved,
    see: impl Fn(&Progress<'_>) -> ControlFlow<Status>,
) -> (Solved, Refinement) {
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
        let next = solve(posed, finer, z, |iteration| {
            see(&Progress {
                start: 0,
                starts: 1,
                refinement: told.rounds + 1,
                iteration,
            })
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
            let followed = posed.followed.as_ref().filter(|_| start.follows);
            let states = match followed {
                Some(followed) => followed.simulate(j, theta, &initial),
                None => posed.model.simulate(run, theta, &initial),
            };
            tamed(posed, states, &initial)
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
fn tamed(posed: &Posed<'_>, mut states: Vec<Vec<f64>>, initial: &[f64]) -> Vec<Vec<f64>> {
    const FARTHEST: f64 = 1e6;
    let wild = |k: usize| {
        let size = posed.states[k].nominal.unwrap_or(1.0).max(initial[k].abs());
        let far = |x: &Vec<f64>| x[k].is_nan() || x[k].abs() > FARTHEST * size;
        states.iter().any(far)
    };
    let wild: Vec<usize> = (0..initial.len()).filter(|k| wild(*k)).collect();
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

fn solve(
    posed: &Posed<'_>,
    problem: Collocation,
    z: Vec<f64>,
    mut see: impl FnMut(&Iteration) -> ControlFlow<Status>,
) -> Solved {
    let options = SqpOptions {
        tolerance: posed.file.options.tolerance,
        max_iterations: posed.file.options.max_iterations,
        short_step: 0.01,
        ..SqpOptions::default()
    };
    let solution = pilotage_collocation::solve(&problem, z, &options, &mut see);
    Solved { problem, solution }
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
