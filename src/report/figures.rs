//! The figures of a fit's report.

use super::certainty::{correlation_figure, waterfall_figure};
use super::describing;
use super::figure::{Axis, Figure, Look, Panel, Series};
use super::frequency::{Fitted, bode_figures};
use super::page::Report;
use super::palette::colour;
use super::poles::pole_figure;
use super::residuals::{Residuals, residual_figure};
use crate::identification::{Fit, Identification, Objective, RunFit, Trial};
use crate::series;
use crate::sqp::Status;

/// A co-simulation of pilot and vehicle, from rest to one target.
#[derive(Debug, Clone)]
pub struct ClosedLoop<'a> {
    /// The target \[m\].
    pub target: f64,
    /// The recorded series.
    pub series: &'a series::Series,
    /// Name of the column with the vehicle's position \[m\].
    pub position: &'a str,
    /// Name of the column with the stick.
    pub stick: &'a str,
}

/// The targets of a report, each of which has a colour.
struct Targets(Vec<Option<f64>>);

impl Targets {
    /// The distinct targets of the trials, in order of appearance; all moving targets count as one.
    fn of(trials: &[Trial]) -> Self {
        let mut targets: Vec<Option<f64>> = Vec::new();
        for trial in trials {
            let target = standing(&trial.target);
            if !targets.contains(&target) {
                targets.push(target);
            }
        }
        Self(targets)
    }

    /// The colour of a target.
    fn class(&self, target: Option<f64>) -> String {
        let index = self
            .0
            .iter()
            .position(|&other| other == target)
            .unwrap_or(self.0.len());
        colour(index)
    }
}

/// The constant target; `None` if it moves.
fn standing(target: &[f64]) -> Option<f64> {
    let first = target.first().copied()?;
    target.iter().all(|own| *own == first).then_some(first)
}

/// The recorded positions and the targets.
fn recorded(trials: &[Trial]) -> Vec<Series> {
    let data = (trials.iter())
        .map(|run| Series::line("recorded", "data", &run.time, &run.position).of(&run.name));
    let goal = (trials.iter()).map(|run| {
        let line = Series::line("goal", "goal", &run.time, &run.target);
        line.of(&run.name).looks(Look::Dashed)
    });
    goal.chain(data).collect()
}

fn recorded_stick(trials: &[Trial]) -> Vec<Series> {
    let stick = |run: &Trial| {
        let line = Series::line("recorded", "data", &run.time, run.stick.as_ref()?);
        Some(line.of(&run.name))
    };
    trials.iter().filter_map(stick).collect()
}

/// A model line for each run, coloured by its target.
fn modelled(runs: &[RunFit], targets: &Targets, y: impl Fn(&RunFit) -> &[f64]) -> Vec<Series> {
    (runs.iter())
        .map(|run| {
            let target = standing(&run.target);
            let label =
                target.map_or_else(|| "model".to_owned(), |target| format!("model, {target} m"));
            Series::line(&label, targets.class(target), &run.time, y(run)).of(&run.name)
        })
        .collect()
}

fn panel(y: &str, height: f64, series: Vec<Series>) -> Panel {
    Panel {
        x: Axis::time(),
        y: Axis::linear(y),
        height,
        series,
        ..Panel::default()
    }
}

/// The paper's figure: recorded runs, targets, and the model's response.
fn response(runs: &[RunFit], trials: &[Trial], targets: &Targets, caption: &str) -> Figure {
    let mut positions = recorded(trials);
    positions.extend(modelled(runs, targets, |run| &run.position));
    let panel = panel("position [m]", 360.0, positions);
    Figure::of("response", "Response", caption, panel)
}

/// The stick, recorded and modelled.
fn stick(fit: &Fit, trials: &[Trial], targets: &Targets, caption: &str) -> Figure {
    let mut series = recorded_stick(trials);
    series.extend(modelled(&fit.runs, targets, |run| &run.stick));
    Figure::of("stick", "Stick", caption, panel("stick", 280.0, series))
}

/// A line for each co-simulation, from the column given by `column`.
fn co_simulated(
    loops: &[ClosedLoop],
    targets: &Targets,
    column: impl Fn(&ClosedLoop) -> String,
) -> Vec<Series> {
    (loops.iter())
        .filter_map(|closed| {
            let values = &closed.series.column(&column(closed))?.values;
            let label = format!("FMUs, {} m", closed.target);
            let class = targets.class(Some(closed.target));
            Some(Series::line(&label, class, &closed.series.time, values))
        })
        .collect()
}

