//! Diagnostics from simulations of the fitted pilot without the optimiser.

use super::{Diagnostic, Fit, FitOptions, Trial};
use crate::joint::Joint;
use crate::simulate::{LONGEST, departure, simulate_from};
use crate::{Objective, RunFit};
use pilotage_inference::statistics::{range, rms};
use rayon::prelude::*;

/// The mesh is too coarse if the error of its solution exceeds this part of the rms residual ...
const COARSE: f64 = 0.2;
/// ... and this part of the vehicle's motion.
const VISIBLE: f64 = 1e-3;
/// A solution this part of the vehicle's motion away from the equations is another motion.
const ANOTHER: f64 = 0.3;

/// The diagnostics of the simulations.
pub fn diagnostics(fit: &Fit, options: &FitOptions, trials: &[Trial]) -> Vec<Diagnostic> {
    let Some(&vehicle) = options.loop_vehicle().filter(|_| fit.is_feasible()) else {
        return Vec::new();
    };
    let joint = Joint {
        vehicle,
        pilot: options.pilot,
    };
    let response = options.objective == Objective::Response;
    let mesh = response.then(|| mesh_error(fit, options, &joint, trials));
    [mesh.flatten(), leaves(fit, options, &joint, trials)]
        .into_iter()
        .flatten()
        .collect()
}

/// Distance of the solution from the equations integrated from the solution's initial states.
fn mesh_error(
    fit: &Fit,
    options: &FitOptions,
    joint: &Joint,
    trials: &[Trial],
) -> Option<Diagnostic> {
    let off = |(run, trial): (&RunFit, &Trial)| {
        if trial.duration() > LONGEST {
            return None;
        }
        let flown = simulate_from(joint, &fit.theta, trial, &run.states[0]).ok()?;
        let pairs = flown.position.iter().zip(&run.position);
        Some(pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>())
    };
    let runs = fit.runs.par_iter().zip(trials);
    let off: Vec<f64> = runs.map(off).collect::<Option<_>>()?;
    let samples = fit.runs.iter().map(|run| run.time.len()).sum::<usize>() as f64;
    let residual = rms(fit.residuals());
    let error = (off.iter().sum::<f64>() / samples).sqrt();
    let moved = fit.runs.iter().map(|run| {
        let [least, most] = range(&run.position);
        most - least
    });
    let moved = moved.fold(0.0, f64::max);
    let worst = (0..off.len()).max_by(|a, b| off[*a].total_cmp(&off[*b]))?;
    let boundaries = options.mesh.boundaries(&fit.runs[worst].time);
    let intervals = boundaries.windows(2).map(|pair| pair[1] - pair[0]);
    (error > COARSE * residual && error > VISIBLE * moved).then(|| Diagnostic::MeshError {
        run: fit.runs[worst].name.clone(),
        error,
        residual,
        interval: intervals.fold(0.0, f64::max),
        is_another: error > ANOTHER * moved,
    })
}

/// Simulates a step from rest to the farthest target of all runs.
fn leaves(fit: &Fit, options: &FitOptions, joint: &Joint, trials: &[Trial]) -> Option<Diagnostic> {
    fit.closed_loop.as_ref().filter(|known| known.is_stable())?;
    let steps = trials.iter().zip(&fit.runs).flat_map(|(trial, run)| {
        let origin = run.position[0];
        trial.target.iter().map(move |target| target - origin)
    });
    let step = steps.max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    let left = departure(joint, &fit.theta, options.stick_limit, step).ok()??;
    Some(Diagnostic::Leaves {
        step,
        time: left.time,
        error: left.error,
        allowed: !options.stable_loop,
    })
}
