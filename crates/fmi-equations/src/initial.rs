//! The states of an FMU after its initialisation, as functions of its parameters.

use crate::pool::PointError;
use crate::rates::Rates;
use pilotage_expression::{Opaque, Partial};
use std::sync::Arc;

/// The initial states of [`Rates`].
#[derive(Debug)]
pub(crate) struct InitialStates(pub(crate) Arc<Rates>);

impl Opaque for InitialStates {
    fn neutral(&self) -> &[f64] {
        &self.0.start[self.0.layout.parameter_arguments()]
    }

    fn depends(&self, partial: Partial) -> bool {
        // Second derivatives are left out: the search does not need them.
        partial.arguments().count() < 2
    }

    fn evaluate(&self, at: &[f64], wanted: &[Partial], out: &mut [f64]) {
        for (out, partial) in out.iter_mut().zip(wanted) {
            *out = self.value(at, *partial).unwrap_or_else(|error| {
                self.0
                    .remember(format!("its initialisation failed: {error}"));
                f64::NAN
            });
        }
    }

    fn trouble(&self) -> Option<String> {
        self.0.trouble()
    }
}

impl InitialStates {
    fn value(&self, at: &[f64], partial: Partial) -> Result<f64, PointError> {
        let rates = &self.0;
        let state = partial.value as usize;
        let parameters = rates.layout.parameter_arguments();
        let all = [&rates.start[..parameters.start], at].concat();
        let all = rates.kept(&all);
        let value = |at: &[f64]| {
            rates
                .pool
                .with(&rates.layout, at, 0.0, |held| Ok(held.initial[state]))
        };
        let Some(place) = partial.arguments().next() else {
            return value(&all[parameters]);
        };
        let argument = parameters.start + place;
        let ends = rates.ends(&all, argument, rates.steps[argument]);
        let ends = ends.map(|end| end[parameters.clone()].to_vec());
        Ok((value(&ends[0])? - value(&ends[1])?) / (ends[0][place] - ends[1][place]))
    }
}