/// The exported FMUs in closed loop, from rest: positions and stick.
fn closed_loops(loops: &[ClosedLoop], trials: &[Trial], targets: &Targets) -> Figure {
    let mut positions = recorded(trials);
    positions.extend(co_simulated(loops, targets, |own| own.position.into()));
    let mut sticks = recorded_stick(trials);
    sticks.extend(co_simulated(loops, targets, |own| own.stick.into()));
    let mut figure = Figure::of(
        "closed-loop",
        "The exported FMUs in closed loop",
        "The pilot's FMU flies the quadcopter's FMU from rest, in the co-simulation master: nothing is left of the \
         optimiser here.",
        panel("position [m]", 320.0, positions),
    );
    figure.panels.push(panel("stick", 220.0, sticks));
    figure
}

/// The figures of a report, in page order.
pub fn all(report: &Report) -> Vec<Figure> {
    let Identification { fit, options, .. } = report.found;
    let trials = &report.found.trials.fit;
    let targets = Targets::of(trials);
    let mut all = Vec::new();
    all.extend(as_fitted(report, &targets));
    all.push(stick(fit, trials, &targets, match options.objective {
        Objective::Response => {
            "The stick is not what is fitted: the pilot is asked to bring the vehicle where the human brought it, not \
             to copy the hand."
        }
        Objective::Stick => "The stick is what was fitted, driven by the recorded error.",
    }));
    if !report.loops.is_empty() {
        all.push(closed_loops(report.loops, trials, &targets));
    }
    let fitted = Fitted {
        pilot: options.pilot,
        theta: &fit.theta,
        vehicle: options.loop_vehicle(),
        sure: fit
            .uncertainty
            .as_ref()
            .and_then(crate::identification::Uncertainty::determined),
    };
    let mut bode = bode_figures(&fitted);
    describing::add_to(&mut bode, &report.found.describing);
    all.extend(bode);
    all.push(pole_figure(&fitted));
    all.push(residuals(fit, &targets, options.objective));
    if let Some(sure) = &fit.uncertainty {
        let names: Vec<String> = (1..=fit.theta.len()).map(|k| format!("θ{k}")).collect();
        all.push(correlation_figure(&names, &sure.correlations));
    }
    all.extend(report.profiles.clone());
    let unit = if options.objective == Objective::Response {
        "m2"
    } else {
        ""
    };
    let starts = fit
        .starts
        .iter()
        .map(|start| (start.status == Status::Converged, start.objective));
    all.push(waterfall_figure(unit, &starts.collect::<Vec<_>>()));
    all
}

/// Residuals: recorded minus modelled.
fn residuals(fit: &Fit, targets: &Targets, objective: Objective) -> Figure {
    let of = |run: &'_ RunFit| {
        let target = standing(&run.target);
        let goal = target.map_or_else(
            || "goal that moves".to_owned(),
            |target| format!("goal {target} m"),
        );
        (goal, targets.class(target))
    };
    let all: Vec<Residuals> = (fit.runs.iter())
        .map(|run| {
            let (label, colour) = of(run);
            Residuals {
                run: &run.name,
                label,
                colour,
                time: &run.time,
                values: run.residual.clone(),
            }
        })
        .collect();
    let caption = "Recorded minus modelled: over time, by lag and by frequency. What is left is what differs from run to \
                   run, and what no linear pilot of this order does.";
    residual_figure("residuals", "Residuals", caption, objective.unit(), &all)
}

/// The paper's figure. A pilot fitted to the stick moves no vehicle in the optimiser, so its flight alone is shown.
fn as_fitted(report: &Report, targets: &Targets) -> Option<Figure> {
    let Identification { fit, options, .. } = report.found;
    let trials = &report.found.trials.fit;
    options.loop_vehicle()?;
    let alone = || -> Option<Vec<RunFit>> {
        let fitted = report.found.outcomes().take(trials.len());
        fitted.map(|run| run.alone.cloned()).collect()
    };
    let (runs, caption) = match options.objective {
        Objective::Response => (
            fit.runs.clone(),
            "Every run as it was recorded, its goal, and the same run in the optimiser's solution: one pilot θ for all of \
             them.",
        ),
        Objective::Stick => (
            alone().unwrap_or_default(),
            "Every run as it was recorded, its goal, and where the pilot brings the vehicle when it flies alone, from \
             rest: it was fitted to the stick and may miss the goal.",
        ),
    };
    Some(response(&runs, trials, targets, caption))
}
