//! The states of an FMU after its initialisation, as functions of its parameters.

use crate::pool::PointError;
use crate::rates::Rates;
use pilotage_expression::{Opaque, Partial};
use std::sync::{Arc, PoisonError};

/// The states that [`Rates`] begins at.
#[derive(Debug)]
pub(crate) struct InitialStates(pub(crate) Arc<Rates>);

impl Opaque for InitialStates {
    fn arguments(&self) -> usize {
        self.0.layout.parameters.len()
    }

    fn neutral(&self, argument: usize) -> f64 {
        self.0.layout.parameters[argument].start
    }

    fn depends(&self, partial: Partial) -> bool {
        // Second derivatives are left out: a search does without.
        partial.arguments().count() < 2
    }

    fn evaluate(&self, at: &[f64], wanted: &[Partial], out: &mut [f64]) {
        for (out, partial) in out.iter_mut().zip(wanted) {
            *out = self.value(at, *partial).unwrap_or_else(|error| {
                let mut trouble = self
                    .0
                    .trouble
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner);
                *trouble = Some(format!("its initialisation failed: {error}"));
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
        let value = |at: &[f64]| {
            rates
                .pool
                .with(&rates.layout, at, 0.0, |held| Ok(held.initial[state]))
        };
        let Some(place) = partial.arguments().next() else {
            return value(at);
        };
        let argument = rates.layout.parameter_arguments().start + place;
        let step = rates.steps[argument] * rates.size(argument).max(at[place].abs());
        let (up, down) = rates.room(at[place], argument, rates.steps[argument]);
        let ends = [if up { step } else { 0.0 }, if down { -step } else { 0.0 }].map(|step| {
            let mut moved = at.to_vec();
            moved[place] += step;
            moved
        });
        Ok((value(&ends[0])? - value(&ends[1])?) / (ends[0][place] - ends[1][place]))
    }
}
