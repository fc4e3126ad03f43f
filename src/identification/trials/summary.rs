//! A trial in a few numbers, to see at a glance whether it is what it should be.

use super::Trial;

/// A few numbers about one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Samples, missing ones included.
    pub samples: usize,
    /// Samples whose position is missing.
    pub missing: usize,
    /// Duration [s].
    pub duration: f64,
    /// Samples per second [1/s], from the median of the time steps.
    pub rate: f64,
    /// Longest time step over the median one: 1 for an even grid.
    pub largest_gap: f64,
    /// The last target [m].
    pub target: f64,
    /// The last recorded position minus the last target [m].
    pub final_error: f64,
    /// How far the vehicle went beyond the last target, relative to the distance from its first
    /// recorded position; 0 where it never did.
    pub overshoot: f64,
    /// Greatest |stick|; none where the stick was not recorded.
    pub peak_stick: Option<f64>,
}

impl Trial {
    /// The run in a few numbers.
    pub fn summary(&self) -> Summary {
        let mut steps: Vec<f64> = self.time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        let step = steps[steps.len() / 2];
        let target = self.target[self.target.len() - 1];
        let recorded = || self.position.iter().copied().filter(|p| !p.is_nan());
        let (first, last) = (recorded().next(), recorded().next_back());
        let (first, last) = (first.unwrap_or(f64::NAN), last.unwrap_or(f64::NAN));
        let way = target - first;
        let beyond = recorded().map(|position| (position - target) / way);
        let peak = |stick: &Vec<f64>| stick.iter().fold(0.0, |peak: f64, s| peak.max(s.abs()));
        Summary {
            samples: self.time.len(),
            missing: self.time.len() - recorded().count(),
            duration: self.time[self.time.len() - 1] - self.time[0],
            rate: 1.0 / step,
            largest_gap: steps[steps.len() - 1] / step,
            target,
            final_error: last - target,
            overshoot: match way == 0.0 {
                true => 0.0,
                false => beyond.fold(0.0, f64::max),
            },
            peak_stick: self.stick.as_ref().map(peak),
        }
    }
}
