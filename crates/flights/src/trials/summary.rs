//! Summary of a trial, for a quick check of its data.

use super::Trial;
use pilotage_inference::sampling;
use pilotage_inference::statistics::{range, rms};

/// Summary of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Number of samples, including missing ones.
    pub samples: usize,
    /// Number of samples whose position is missing.
    pub missing: usize,
    /// Duration \[s\].
    pub duration: f64,
    /// Samples per second [1/s], from the median of the time steps.
    pub rate: f64,
    /// Longest time step over the median one: 1 for a uniform grid.
    pub largest_gap: f64,
    /// The last target \[m\].
    pub target: f64,
    /// Minimum and maximum target \[m\]: equal if it is constant.
    pub target_range: [f64; 2],
    /// Last recorded position minus the target at that time \[m\].
    pub final_error: f64,
    /// Root mean square of the recorded positions minus the targets at the same times \[m\].
    pub rms_error: f64,
    /// Overshoot beyond the target, relative to the distance from the first recorded position; 0 if there is none.
    /// `None` if it is not meaningful: the target moves, or the vehicle starts within a tenth of its later range of
    /// motion from it.
    pub overshoot: Option<f64>,
    /// Largest |stick|; `None` if the stick was not recorded.
    pub peak_stick: Option<f64>,
    /// Share of the stick's samples at its stops, 0 to 1; likewise.
    pub stick_at_stop: Option<f64>,
}

/// Relative position of a stick from which on it is at its stop: recordings are rounded.
const AT_STOP: f64 = 0.999;

/// Share of samples at the stick's stops from which on it is reported.
pub const SATURATED: f64 = 0.05;

/// Minimum distance to the target relative to the range of the positions.
const LEAST_WAY: f64 = 0.1;

impl Trial {
    /// Computes the summary.
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
        // The farthest position in the direction of the target.
        let farthest = if way > 0.0 { high } else { low };
        Some(((farthest - target) / way).max(0.0))
    }
}

/// Share of the known samples of a stick at its stops; `None` if there are none.
pub fn at_stop(stick: &[f64], stop: f64) -> Option<f64> {
    let known = || stick.iter().filter(|u| u.is_finite());
    let there = known().filter(|u| u.abs() >= AT_STOP * stop).count();
    (known().count() > 0).then(|| there as f64 / known().count() as f64)
}

/// Sampling intervals [s], the shortest first.
fn steps(time: &[f64]) -> Vec<f64> {
    let mut steps: Vec<f64> = sampling::steps(time).collect();
    steps.sort_by(f64::total_cmp);
    steps
}
