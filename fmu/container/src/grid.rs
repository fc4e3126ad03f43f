//! Communication points between the parts: `t0 + k·h`, and where the importer's points lie between these.

use serde::{Deserialize, Serialize};

/// Largest distance of times that count as equal, relative to the step.
const SAME: f64 = 1e-9;

/// Largest rounding error of a time, relative to its size.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Where the parts stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    start: f64,
    step: f64,
    /// The last point of the grid that was reached.
    count: u64,
    /// A time behind that, if the importer has cut a step.
    beyond: Option<f64>,
}

/// A communication step: from, to, and its length \[s\].
pub type Span = (f64, f64, f64);

impl Grid {
    /// At the start.
    pub fn new(start: f64, step: f64) -> Self {
        Self {
            start,
            step,
            count: 0,
            beyond: None,
        }
    }

    fn point(&self, k: u64) -> f64 {
        self.start + k as f64 * self.step
    }

    /// Current time \[s\].
    pub fn time(&self) -> f64 {
        self.beyond.unwrap_or_else(|| self.point(self.count))
    }

    /// The next step on the way to `end`, and the grid after it; `None` once that is reached. Whole steps are those of a run
    /// that is not cut, to the last bit.
    pub fn next(&self, end: f64) -> Option<(Span, Self)> {
        let now = self.time();
        let slack = (SAME * self.step).max(ROUNDING * end.abs().max(now.abs()));
        let point = self.point(self.count + 1);
        if end - now <= slack {
            return None;
        }
        match end - point >= -slack {
            true => {
                let length = match self.beyond {
                    None => self.step,
                    Some(now) => point - now,
                };
                let count = self.count + 1;
                let after = Self {
                    count,
                    beyond: None,
                    ..*self
                };
                Some(((now, point, length), after))
            }
            false => {
                let beyond = Some(end);
                Some(((now, end, end - now), Self { beyond, ..*self }))
            }
        }
    }

    /// Whether a step is a whole one.
    pub fn is_whole(&self, (_, _, length): Span) -> bool {
        length == self.step
    }
}
