//! Derivatives of the outputs with respect to parameters and free initial states, from the linearised equations.

use super::Condensed;
use super::active::RowAt;
use super::run::{Place, RunSweep};
use crate::Collocation;
use nalgebra::{DMatrix, RowDVector};
use pilotage_sqp::{Iterate, QpSolver};

/// Derivatives of the outputs of a run at its samples, in physical units. Divided by the noise's standard deviations they
/// are the regression of `pilotage-inference`, which gives the parameters' covariance; `examples/own_model.rs` shows it.
#[derive(Debug, Clone)]
pub struct Sensitivity {
    /// The states with free initial values.
    pub free: Vec<usize>,
    /// Their scales.
    pub scales: Vec<f64>,
    /// For each measured output, `∂y(t_k)/∂[θ; x(0)]` with the states determined by the collocation equations; samples
    /// × (parameters and free initial states).
    pub outputs: Vec<DMatrix<f64>>,
    /// Gradients of the active bounds over the same variables, one per row, pointing into the permitted range.
    pub active: DMatrix<f64>,
}

/// Derivatives at a solution.
#[derive(Debug, Clone)]
pub struct Sensitivities {
    /// One entry per run.
    pub runs: Vec<Sensitivity>,
    /// Gradients of the active constraints on the parameters, one per row, pointing into the permitted range.
    pub parameters: DMatrix<f64>,
    /// Indices of the active constraints.
    pub active: Vec<usize>,
}

impl Sensitivities {
    /// The derivatives at a solution, from the factors of its QP: one linearisation, no iteration. A constraint counts
    /// as active if it has a multiplier. None if the QP does not [support](Condensed::takes) the problem, or the
    /// linearised equations are singular.
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
                scales: units[p..].to_vec(),
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

/// Sign of the changes of its value that an active bound permits, over the factor of the value.
fn inward(problem: &Collocation, at: &Iterate, row: RowAt) -> f64 {
    match row {
        RowAt::Bounded { run, row } => {
            let layout = &problem.layout.runs[run];
            let output = problem.measured + row / layout.samples;
            -at.eta[layout.g + row].signum() / problem.model.output_factor(output)
        }
        // Constraints on the parameters have only lower limits.
        RowAt::Parameter(_) => 1.0,
    }
}

/// A matrix from rows of this width.
fn rows(all: Vec<RowDVector<f64>>, width: usize) -> DMatrix<f64> {
    match all.is_empty() {
        true => DMatrix::zeros(0, width),
        false => DMatrix::from_rows(&all),
    }
}
