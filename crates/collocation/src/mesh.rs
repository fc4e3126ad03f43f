//! One run: its data, and the mesh on which it is solved.

use super::grid::Samples;
use super::loss::Loss;
use super::simd::{LANES, Lanes};

/// A run to be transcribed.
///
/// Mesh and samples are independent: the mesh may be finer or coarser than the samples, neither needs to be uniform,
/// and samples may be missing. Residuals are taken at the times of the samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Interval boundaries \[s\], strictly increasing, at least two; from the first sample to the last.
    pub mesh: Vec<f64>,
    /// Times of the samples \[s\], increasing, within the mesh.
    pub time: Vec<f64>,
    /// Inputs at each sample, linear in between. If two samples have the same time, the inputs jump from the first to
    /// the second.
    pub inputs: Vec<Vec<f64>>,
    /// Recordings of the measured outputs.
    pub measured: Vec<Recording>,
    /// Known initial states; None if free.
    pub initial: Vec<Option<f64>>,
    /// Inputs that jump at times of their own.
    pub steps: Steps,
}

/// Inputs that are constant between times of their own, whatever the samples. At a sample they have the values of its row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Steps {
    /// Index of the first of these inputs; the others follow.
    pub first: usize,
    /// Increasing times \[s\] at which they jump; boundaries of the mesh.
    pub time: Vec<f64>,
    /// Their values before the first time, and after each.
    pub values: Vec<Vec<f64>>,
    /// Index of the first of two inputs that tell a collocation point where the part of the mesh that it stands for begins and ends:
    /// there they have their values at these times, elsewhere those at the point.
    pub window: Option<usize>,
}

impl Steps {
    /// Writes the values after this number of jumps.
    pub(super) fn write(&self, jumps: usize, out: &mut [f64]) {
        if let Some(values) = self.values.get(jumps) {
            out[self.first..][..values.len()].copy_from_slice(values);
        }
    }

    /// Those within an interval, without its ends.
    pub fn cut(&self, from: f64, to: f64) -> Self {
        let time = self.within(from, to).to_vec();
        let first = self.time.partition_point(|t| *t <= from);
        let values = self.values.iter().skip(first).take(time.len() + 1);
        Self {
            first: self.first,
            values: values.cloned().collect(),
            window: self.window,
            time,
        }
    }

    /// The times within an interval, without its ends.
    pub fn within(&self, from: f64, to: f64) -> &[f64] {
        let first = self.time.partition_point(|t| *t <= from);
        let last = self.time.partition_point(|t| *t < to).max(first);
        &self.time[first..last]
    }

    /// A mesh with a boundary at each time.
    pub fn on(&self, mesh: &[f64]) -> Vec<f64> {
        let ends = mesh[0]..mesh[mesh.len() - 1];
        let own = self.time.iter().filter(|time| ends.contains(*time));
        let mut all: Vec<f64> = mesh.iter().chain(own).copied().collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }
}

/// The recording of one output in a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Value at each sample; NaN if it is missing.
    pub values: Vec<f64>,
    /// Weight of its terms in the objective.
    pub weight: f64,
    /// Loss of its residuals.
    pub loss: Loss,
}

impl Recording {
    /// Recorded values at these samples; NaN if missing.
    #[inline(always)]
    pub(super) fn at(&self, samples: Samples) -> Lanes {
        samples.map(|sample| sample.map_or(f64::NAN, |sample| self.values[sample as usize]))
    }

    /// Terms of the objective at these samples, for outputs of the model; zero if nothing was recorded.
    #[inline(always)]
    pub(super) fn costs(&self, samples: Samples, outputs: Lanes) -> Lanes {
        let recorded = self.at(samples);
        let mut costs = [0.0; LANES];
        for lane in 0..LANES {
            let term = match self.loss {
                Loss::Square => (recorded[lane] - outputs[lane]).powi(2),
                loss => loss.value(recorded[lane], outputs[lane]),
            };
            costs[lane] = match recorded[lane].is_nan() {
                true => 0.0,
                false => self.weight * term,
            };
        }
        costs
    }
}

