//! A trial in a few numbers, to see at a glance whether it is what it should be.

use super::Trial;
use crate::statistics::{range, rms};
use pilotage_inference::outliers::median;

/// A few numbers about one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Samples, missing ones included.
    pub samples: usize,
    /// Samples whose position is missing.
    pub missing: usize,
    /// Duration \[s\].
    pub duration: f64,
    /// Samples per second [1/s], from the median of the time steps.
    pub rate: f64,
    /// Longest time step over the median one: 1 for an even grid.
    pub largest_gap: f64,
    /// The last target \[m\].
    pub target: f64,
    /// Least and greatest target \[m\]: the same where it stands still.
    pub target_range: [f64; 2],
    /// The last recorded position minus the target then \[m\].
    pub final_error: f64,
    /// Root mean square of the recorded positions minus the targets then \[m\].
    pub rms_error: f64,
    /// How far the vehicle went beyond the target, relative to the distance from its first recorded position;
    /// 0 where it never did. None where that means nothing: the target moves, or the vehicle starts at it, to a
    /// tenth of the range in which it then moves.
    pub overshoot: Option<f64>,
    /// Greatest |stick|; none where the stick was not recorded.
    pub peak_stick: Option<f64>,
    /// Part of the stick's samples that lie at its stops, 0 to 1; likewise.
    pub stick_at_stop: Option<f64>,
}

/// A stick this near to its stop, relative, lies there: recordings are rounded.
const AT_STOP: f64 = 0.999;

/// Part of the samples at the stick's stops that is worth a word.
pub const SATURATED: f64 = 0.05;

/// Least part of the range of the positions that is a way to the target.
const LEAST_WAY: f64 = 0.1;

impl Trial {
    /// The run in a few numbers.
    pub fn summary(&self) -> Summary {
        let steps = steps(&self.time);
        let step = steps[steps.len() / 2];
        let errors: Vec<f64> = (self.position.iter().zip(&self.target))
            .map(|(position, target)| position - target)
            .filter(|error| !error.is_nan())
            .collect();
        let peak = |stick: &Vec<f64>| stick.iter().fold(0.0, |peak: f64, s| peak.max(s.abs()));
        Summary {
            samples: self.time.len(),
            missing: self.time.len() - errors.len(),
            duration: self.duration(),
            rate: 1.0 / step,
            largest_gap: steps[steps.len() - 1] / step,
            target: self.target[self.target.len() - 1],
            target_range: range(&self.target),
            final_error: errors.last().copied().unwrap_or(f64::NAN),
            rms_error: rms(&errors),
            overshoot: self.overshoot(),
            peak_stick: self.stick.as_ref().map(peak),
            stick_at_stop: self.stick.as_deref().and_then(|own| at_stop(own, 1.0)),
        }
    }

    fn overshoot(&self) -> Option<f64> {
        let [target, greatest] = range(&self.target);
        let [low, high] = range(&self.position);
        let first = self.position.iter().find(|position| !position.is_nan())?;
        let way = target - first;
        if target != greatest || way == 0.0 || way.abs() < LEAST_WAY * (high - low) {
            return None;
        }
        // The farthest on the side to which it went.
        let farthest = if way > 0.0 { high } else { low };
        Some(((farthest - target) / way).max(0.0))
    }
}

/// Part of the known samples of a stick that lie at its stops; none where there are none.
pub fn at_stop(stick: &[f64], stop: f64) -> Option<f64> {
    let known = || stick.iter().filter(|u| u.is_finite());
    let there = known().filter(|u| u.abs() >= AT_STOP * stop).count();
    (known().count() > 0).then(|| there as f64 / known().count() as f64)
}

/// The time from each sample to the next [s], the shortest first.
fn steps(time: &[f64]) -> Vec<f64> {
    let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps
}

/// The usual time from a sample to the next \[s\]; none where there are no two.
pub fn median_step(time: &[f64]) -> Option<f64> {
    median(time.windows(2).map(|pair| pair[1] - pair[0]))
}
