//! A problem in which a parameter or an initial state is fixed.

use crate::solved::{Coordinate, Solved};
use pilotage_collocation::{Collocation, Differentiated, ParameterConstraints, Run, Scales};
use std::sync::Arc;

/// A problem with one coordinate fixed, to any value. A shared parameter becomes an input, so that the equations are
/// differentiated once for all of its values.
pub(crate) struct Fixed<'s> {
    solved: &'s Solved,
    at: Coordinate,
    model: Arc<Differentiated>,
}

impl<'s> Fixed<'s> {
    pub fn new(solved: &'s Solved, at: Coordinate) -> Self {
        let own = &solved.problem.model.tapes;
        let model = match at {
            Coordinate::Shared(k) => Arc::new(Differentiated::new(&own.system.with_input(k))),
            Coordinate::Initial { .. } => own.clone(),
        };
        Self { solved, at, model }
    }

    /// The problem with that value, in units.
    pub fn problem(&self, value: f64) -> Collocation {
        let whole = &self.solved.problem;
        let mut runs = whole.runs.clone();
        match self.at {
            Coordinate::Shared(_) => {
                let rows = runs.iter_mut().flat_map(|run: &mut Run| &mut run.inputs);
                rows.for_each(|row| row.push(value));
            }
            Coordinate::Initial { run, state } => runs[run].initial[state] = Some(value),
        }
        Collocation::new(
            self.model.clone(),
            self.constraints(value),
            whole.scheme,
            runs,
            self.scales(),
            &whole.bounds,
        )
    }

    fn constraints(&self, value: f64) -> ParameterConstraints {
        let whole = &self.solved.problem.constraints;
        match self.at {
            Coordinate::Shared(k) => whole.with_parameter(k, value),
            Coordinate::Initial { .. } => whole.clone(),
        }
    }

    fn scales(&self) -> Scales {
        let mut scales = self.solved.problem.model.scales.clone();
        if let Coordinate::Shared(k) = self.at {
            scales.parameters.remove(k);
        }
        scales
    }

    /// Its variables at the solution of the whole problem.
    pub fn begin(&self) -> Vec<f64> {
        let mut z = self.solved.at.z.clone();
        if let Coordinate::Shared(k) = self.at {
            z.remove(self.solved.problem.layout.theta + k);
        }
        z
    }

    /// Puts a value, in units, where it stands among the variables.
    pub fn put(&self, z: &mut [f64], value: f64) {
        if let Coordinate::Initial { run, state } = self.at {
            let scale = self.solved.problem.model.scales.states[state];
            z[self.solved.problem.layout.runs[run].z + state] = value / scale;
        }
    }
}
