//! Uncertainty of quantities that follow from the parameters: derived quantities, figures of the loop, initial states.

use super::{Coordinate, Sure, open_interval};
use crate::result::Found;
use crate::result::loops::Looped;
use nalgebra::{DMatrix, DVector};
use pilotage_inference::Interval;

/// Step of finite differences, relative to the scale of a parameter.
const STEP: f64 = 1e-5;

impl Sure<'_> {
    /// Intervals of the derived quantities of the file, followed by those of the loop's figures.
    pub(super) fn derived(
        &self,
        found: &[Found],
        looped: Option<&Looped<'_>>,
    ) -> Vec<Vec<Interval>> {
        let derived = &self.posed.quantities.derived;
        let pairs = found.iter().zip(derived);
        let mut all: Vec<Vec<Interval>> = pairs
            .map(|(found, (_, node))| self.of_expression(found, *node))
            .collect();
        if let Some(looped) = looped {
            let slopes = self.slopes(looped);
            let figures = found[derived.len()..].iter().enumerate();
            all.extend(figures.map(|(i, found)| {
                let sd = self.along(&slopes.row(i).transpose(), 0);
                vec![open_interval(found.values[0].1, sd)]
            }));
        }
        all
    }

    /// Derivatives of the loop's figures with respect to the shared parameters and the first run's own unknowns, by
    /// central differences.
    fn slopes(&self, looped: &Looped<'_>) -> DMatrix<f64> {
        let posed = self.posed;
        let free = &self.sensitivities.runs[0].free;
        let count = looped.found().len();
        let mut slopes = DMatrix::zeros(count, posed.shared + free.len());
        let mut set = |column: usize, size: f64, of: &dyn Fn(f64) -> Vec<f64>| {
            let step = STEP * size;
            let change = DVector::from_vec(of(step)) - DVector::from_vec(of(-step));
            slopes.set_column(column, &(change / (2.0 * step)));
        };
        for k in 0..posed.shared {
            let moved = |by: f64| {
                let mut theta = self.theta.clone();
                theta[k] += by;
                looped.moved(&theta, (0, 0.0))
            };
            set(k, self.data.scales[k], &moved);
        }
        let own = free.iter().enumerate();
        for (k, state) in own.filter(|(_, state)| **state >= posed.joint.model.states.len()) {
            let size = self.states[0][*state].abs().max(STEP);
            set(posed.shared + k, size, &|by| {
                looped.moved(&self.theta, (*state, by))
            });
        }
        slopes
    }

    /// Intervals of the initial states of the runs.
    pub(super) fn initial(&self) -> Vec<Vec<Option<Interval>>> {
        let runs = || self.sensitivities.runs.iter().enumerate();
        let states = 0..self.posed.joint.model.states.len();
        let of_run = |j: usize, state: usize| {
            let place = self.sensitivities.runs[j]
                .free
                .iter()
                .position(|own| *own == state)?;
            let at = Coordinate::Own(j, place);
            Some(open_interval(self.value(at), self.deviation(at)))
        };
        let free = states.filter(|k| self.posed.runs.iter().any(|run| run.initial[*k].is_none()));
        free.map(|k| runs().map(|(j, _)| of_run(j, k)).collect())
            .collect()
    }
}
