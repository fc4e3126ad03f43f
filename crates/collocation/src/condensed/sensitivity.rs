//! Derivatives of the outputs by what is free: parameters and free initial states, through the linearised equations.

use super::Condensed;
use super::active::RowAt;
use super::run::{Place, RunSweep};
use crate::Collocation;
use nalgebra::{DMatrix, RowDVector};
use pilotage_sqp::{Iterate, QpSolver};

/// Derivatives of a run's outputs at its samples, in units.
#[derive(Debug, Clone)]
pub struct Sensitivity {
    /// The states whose initial values are free.
    pub free: Vec<usize>,
    /// For each measured output, samples × (parameters and free initial states): `∂y(t_k)/∂[θ; x(0)]`, where the states
    /// follow by the collocation equations.
    pub outputs: Vec<DMatrix<f64>>,
    /// Gradients of the active bounds over the same, one each row, towards what they allow.
    pub active: DMatrix<f64>,
}

/// Derivatives at a solution.
#[derive(Debug, Clone)]
pub struct Sensitivities {
    /// Of the runs.
    pub runs: Vec<Sensitivity>,
    /// Gradients of the active constraints on the parameters, one each row, towards what they allow.
    pub parameters: DMatrix<f64>,
    /// Which of the constraints those are.
    pub active: Vec<usize>,
}

impl Sensitivities {
    /// At a solution, by the factors that its QP has: one linearisation, no iteration. A constraint counts as active where
    /// it has a multiplier. None where the QP does not [take](Condensed::takes) the problem, or where the linearised
    /// equations are singular.
    pub fn new(problem: &Collocation, at: &Iterate) -> Option<Self> {
        if !Condensed::takes(problem) {
            return None;
        }
        let mut condensed = Condensed::default();
        condensed.linearise(problem, at, false);
        (!condensed.singular).then(|| condensed.sensitivities(problem, at))
    }
}

impl Condensed {
    fn sensitivities(&self, problem: &Collocation, at: &Iterate) -> Sensitivities {
        let p = problem.n_parameters();
        let held = self.active_rows(problem, at);
        let held: Vec<_> = held.into_iter().filter(|row| row.is_held()).collect();
        let mut first = p;
        let run = |(j, own): (usize, &RunSweep)| {
            let units = own.units(problem);
            let of_run = held.iter().filter(|row| row.at.run() == Some(j));
            let active = of_run.map(|row| {
                let mut gradient = RowDVector::zeros(own.r());
                let inward = inward(problem, at, row.at);
                for &(column, value) in &row.entries {
                    let k = if column < p {
                        column
                    } else {
                        column - first + p
                    };
                    gradient[k] += inward * value / units[k];
                }
                gradient
            });
            let active = rows(active.collect(), own.r());
            first += own.free.len();
            let outputs =
                (0..problem.measured).map(|k| own.output(Place { problem, j }, k, &units));
            Sensitivity {
                outputs: outputs.collect(),
                free: own.free.clone(),
                active,
            }
        };
        let runs = self.runs.iter().enumerate().map(run).collect();
        let on_parameters = held.iter().filter_map(|row| row.at.parameter());
        let active: Vec<usize> = on_parameters.collect();
        let scales = &problem.model.scales.parameters;
        let gradient = |i: &usize| {
            let own = self.parameter_rows[*i].iter().zip(scales);
            RowDVector::from_iterator(p, own.map(|(value, scale)| value / scale))
        };
        Sensitivities {
            parameters: rows(active.iter().map(gradient).collect(), p),
            active,
            runs,
        }
    }
}

impl RunSweep {
    /// Scales of the parameters and of the free initial states.
    fn units(&self, problem: &Collocation) -> Vec<f64> {
        let scales = &problem.model.scales;
        let states = self.free.iter().map(|i| scales.states[*i]);
        scales.parameters.iter().copied().chain(states).collect()
    }

    /// Derivatives of an output at the samples.
    fn output(&self, at: Place<'_>, output: usize, units: &[f64]) -> DMatrix<f64> {
        let grid = &at.problem.grids[at.j];
        let columns = at.problem.model.columns(output);
        let mut out = DMatrix::zeros(grid.observed.len(), self.r());
        for (sample, point) in grid.observed.iter().enumerate() {
            let s = self.s_of(&grid.points[*point].state);
            for (gradient, &column) in self.gradients[output].of(*point).zip(columns) {
                match column.checked_sub(self.n) {
                    Some(parameter) => out[(sample, parameter)] += gradient,
                    None => {
                        let s = &s[column * self.w..][..self.r()];
                        (s.iter().enumerate()).for_each(|(k, s)| out[(sample, k)] += gradient * s);
                    }
                }
            }
        }
        for (mut column, unit) in out.column_iter_mut().zip(units) {
            column /= *unit;
        }
        out
    }
}

/// In which direction of its value a bound allows changes.
fn inward(problem: &Collocation, at: &Iterate, row: RowAt) -> f64 {
    match row {
        RowAt::Bounded { run, row } => -at.eta[problem.layout.runs[run].g + row].signum(),
        // These have lower limits alone.
        RowAt::Parameter(_) => 1.0,
    }
}

/// Rows of this width as a matrix.
fn rows(all: Vec<RowDVector<f64>>, width: usize) -> DMatrix<f64> {
    match all.is_empty() {
        true => DMatrix::zeros(0, width),
        false => DMatrix::from_rows(&all),
    }
}
