//! A collocation problem in which a parameter or an initial state is fixed.

use crate::refit::{Coordinate, Fixed, Point};
use crate::solved::{Solved, Watch, point, solve};
use pilotage_collocation::{Collocation, Differentiated, ParameterConstraints, Run, Scales};
use std::sync::Arc;

/// A collocation problem with one coordinate fixed. A shared parameter becomes an input, so that the equations are
/// differentiated only once for all of its values.
pub(crate) struct Held<'s> {
    solved: &'s Solved,
    at: Coordinate,
    model: Arc<Differentiated>,
}

impl<'s> Held<'s> {
    pub fn new(solved: &'s Solved, at: Coordinate) -> Self {
        let own = &solved.problem.model.tapes;
        let model = match at {
            Coordinate::Shared(k) => Arc::new(Differentiated::new(&own.system.with_input(k))),
            Coordinate::Initial { .. } => own.clone(),
        };
        Self { solved, at, model }
    }

    /// The problem with the coordinate fixed at that value, in units.
    fn problem(&self, value: f64) -> Collocation {
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
}

impl Fixed for Held<'_> {
    fn begin(&self) -> Vec<f64> {
        let mut z = self.solved.at.z.clone();
        if let Coordinate::Shared(k) = self.at {
            z.remove(self.solved.problem.layout.theta + k);
        }
        z
    }

    fn put(&self, z: &mut [f64], value: f64) {
        if let Coordinate::Initial { run, state } = self.at {
            let scale = self.solved.problem.model.scales.states[state];
            z[self.solved.problem.layout.runs[run].z + state] = value / scale;
        }
    }

    fn solved(&self, value: f64, z: Vec<f64>, watch: &Watch<'_>) -> Option<Point> {
        let problem = self.problem(value);
        let found = solve(&problem, z, &self.solved.options, watch)?;
        Some(point(&problem, found))
    }
}
