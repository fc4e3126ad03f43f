//! One run: its mesh and what is known on it.

/// A run as the transcription needs it. Intervals lie between consecutive `time`s.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Interval boundaries [s], strictly increasing; at least one.
    pub time: Vec<f64>,
    /// Exogenous inputs at each boundary; linear in between.
    pub inputs: Vec<Vec<f64>>,
    /// Recorded output at each boundary; NaN where there is no sample.
    pub measured: Vec<f64>,
    /// Weight of this run's squared residuals.
    pub weight: f64,
    /// Known initial states; None where free.
    pub initial: Vec<Option<f64>>,
}

impl Run {
    /// Number of intervals.
    pub fn intervals(&self) -> usize {
        self.time.len() - 1
    }

    /// Length of an interval [s].
    pub fn step(&self, interval: usize) -> f64 {
        self.time[interval + 1] - self.time[interval]
    }

    /// Inputs at the fraction `c` of an interval.
    pub fn inputs_at(&self, interval: usize, c: f64, out: &mut [f64]) {
        let (from, to) = (
            &self.inputs[interval],
            &self.inputs[(interval + 1).min(self.inputs.len() - 1)],
        );
        for ((o, a), b) in out.iter_mut().zip(from).zip(to) {
            *o = a + c * (b - a);
        }
    }
}
