//! Initial state trajectories of a search.
//!
//! A closed loop with wrong parameters may be unstable, and its simulation is then no usable initial guess. Therefore
//! measured states follow their recordings, and the others are simulated as driven by these: every loop through a
//! measured state is open.

use crate::posed::Posed;
use crate::posed::data::filled;
use pilotage_collocation::{Course, Differentiated, Quality, Run, Stop};
use pilotage_expression::System;
use std::borrow::Cow;

/// A system in which some states are replaced by inputs.
#[derive(Debug)]
pub struct Followed {
    /// The equations. Inputs that replace states come after the others.
    model: Differentiated,
    /// The replaced states.
    states: Vec<usize>,
    /// The runs, with the recordings as inputs.
    runs: Vec<Run>,
}

/// A measured state, and for each run its recording at the samples; NaN where there is none.
pub type Recorded<'r> = (usize, &'r [Vec<f64>]);

impl Followed {
    /// The system with these states replaced. `None` if none was measured in every run.
    pub fn new(system: &System, runs: &[Run], recorded: &[Recorded<'_>]) -> Option<Self> {
        let is_known = |own: &Vec<f64>| own.iter().any(|value| value.is_finite());
        let recorded = recorded.iter().filter(|(_, all)| all.iter().all(is_known));
        let recorded: Vec<&Recorded<'_>> = recorded.collect();
        if recorded.is_empty() {
            return None;
        }
        let states: Vec<usize> = recorded.iter().map(|(state, _)| *state).collect();
        let runs = runs.iter().enumerate().map(|(j, run)| {
            let mut run = run.clone();
            for (_, all) in &recorded {
                let values = filled(&run.time, &all[j]);
                run.inputs
                    .iter_mut()
                    .zip(values)
                    .for_each(|(inputs, value)| inputs.push(value));
            }
            run
        });
        Some(Self {
            model: Differentiated::new(&opened(system, &states)),
            runs: runs.collect(),
            states,
        })
    }

    /// The replaced states.
    pub fn states(&self) -> &[usize] {
        &self.states
    }

    /// Simulates a run with these parameters from these initial states.
    pub fn simulate(
        &self,
        posed: &Posed<'_>,
        (j, initial): (usize, &[f64]),
        theta: &[f64],
        quality: &Quality,
        stop: &Stop<'_>,
    ) -> Course {
        let mut run = Cow::Borrowed(&self.runs[j]);
        if posed.switches.is_some() {
            let placed = posed.run_at(j, theta, initial);
            let own = run.to_mut();
            own.steps = placed.steps.clone();
            let rows = own.inputs.iter_mut().zip(&placed.inputs);
            rows.for_each(|(own, placed)| own[..placed.len()].copy_from_slice(placed));
        }
        let run = &*run;
        let mut course = self.model.course(run, theta, initial, quality, stop);
        let first = self.model.n_inputs() - self.states.len();
        let mut inputs = vec![0.0; self.model.n_inputs()];
        for (time, x) in course.time.iter().zip(&mut course.states) {
            run.inputs_at(*time, &mut inputs);
            for (state, value) in self.states.iter().zip(&inputs[first..]) {
                x[*state] = *value;
            }
        }
        // At a jump the samples before and after it have separate inputs.
        for (place, inputs) in course.samples.iter().zip(&run.inputs) {
            for (state, value) in self.states.iter().zip(&inputs[first..]) {
                course.states[*place][*state] = *value;
            }
        }
        course
    }
}

/// The system with additional inputs for these states, whose derivatives are zero.
fn opened(system: &System, states: &[usize]) -> System {
    let mut open = System {
        inputs: system.inputs + states.len(),
        outputs: Vec::new(),
        ..system.clone()
    };
    let parameters = 1 + system.states + system.inputs;
    let variables = (0..parameters + system.parameters).map(|k| {
        let place = match states.iter().position(|state| 1 + state == k) {
            Some(place) => parameters + place,
            None if k < parameters => k,
            None => k + states.len(),
        };
        open.graph.variable(place)
    });
    let variables: Vec<_> = variables.collect();
    open.derivatives = open
        .graph
        .import(&system.graph, &system.derivatives, &variables);
    let zero = open.graph.constant(0.0);
    states
        .iter()
        .for_each(|state| open.derivatives[*state] = zero);
    open
}
