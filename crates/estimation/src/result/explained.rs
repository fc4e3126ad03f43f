//! How much of the recordings a model explains: little, or nothing at all.

use crate::posed::Posed;
use crate::problem::file::Fed;
use crate::result::diagnostic::Diagnostic;
use crate::result::{Fit, RunFit};
use pilotage_inference::outliers::{Values, noise};
use std::fmt::{Display, Formatter};

/// Variance accounted for below which a fit is poor, and below which it says nothing.
const POOR: f64 = 0.5;
const NOTHING: f64 = 0.02;
/// Number of measured values from which on little tells that it is nothing.
const FEWEST: usize = 20;
/// Recordings are white noise about levels if this part of their standard deviation within the runs is white.
const WHITE: f64 = 0.8;

/// A fit that explains nothing of any measured signal.
#[derive(Debug, Clone, PartialEq)]
pub struct Nothing {
    /// The measured columns.
    pub measured: Vec<String>,
    /// The largest variance accounted for, at most 1.
    pub explained: f64,
    /// The inputs of the system, if none of them leaves its start value in any run.
    pub idle: Vec<String>,
}

/// The signals of which little is explained; in their place that nothing is, of any. A filter takes from the recording what the
/// model alone does not explain.
pub(crate) fn little_explained(posed: &Posed<'_>, fit: &Fit) -> Vec<Diagnostic> {
    if posed.filter.is_some() {
        return Vec::new();
    }
    let column = |k: usize| posed.file.measured[k].column.value.clone();
    let signals = 0..posed.file.measured.len();
    let parts: Vec<f64> = signals.clone().map(|k| explained(&fit.runs, k)).collect();
    // NaN where nothing varies: a level has nothing else to explain.
    let most = parts.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let idle = idle(posed);
    let is_idle = idle.len() == posed.joint.model.inputs.len();
    let least = match is_idle && !idle.is_empty() {
        true => POOR,
        false => NOTHING,
    };
    let is_level = is_idle && signals.clone().all(|k| is_white(&fit.runs, k));
    let is_known = most.is_finite() && fit.samples >= FEWEST;
    if is_known && most < least && !is_level {
        return vec![Diagnostic::NothingExplained(Nothing {
            measured: signals.map(column).collect(),
            explained: most,
            idle: if is_idle { idle } else { Vec::new() },
        })];
    }
    let poor = signals.zip(parts).filter(|(_, part)| *part < POOR);
    poor.map(|(k, explained)| Diagnostic::PoorFit {
        measured: column(k),
        explained,
    })
    .collect()
}

/// Part of the variance of a measured signal within the runs that is explained.
fn explained(runs: &[RunFit], k: usize) -> f64 {
    let (mut left, mut total) = (0.0, 0.0);
    for run in runs {
        let known = run.recorded[k].iter().zip(&run.predicted[k]);
        let known: Vec<(f64, f64)> = known
            .map(|(y, h)| (*y, *h))
            .filter(|(y, _)| y.is_finite())
            .collect();
        let mean = known.iter().map(|(y, _)| y).sum::<f64>() / known.len().max(1) as f64;
        left += known.iter().map(|(y, h)| (y - h).powi(2)).sum::<f64>();
        total += known.iter().map(|(y, _)| (y - mean).powi(2)).sum::<f64>();
    }
    1.0 - left / total
}

/// Whether a recorded signal is white noise about a level in each run.
fn is_white(runs: &[RunFit], k: usize) -> bool {
    let (mut squares, mut count) = (0.0, 0);
    let of_run = |run: &RunFit| {
        let known = run.recorded[k].iter().copied().filter(|y| y.is_finite());
        let known: Vec<f64> = known.collect();
        let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
        squares += known.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
        count += known.len();
        Values {
            time: run.time.clone(),
            values: known,
            resolution: 0.0,
            modelled: Vec::new(),
        }
    };
    let all: Vec<Values> = runs.iter().map(of_run).collect();
    noise(&all) > WHITE * (squares / count.max(1) as f64).sqrt()
}

/// The inputs of the system that keep their start values in all runs.
fn idle(posed: &Posed<'_>) -> Vec<String> {
    let moves = |name: &String| {
        let start = posed.joint.variables.get(name).map(|about| about.start);
        let is_away = |value: &f64| value.is_finite() && Some(*value) != start;
        let is_own = |fed: &&Fed| fed.signal.value == *name;
        let fed = posed.file.inputs.iter().find(is_own);
        let by_column = fed.is_some_and(|fed| {
            let runs = posed.data.iter();
            let mut columns = runs.filter_map(|run| run.series.column(&fed.column.value));
            columns.any(|own| own.values.iter().any(is_away))
        });
        let mut sets = posed.data.iter().flat_map(|run| run.line.sets());
        by_column || sets.any(|set| set.name.value == *name)
    };
    let inputs = posed.joint.model.inputs.iter();
    inputs.filter(|name| !moves(name)).cloned().collect()
}

impl Display for Nothing {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "the model explains {:.1} % of the variance of {} within the runs, so its parameters are no answer: ",
            100.0 * self.explained.max(0.0),
            self.measured.join(", ")
        )?;
        match self.idle.first() {
            Some(first) => write!(
                f,
                "nothing drives `{first}`{} there; name the columns that do in [inputs], and fill their gaps",
                match self.idle.len() {
                    1 => String::new(),
                    count => format!(" and {} more", count - 1),
                }
            ),
            None => f.write_str(
                "what drives it may be of other runs, or have another sign, unit or clock, or it takes another model; \
                 --report draws both",
            ),
        }
    }
}
