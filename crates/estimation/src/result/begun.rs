//! Initial values of the runs of a fit, other than the sought parameters.

use crate::posed::Posed;
use crate::problem::file::{Per, matching};
use crate::result::{Fit, Found};

impl Fit {
    /// The estimated initial states, each with its value in each run.
    pub fn initial(&self, posed: &Posed<'_>) -> Vec<Found> {
        let is_free = |k: &usize| posed.runs.iter().any(|run| run.initial[*k].is_none());
        let free = (0..posed.joint.model.states.len()).filter(is_free);
        free.map(|k| self.begun(posed, k)).collect()
    }

    /// Values that were not sought and differ from those of the models: initial states set by the problem, parameters,
    /// and inputs that are not driven.
    pub fn given(&self, posed: &Posed<'_>) -> Vec<Found> {
        let model = &posed.joint.model;
        let count = model.states.len() + model.inputs.len() + model.parameters.len();
        let given = (0..count).filter(|k| match *k < model.states.len() {
            true => has_line(posed, &model.states[*k]),
            false => self.is_given(posed, *k),
        });
        given.map(|k| self.begun(posed, k)).collect()
    }

    /// Whether a parameter or an input that was not sought differs in some run from its model's value.
    fn is_given(&self, posed: &Posed<'_>, k: usize) -> bool {
        let name = name_of(posed, k);
        let is_fed = posed
            .file
            .inputs
            .iter()
            .any(|fed| fed.signal.value == *name);
        let is_found = self.parameters.iter().any(|found| found.name == *name);
        let about = posed.joint.variables.get(name);
        let is_other = |start: f64| self.runs.iter().any(|run| run.begin[k] != start);
        !is_fed && !is_found && about.is_some_and(|about| is_other(about.start))
    }

    /// Initial value of a variable: a single value if it is the same in all runs.
    fn begun(&self, posed: &Posed<'_>, k: usize) -> Found {
        let name = name_of(posed, k);
        let values = self
            .runs
            .iter()
            .map(|run| (Some(run.name.clone()), run.begin[k]));
        let mut values: Vec<(Option<String>, f64)> = values.collect();
        if values.iter().all(|(_, value)| *value == values[0].1) {
            values = vec![(None, values[0].1)];
        }
        Found {
            name: name.clone(),
            unit: posed.joint.unit(name).map(str::to_owned),
            values,
            per: Per::All,
            is_tied: false,
            bound: None,
        }
    }
}

/// Name of a variable of the joint model, numbered over its states, inputs and parameters in this order.
fn name_of<'p>(posed: &'p Posed<'_>, k: usize) -> &'p String {
    let model = &posed.joint.model;
    let (inputs, parameters) = (model.states.len(), model.states.len() + model.inputs.len());
    match k {
        k if k < inputs => &model.states[k],
        k if k < parameters => &model.inputs[k - inputs],
        k => &model.parameters[k - parameters],
    }
}

/// Whether a line of `[initial]` applies to a state.
fn has_line(posed: &Posed<'_>, state: &String) -> bool {
    let mut lines = posed.file.initial.iter();
    let mut runs = posed.data.iter();
    lines.any(|(line, _)| !matching(&line.value, std::slice::from_ref(state)).is_empty())
        || runs.any(|run| run.line.is_set(state))
}
