//! The figures of a report.

use super::plot::{Axes, Line, Plot, colour};
use crate::identification::{Fit, Objective, RunFit, Trial};
use crate::series::Series;

/// A co-simulation of pilot and vehicle, from rest to one target.
#[derive(Debug, Clone)]
pub struct ClosedLoop<'a> {
    /// The target \[m\].
    pub target: f64,
    /// What the master recorded.
    pub series: &'a Series,
    /// Name of the column with the vehicle's position \[m\].
    pub position: &'a str,
    /// Name of the column with the stick.
    pub stick: &'a str,
}

/// The targets of a report, each with its colour.
pub struct Targets(Vec<f64>);

impl Targets {
    /// The different last targets of the trials, in order of appearance.
    pub fn of(trials: &[Trial]) -> Self {
        let mut targets: Vec<f64> = Vec::new();
        for trial in trials {
            let target = last(&trial.target);
            if !targets.contains(&target) {
                targets.push(target);
            }
        }
        Self(targets)
    }

    fn class(&self, target: f64) -> String {
        let index = self
            .0
            .iter()
            .position(|&other| other == target)
            .unwrap_or(self.0.len());
        colour(index)
    }
}

/// The last of some values.
fn last(values: &[f64]) -> f64 {
    values.last().copied().unwrap_or(f64::NAN)
}

/// A line; `run` names it under the pointer, with its label.
fn line(run: &str, label: &str, class: impl Into<String>, x: &[f64], y: &[f64]) -> Line {
    Line {
        label: label.into(),
        name: format!("{run}, {label}"),
        class: class.into(),
        x: x.to_vec(),
        y: y.to_vec(),
    }
}

/// The recorded positions and the goals.
fn recorded(trials: &[Trial]) -> Vec<Line> {
    let data =
        (trials.iter()).map(|run| line(&run.name, "recorded", "data", &run.time, &run.position));
    let goal = (trials.iter()).map(|run| line(&run.name, "goal", "goal", &run.time, &run.target));
    data.chain(goal).collect()
}

fn recorded_stick(trials: &[Trial]) -> Vec<Line> {
    (trials.iter())
        .filter_map(|run| {
            let stick = run.stick.as_ref()?;
            Some(line(&run.name, "recorded", "data", &run.time, stick))
        })
        .collect()
}

/// One model line for each run, styled by its target.
fn modelled(runs: &[RunFit], targets: &Targets, y: impl Fn(&RunFit) -> &[f64]) -> Vec<Line> {
    (runs.iter())
        .map(|run| {
            let target = last(&run.target);
            let label = format!("model, {target} m");
            line(&run.name, &label, targets.class(target), &run.time, y(run))
        })
        .collect()
}

fn plot(description: &str, y_label: &str, height: f64, lines: Vec<Line>) -> String {
    let plot = Plot {
        description: description.into(),
        x_label: "time [s]".into(),
        y_label: y_label.into(),
        axes: Axes::Linear,
        height,
        lines,
        marks: Vec::new(),
    };
    plot.to_svg()
}

/// The paper's figure: recorded runs, goals, and the model's response.
pub fn response(runs: &[RunFit], trials: &[Trial], targets: &Targets) -> String {
    let mut lines = recorded(trials);
    lines.extend(modelled(runs, targets, |run| &run.position));
    plot(
        "recorded positions, goals and the model's response over time",
        "position [m]",
        360.0,
        lines,
    )
}

/// The stick, recorded and modelled.
pub fn stick(fit: &Fit, trials: &[Trial], targets: &Targets) -> String {
    let mut lines = recorded_stick(trials);
    lines.extend(modelled(&fit.runs, targets, |run| &run.stick));
    plot(
        "recorded and modelled stick over time",
        "stick [1]",
        300.0,
        lines,
    )
}

/// Recorded minus modelled.
pub fn residuals(fit: &Fit, targets: &Targets, objective: Objective) -> String {
    let label = format!("residual [{}]", objective.unit());
    let mut lines = modelled(&fit.runs, targets, |run| &run.residual);
    for line in &mut lines {
        line.label = line.label.replace("model, ", "goal ");
        line.name = line.name.replace("model, ", "goal ");
    }
    plot("recorded minus modelled over time", &label, 280.0, lines)
}

/// One line for each co-simulation, from the column that `column` names.
fn co_simulated(
    loops: &[ClosedLoop],
    targets: &Targets,
    column: impl Fn(&ClosedLoop) -> String,
) -> Vec<Line> {
    (loops.iter())
        .filter_map(|closed| {
            let values = &closed.series.column(&column(closed))?.values;
            let label = format!("FMUs, {} m", closed.target);
            let class = targets.class(closed.target);
            Some(line(
                "closed loop",
                &label,
                class,
                &closed.series.time,
                values,
            ))
        })
        .collect()
}

/// The exported FMUs in closed loop, from rest: positions.
pub fn loop_response(loops: &[ClosedLoop], trials: &[Trial], targets: &Targets) -> String {
    let mut lines = recorded(trials);
    lines.extend(co_simulated(loops, targets, |closed| {
        closed.position.into()
    }));
    plot(
        "recorded positions, goals and the co-simulated response over time",
        "position [m]",
        360.0,
        lines,
    )
}

/// The exported FMUs in closed loop, from rest: stick.
pub fn loop_stick(loops: &[ClosedLoop], trials: &[Trial], targets: &Targets) -> String {
    let mut lines = recorded_stick(trials);
    lines.extend(co_simulated(loops, targets, |closed| closed.stick.into()));
    plot(
        "recorded and co-simulated stick over time",
        "stick [1]",
        300.0,
        lines,
    )
}
