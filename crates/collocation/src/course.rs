//! Simulations with error control: where a search begins, the mesh that it needs there, and what a solution is held
//! against.

use super::mesh::Run;
use super::node::Differentiated;
use super::reference::{Reference, Stop};

/// Of so many steps one ends at a node, at least: three steps of a method of order 5 make about 3⁶ times the error of
/// one, enough for a mesh to begin with.
const STEPS_PER_INTERVAL: usize = 3;
/// Between two samples with fewer steps there is no node: where the data are that dense they are mesh enough.
const FEW_STEPS: usize = 10;

/// What a simulation may get wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// Error of a step, relative to the states, or to their magnitudes where those are larger.
    pub tolerance: f64,
    /// Typical magnitudes of the states.
    pub magnitudes: Vec<f64>,
}

/// A run, simulated.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// Times \[s\], increasing: of the samples, and of the ends of steps between them.
    pub time: Vec<f64>,
    /// The states at these times.
    pub states: Vec<Vec<f64>>,
    /// Places of the samples among these times.
    pub samples: Vec<usize>,
    /// Whether the equations were stiff: an explicit method would have taken far more steps.
    pub is_stiff: bool,
    /// Whether there is a solution to the end. Behind where it ends the states stay as they are.
    pub is_whole: bool,
}

impl Differentiated {
    /// States of a run, simulated with this θ from these initial states with error control throughout, Radau IIA where the
    /// equations are stiff; for runs of any duration.
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

    /// The largest magnitude of each state.
    pub fn sizes(&self) -> Vec<f64> {
        let largest = |k: usize| {
            self.states
                .iter()
                .fold(0.0, |most: f64, x| most.max(x[k].abs()))
        };
        (0..self.states[0].len()).map(largest).collect()
    }

    /// Leaves the samples, and between them as many steps as a mesh needs on which a scheme is about as exact as a rough
    /// simulation; about `most` of these at most.
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

    /// Its times as a mesh.
    pub fn mesh(&self) -> Vec<f64> {
        let mut mesh = self.time.clone();
        mesh.dedup();
        mesh
    }

    /// Goes on to the next sample, if there is a solution up to there.
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
