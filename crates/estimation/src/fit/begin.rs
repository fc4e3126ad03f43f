//! Where the search begins: the nonlinear program of a start, its mesh and its scales.

use super::MOST_INTERVALS;
use crate::file::{Mesh, Options};
use crate::posed::{Posed, Stands, State};
use crate::starts::Start;
use pilotage_collocation::{Collocation, Loss, Run, Scales};
use rayon::prelude::*;

/// The nonlinear program on the samples as mesh, and its variables, where the search begins there.
pub fn begin(posed: &Posed<'_>, start: &Start) -> (Collocation, Vec<f64>) {
    let runs = (0..posed.runs.len()).into_par_iter();
    let states: Vec<Vec<Vec<f64>>> = runs.map(|j| simulated(posed, start, j)).collect();
    let theta = &start.parameters[..posed.shared];
    let scales = scales(posed, &states, theta);
    let runs = posed
        .runs
        .iter()
        .map(|run| meshed(run, &posed.file.options));
    let problem = discretised(posed, runs.collect(), scales);
    let z = problem.variables(&states, theta);
    (problem, z)
}

/// The states at the samples of a run, from where a start begins.
fn simulated(posed: &Posed<'_>, start: &Start, j: usize) -> Vec<Vec<f64>> {
    let run = &posed.runs[j];
    let (theta, own) = start.parameters.split_at(posed.shared);
    let joint = posed.states.len() - own.len();
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
        let values = states.iter().flatten().map(|x| x[k].abs());
        values.fold(0.0, f64::max)
    };
    let state = |k: usize| {
        let seen = Some(largest(k)).filter(|size| *size > 0.0);
        posed.states[k].nominal.or(seen).unwrap_or(1.0)
    };
    let mut parameters: Vec<f64> = theta.iter().map(|value| value.abs()).collect();
    for (unknown, stands) in &posed.unknowns {
        let size = unknown.searched_nominal();
        let range = unknown.max.zip(unknown.min);
        let half = range.map(|(max, min)| 0.5 * (max - min));
        let size = size.or(half).unwrap_or(1.0);
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

/// What the objective is multiplied with, so that residuals are not all tiny against the solver's tolerance: they are
/// where the noise level is not told and the data are small.
pub fn factor(runs: &[Run]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for recording in runs.iter().flat_map(|run| &run.measured) {
        if recording.loss != Loss::Square {
            return 1.0;
        }
        let known = recording.values.iter().copied();
        let known: Vec<f64> = known.filter(|y| y.is_finite()).collect();
        let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
        sum += recording.weight * known.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
        count += known.len() as f64;
    }
    match sum > 0.0 {
        true => (count / sum).max(1.0),
        false => 1.0,
    }
}
