//! What a fit gave, for people and for scripts.

use crate::cli::{Failure, format};
use crate::identification::joint::Joint;
use crate::identification::simulate::{LONGEST, at_rest};
use crate::identification::statistics::rms;
use crate::identification::{
    ClosedLoop, Doubt, Fit, InitialState, Objective, Options, RunFit, Trial, TrialSet, pilot_file,
    simulate, simulate_from,
};
use crate::report::significant;
use crate::vehicle::Mode;
use serde_json::{Value, json};

/// A run as the identified pilot flies it alone, from rest.
pub struct Flown<'a> {
    trial: &'a Trial,
    /// That run, from where the solution begins; none where nobody said which vehicle was flown, or it is longer
    /// than [`LONGEST`].
    pub run: Option<RunFit>,
    /// The run in the optimiser's solution; none for a validation run.
    solution: Option<&'a RunFit>,
}

impl<'a> Flown<'a> {
    /// All trials of a set, with the runs of its fit.
    pub fn all(fit: &'a Fit, options: &Options, set: &'a TrialSet) -> Result<Vec<Self>, Failure> {
        let joint = options.loop_vehicle().map(|&vehicle| Joint {
            vehicle,
            pilot: options.pilot,
        });
        let begin = |joint: &Joint, trial: &Trial, solution: Option<&RunFit>| match solution {
            // The first sample is a measurement like the others.
            Some(run) if options.objective == Objective::Response => {
                let states = at_rest(joint, run.position[0]);
                simulate_from(joint, &fit.theta, trial, &states)
            }
            _ => simulate(joint, &fit.theta, trial),
        };
        let solutions = fit.runs.iter().map(Some).chain(std::iter::repeat(None));
        (set.all().zip(solutions))
            .map(|(trial, solution)| {
                Ok(Self {
                    trial,
                    run: (joint.as_ref())
                        .filter(|_| trial.duration() <= LONGEST)
                        .map(|joint| begin(joint, trial, solution))
                        .transpose()?,
                    solution,
                })
            })
            .collect()
    }

    /// Its rms distance from the recording, and where it ends, from the last target [m].
    fn errors(&self) -> Option<(f64, f64)> {
        let run = self.run.as_ref()?;
        let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
        Some((rms(&run.residual), last(&run.position) - last(&run.target)))
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
                "rms_residual": flown.solution.filter(|_| fit.is_feasible()).map(|run| rms(&run.residual)),
                "closed_loop_rms_m": flown.errors().map(|(rms, _)| rms),
                "closed_loop_final_error_m": flown.errors().map(|(_, last)| last),
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
        "parameters": parameters(fit, options),
        "closed_loop": fit.closed_loop.as_ref().map(closed_loop),
        "unknowns": fit.unknowns,
        "iterations": fit.iterations,
        "starts": starts,
        "skipped": fit.skipped,
        "starts_tried": fit.tried,
        "starts_agreeing": fit.agreeing(),
        "doubts": doubts(fit),
        "kkt": fit.kkt,
        "violation": fit.violation,
        "curvature": fit.curvature,
        "seconds": fit.seconds,
        "poles": modes.iter().map(|mode| json!([mode.pole.re, mode.pole.im])).collect::<Vec<_>>(),
        "runs": runs,
    })
}

/// Value and unit of each parameter, by name.
fn parameters(fit: &Fit, options: &Options) -> Value {
    let all = fit.theta.iter().zip(pilot_file::units(options.pilot));
    let all = all.enumerate().map(|(i, (value, unit))| {
        let entry = json!({ "value": value, "unit": unit });
        (format!("theta{}", i + 1), entry)
    });
    Value::Object(all.collect())
}

/// Every pole as real and imaginary part [1/s].
fn closed_loop(closed_loop: &ClosedLoop) -> Value {
    let poles = closed_loop.poles.iter();
    json!({
        "stable": closed_loop.is_stable(),
        "poles": poles.map(|pole| json!([pole.re, pole.im])).collect::<Vec<_>>(),
    })
}