impl Run {
    /// Checks the requirements of the fields, and the model's numbers of states, inputs and recordings.
    ///
    /// # Panics
    /// At the first violation.
    pub(super) fn check(&self, [states, inputs, measured]: [usize; 3]) {
        let (mesh, time) = (&self.mesh, &self.time);
        assert!(mesh.len() > 1, "a mesh has at least two boundaries");
        assert!(mesh.is_sorted_by(|a, b| a < b), "a mesh increases strictly");
        assert!(time.len() > 1, "a run has at least two samples");
        assert!(time.is_sorted(), "times of samples increase");
        let slack = 1e-9 * (mesh[mesh.len() - 1] - mesh[0]);
        let is_within =
            mesh[0] - slack <= time[0] && time[time.len() - 1] <= mesh[mesh.len() - 1] + slack;
        assert!(is_within, "samples lie within the mesh");
        assert_eq!(self.initial.len(), states, "initial states");
        assert_eq!(self.inputs.len(), time.len(), "inputs at each sample");
        for (k, row) in self.inputs.iter().enumerate() {
            assert_eq!(row.len(), inputs, "inputs at sample {k}");
        }
        let steps = &self.steps;
        assert!(steps.time.is_sorted_by(|a, b| a < b), "jumps increase");
        let is_node = |time: &f64| mesh.binary_search_by(|own| own.total_cmp(time)).is_ok();
        assert!(steps.time.iter().all(is_node), "jumps are boundaries");
        let count = if steps.values.is_empty() {
            0
        } else {
            steps.time.len() + 1
        };
        assert_eq!(steps.values.len(), count, "values between jumps");
        assert_eq!(self.measured.len(), measured, "recordings");
        for own in &self.measured {
            own.loss.check();
            assert_eq!(own.values.len(), time.len(), "values of a recording");
            let is_value = |value: &f64| !value.is_infinite();
            assert!(
                own.values.iter().all(is_value),
                "recorded values are finite, or NaN"
            );
        }
    }

    /// Inputs at a time \[s\]; constant before the first sample and after the last.
    pub fn inputs_at(&self, time: f64, out: &mut [f64]) {
        self.inputs_between(self.time.partition_point(|t| *t <= time), time, out);
        let jumps = self.steps.time.partition_point(|t| *t <= time);
        self.steps.write(jumps, out);
    }

    /// The same, but before the jump if inputs jump at that time.
    pub fn inputs_before(&self, time: f64, out: &mut [f64]) {
        self.inputs_between(self.time.partition_point(|t| *t < time), time, out);
        let jumps = self.steps.time.partition_point(|t| *t < time);
        self.steps.write(jumps, out);
    }

    /// True if inputs may jump at this time, that is, if it has two samples or is one of [`Self::steps`], or if parts of the mesh have
    /// inputs of their own.
    pub(super) fn jumps_at(&self, time: f64) -> bool {
        if self.steps.window.is_some() {
            return true;
        }
        let first = self.time.partition_point(|t| *t < time);
        let mut steps = self.steps.time.iter();
        self.time.get(first + 1) == Some(&time) || steps.any(|own| *own == time)
    }

    /// Linear interpolation between sample `after` and the previous one.
    pub(super) fn inputs_between(&self, after: usize, time: f64, out: &mut [f64]) {
        let from = after.saturating_sub(1);
        let to = after.min(self.time.len() - 1);
        let span = self.time[to] - self.time[from];
        let c = if span > 0.0 {
            (time - self.time[from]) / span
        } else {
            0.0
        };
        let c = c.clamp(0.0, 1.0);
        for ((o, a), b) in out.iter_mut().zip(&self.inputs[from]).zip(&self.inputs[to]) {
            *o = a + c * (b - a);
        }
    }
}
