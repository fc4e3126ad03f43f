//! What a fit gave, for people and for scripts.

use crate::cli::{Failure, format};
use crate::identification::{
    Fit, InitialState, Objective, Options, RunFit, Trial, TrialSet, doubts, pilot_file, simulate,
};
use crate::models::Joint;
use crate::report::{rms, significant};
use crate::vehicle::Mode;
use serde_json::{Value, json};

/// A run as the identified pilot flies it alone, from rest.
pub struct Flown<'a> {
    trial: &'a Trial,
    /// That run.
    pub run: RunFit,
    /// The run in the optimiser's solution; none for a validation run.
    solution: Option<&'a RunFit>,
}

impl<'a> Flown<'a> {
    /// All trials of a set, with the runs of its fit.
    pub fn all(fit: &'a Fit, options: &Options, set: &'a TrialSet) -> Result<Vec<Self>, Failure> {
        let joint = Joint {
            vehicle: options.vehicle,
            pilot: options.pilot,
        };
        let solutions = fit.runs.iter().map(Some).chain(std::iter::repeat(None));
        (set.all().zip(solutions))
            .map(|(trial, solution)| {
                Ok(Self {
                    trial,
                    run: simulate(&joint, &fit.theta, trial)?,
                    solution,
                })
            })
            .collect()
    }

    /// Where it ends, from the last target [m].
    fn final_error(&self) -> f64 {
        let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
        last(&self.run.position) - last(&self.run.target)
    }
}

/// The one object of `--json`.
pub fn to_json(fit: &Fit, options: &Options, flown: &[Flown]) -> Value {
    let modes = Mode::of_poles(&options.pilot.poles(&fit.theta));
    let runs: Vec<Value> = (flown.iter())
        .map(|flown| {
            json!({
                "name": flown.trial.name,
                "use": if flown.solution.is_some() { "fit" } else { "validation" },
                "rms_residual": flown.solution.map(|run| rms(&run.residual)),
                "closed_loop_rms_m": rms(&flown.run.residual),
                "closed_loop_final_error_m": flown.final_error(),
            })
        })
        .collect();
    let starts: Vec<Value> = (fit.starts.iter())
        .map(|start| {
            json!({
                "start": start.number,
                "status": start.status,
                "objective": start.objective,
                "feasible": start.feasible,
                "kkt": start.kkt,
                "curvature": start.curvature,
                "iterations": start.iterations,
                "seconds": start.seconds,
            })
        })
        .collect();
    json!({
        "status": fit.status,
        "converged": fit.converged,
        "objective": fit.objective,
        "theta": fit.theta,
        "unknowns": fit.unknowns,
        "iterations": fit.iterations,
        "starts": starts,
        "skipped": fit.skipped,
        "starts_agreeing": fit.agreeing(),
        "doubts": (doubts(fit, options.pilot).iter()).map(ToString::to_string).collect::<Vec<_>>(),
        "kkt": fit.kkt,
        "curvature": fit.curvature,
        "seconds": fit.seconds,
        "poles": modes.iter().map(|mode| json!([mode.pole.re, mode.pole.im])).collect::<Vec<_>>(),
        "runs": runs,
    })
}

/// The summary for people.
pub fn to_text(fit: &Fit, options: &Options, flown: &[Flown]) -> String {
    let unit = match options.objective {
        Objective::Response => " m",
        Objective::Stick => "",
    };
    let squared = unit.replace('m', "m²");
    let residuals = || fit.runs.iter().flat_map(|run| &run.residual);
    let verdict = match fit.converged {
        true => "converged".to_owned(),
        false => format!("NOT CONVERGED ({})", fit.status),
    };
    let mut text = format!(
        "{verdict}: {} iterations, {} s, scaled KKT residual {:.1e}{}\n{}\
         {} runs, {} samples: rms residual {}{unit}, sum of squares {}{squared}\n\n",
        fit.iterations,
        significant(fit.seconds, 3),
        fit.kkt,
        curvature(fit),
        skipped(fit),
        fit.runs.len(),
        residuals().filter(|residual| residual.is_finite()).count(),
        significant(rms(residuals()), 3),
        significant(fit.objective, 6),
    );
    for (i, (value, unit)) in fit
        .theta
        .iter()
        .zip(pilot_file::units(options.pilot))
        .enumerate()
    {
        let name = format!("θ{}", i + 1);
        text += &format!("  {name:<4} {:>12}  {unit}\n", significant(*value, 6));
    }
    text += "\n  pole [1/s]            frequency [rad/s]  damping\n";
    for mode in Mode::of_poles(&options.pilot.poles(&fit.theta)) {
        text += &format::mode(&mode);
    }
    text + &runs(flown, options) + &doubtful(fit, options) + &carried(flown, options)
}

/// How many starts agree, and what speaks against taking the pilot at its word.
fn doubtful(fit: &Fit, options: &Options) -> String {
    let mut text = match fit.starts.len() {
        0 | 1 => String::new(),
        all => format!(
            "\n{} of {all} starts ended within 0.1 % of this sum of squares\n",
            fit.agreeing()
        ),
    };
    for doubt in doubts(fit, options.pilot) {
        text += &format!("note: {doubt}\n");
    }
    text
}

/// The second-order condition, where the first-order one is fulfilled.
fn curvature(fit: &Fit) -> String {
    match fit.curvature {
        Some(curvature) => format!(", smallest curvature {curvature:.1e}"),
        None if fit.converged => ", curvature not checked".into(),
        None => String::new(),
    }
}

/// Says so when the fit ended before all starts were tried.
fn skipped(fit: &Fit) -> String {
    match fit.skipped {
        0 => String::new(),
        skipped => format!(
            "stopped early: {skipped} of {} starts were not tried\n",
            fit.starts.len() + skipped
        ),
    }
}

/// Says so when free initial states, and not the pilot, bring the vehicle where it was recorded.
fn carried(flown: &[Flown], options: &Options) -> String {
    let fitted = || flown.iter().filter_map(|f| Some((f.solution?, &f.run)));
    let solved = rms(fitted().flat_map(|(solution, _)| &solution.residual));
    let alone = rms(fitted().flat_map(|(_, run)| &run.residual));
    let comparable = options.objective == Objective::Response;
    match comparable && options.initial_state != InitialState::AtRest && alone > 3.0 * solved {
        true => format!(
            "\nnote: the optimiser's runs are within {} m rms, but the pilot alone, from rest, is {} m off:\n      \
             its free initial states carry the runs. If nobody moved before the target appeared, fit with\n      \
             --initial-state at-rest\n",
            significant(solved, 2),
            significant(alone, 2)
        ),
        false => String::new(),
    }
}

/// One line for each run: the optimiser's residual, and the closed loop flown alone from rest.
fn runs(flown: &[Flown], options: &Options) -> String {
    let width = flown
        .iter()
        .map(|flown| flown.trial.name.chars().count())
        .max();
    let width = width.unwrap_or(0).max(10);
    let unit = options.objective.unit();
    let mut text = format!(
        "\n  {:<width$}  rms residual [{unit}]  flown alone from rest: rms [m]  final error [m]\n",
        "run"
    );
    for flown in flown {
        let residual = match flown.solution {
            Some(run) => significant(rms(&run.residual), 3),
            None => "validation".into(),
        };
        text += &format!(
            "  {:<width$}  {residual:>16}  {:>30}  {:>15}\n",
            flown.trial.name,
            significant(rms(&flown.run.residual), 3),
            significant(flown.final_error(), 3),
        );
    }
    text
}
