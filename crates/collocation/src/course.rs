//! Simulations with error control. They provide the start of a search, the mesh it needs there, and a reference for a
//! solution.

use super::mesh::Run;
use super::node::Differentiated;
use super::reference::{MOST_STEPS, Reference, Stop};

/// Minimum number of steps per mesh interval: three steps of a method of order 5 in one have about 3⁶ times the error
/// of a single step, which is accurate enough for an initial mesh.
const STEPS_PER_INTERVAL: usize = 3;
/// Minimum number of steps between two samples for additional nodes; denser data form a sufficient mesh by themselves.
const FEW_STEPS: usize = 10;

/// Permitted error of a simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// Permitted error of a step, relative to the states or, if larger, to their magnitudes.
    pub tolerance: f64,
    /// Typical magnitudes of the states.
    pub magnitudes: Vec<f64>,
    /// Maximum number of steps of the whole run. The solution ends at the sample before that.
    pub most_steps: usize,
}

/// A simulated run.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// Increasing times \[s\] of the samples and of the ends of steps between them.
    pub time: Vec<f64>,
    /// The states at these times.
    pub states: Vec<Vec<f64>>,
    /// Indices of the samples among these times.
    pub samples: Vec<usize>,
    /// Whether the equations were stiff, so that an explicit method would have taken far more steps.
    pub is_stiff: bool,
    /// Whether the solution extends to the end. Beyond the end of the solution the states are constant.
    pub is_whole: bool,
}

impl Differentiated {
    /// States of a run, simulated with this θ from these initial states, with error control and with Radau IIA for
    /// stiff equations. Suitable for runs of any duration.
    pub fn course(
        &self,
        run: &Run,
        theta: &[f64],
        initial: &[f64],
        quality: &Quality,
        stop: &Stop<'_>,
    ) -> Course {
        let Quality {
            tolerance,
            magnitudes,
            most_steps,
        } = quality;
        let mut solution = Reference::new((self, run), theta, magnitudes, *tolerance);
        let mut course = Course {
            time: vec![run.time[0]],
            states: vec![initial.to_vec()],
            samples: vec![0],
            is_stiff: false,
            is_whole: true,
        };
        for ends in run.time.windows(2) {
            if course.is_whole && ends[0] < ends[1] {
                let left = most_steps.saturating_sub(course.time.len() - 1);
                solution.patience = left.min(MOST_STEPS);
                course.is_whole = course.advance(&mut solution, (ends[0], ends[1]), stop);
            } else {
                course.push(ends[1], course.states[course.states.len() - 1].clone());
            }
            course.samples.push(course.time.len() - 1);
        }
        course.is_stiff = solution.is_stiff();
        course
    }
}

impl Course {
    /// States at the samples.
    pub fn at_samples(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.samples.iter().map(|place| &self.states[*place])
    }

    /// The last time of the solution \[s\] if it does not extend to the end.
    pub fn early_end(&self) -> Option<f64> {
        let last = self.states.last()?;
        let constant = self.states.iter().rev().take_while(|x| *x == last).count();
        (!self.is_whole).then(|| self.time[self.states.len() - constant.max(1)])
    }

    /// The largest magnitude of each state.
    pub fn sizes(&self) -> Vec<f64> {
        let largest = |k: usize| {
            self.states
                .iter()
                .fold(0.0, |most: f64, x| most.max(x[k].abs()))
        };
        (0..self.states[0].len()).map(largest).collect()
    }

    /// Keeps the samples, and between them about as many steps, at most `most`, as a mesh needs for a scheme to be as
    /// accurate as a coarse simulation.
    pub fn thin(&mut self, most: usize) {
        let steps = self.time.len() - self.samples.len();
        let every = STEPS_PER_INTERVAL.max(steps.div_ceil(most.max(1)));
        let (mut kept, mut samples) = (vec![0], vec![0]);
        for ends in self.samples.windows(2) {
            let inner = ends[0] + 1..ends[1];
            if inner.len() >= FEW_STEPS {
                kept.extend(inner.skip(every - 1).step_by(every));
            }
            samples.push(kept.len());
            kept.push(ends[1]);
        }
        self.time = kept.iter().map(|k| self.time[*k]).collect();
        self.states = kept
            .iter()
            .map(|k| std::mem::take(&mut self.states[*k]))
            .collect();
        self.samples = samples;
    }

    /// The times as a mesh.
    pub fn mesh(&self) -> Vec<f64> {
        let mut mesh = self.time.clone();
        mesh.dedup();
        mesh
    }

    /// Continues to the next sample. Returns whether the solution extends to it.
    fn advance(
        &mut self,
        solution: &mut Reference<'_>,
        times: (f64, f64),
        stop: &Stop<'_>,
    ) -> bool {
        let (count, x) = (self.time.len(), self.states[self.states.len() - 1].clone());
        let next = solution.along(times, &x, stop, |time, x| self.push(time, x.to_vec()));
        if next.is_none() {
            self.time.truncate(count);
            self.states.truncate(count);
            self.push(times.1, x);
        }
        next.is_some()
    }

    fn push(&mut self, time: f64, x: Vec<f64>) {
        self.time.push(time);
        self.states.push(x);
    }
}