fn doubts(fit: &Fit) -> Vec<Value> {
    let one = |doubt: &Doubt| json!({ "code": doubt.code(), "words": doubt.to_string(), "fatal": doubt.is_fatal() });
    fit.doubts.iter().map(one).collect()
}

/// How the fit ended, in a word or two: never a plain one where something speaks against it.
pub fn verdict(fit: &Fit) -> String {
    let unstable = |doubt: &Doubt| matches!(doubt, Doubt::UnstableLoop { .. });
    match fit.doubts.first() {
        _ if !fit.converged => format!("NOT CONVERGED ({})", fit.status),
        Some(doubt) if unstable(doubt) => "converged, but the closed loop is UNSTABLE".into(),
        Some(doubt) if doubt.is_fatal() => {
            format!("NO ANSWER ({}), though converged", doubt.code())
        }
        Some(_) => format!("converged, in doubt ({})", fit.doubts.len()),
        None => "converged".into(),
    }
}

/// The summary for people.
pub fn to_text(fit: &Fit, options: &Options, flown: &[Flown]) -> String {
    let unit = match options.objective {
        Objective::Response => " m",
        Objective::Stick => "",
    };
    let squared = unit.replace('m', "m²");
    let residuals = || fit.runs.iter().flat_map(|run| &run.residual);
    let (verdict, feasible) = (verdict(fit), fit.is_feasible());
    let count = residuals().filter(|residual| residual.is_finite()).count();
    let mut text = format!(
        "{verdict}: {} iterations, {} s, scaled KKT residual {:.1e}{}\n{}{} runs, {count} samples: {}\n",
        fit.iterations,
        significant(fit.seconds, 3),
        fit.kkt,
        curvature(fit),
        skipped(fit),
        fit.runs.len(),
        match feasible {
            true => format!(
                "rms residual {}{unit}, sum of squares {}{squared}",
                significant(rms(residuals()), 3),
                significant(fit.objective, 6),
            ),
            false => format!(
                "the last iterate violates the equations by {:.1e} (scaled), so it has no residual",
                fit.violation
            ),
        }
    );
    for doubt in &fit.doubts {
        text += &format!("doubt ({}): {doubt}\n", doubt.code());
    }
    text += "\n";
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
    text + &loop_poles(fit)
        + &runs(fit, flown, options)
        + &agreement(fit)
        + &carried(flown, options)
}

/// The modes of the closed loop.
fn loop_poles(fit: &Fit) -> String {
    let Some(closed_loop) = &fit.closed_loop else {
        return "\n  closed loop: not known, since no --vehicle was given\n".into();
    };
    let stable = match (fit.is_feasible(), closed_loop.is_stable()) {
        (false, _) => "of this iterate",
        (true, true) => "stable",
        (true, false) => "UNSTABLE",
    };
    let modes = Mode::of_poles(&closed_loop.poles);
    let modes: String = modes.iter().map(format::mode).collect();
    let title = format!("closed loop, {stable}");
    format!("\n  {title:<20}  frequency [rad/s]  damping\n{modes}")
}

/// How many starts agree.
fn agreement(fit: &Fit) -> String {
    match fit.tried {
        0 | 1 => String::new(),
        _ if !fit.converged => String::new(),
        all => format!(
            "\n{} of {all} starts ended within 0.1 % of this sum of squares\n",
            fit.agreeing()
        ),
    }
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
    let fitted = || (flown.iter()).filter_map(|f| Some((f.solution?, f.run.as_ref()?)));
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
fn runs(fit: &Fit, flown: &[Flown], options: &Options) -> String {
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
            Some(run) if fit.is_feasible() => significant(rms(&run.residual), 3),
            Some(_) => "-".into(),
            None => "validation".into(),
        };
        let (alone, last) = flown
            .errors()
            .map_or(("-".into(), "-".into()), |(rms, last)| {
                (significant(rms, 3), significant(last, 3))
            });
        text += &format!(
            "  {:<width$}  {residual:>16}  {alone:>30}  {last:>15}\n",
            flown.trial.name,
        );
    }
    text
}
