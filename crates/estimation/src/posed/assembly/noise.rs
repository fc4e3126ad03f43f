//! Noise that drives the states.

use super::checks::needed;
use super::{Assembly, Done, Made};
use crate::posed::data::Rows;
use crate::posed::names::Of;
use crate::problem::error::ProblemError;
use crate::problem::file::{Prior, ProcessNoise, Quantity};
use crate::system::joint::{Joint, unknown};
use pilotage_expression::Node;
use pilotage_filter::{Equations, Filter};

/// A white noise.
#[derive(Debug, Clone)]
pub struct DrivingNoise {
    /// Its gain in the derivatives of the joint model's states.
    pub column: Vec<Node>,
    /// Its power spectral density.
    pub density: Node,
}

impl Assembly<'_> {
    /// The noises of the file, over the variables of the joint model.
    pub(super) fn driving_noises(
        &mut self,
        variables: &[Node],
        rows: &[Rows],
    ) -> Done<Vec<DrivingNoise>> {
        let lines = &self.file.process_noise;
        if lines.is_empty() {
            return Ok(Vec::new());
        }
        let names: Vec<&str> = lines.iter().map(|own| own.signal.value.as_str()).collect();
        let noisy = self.joint.with_noise(&self.file.system, &names)?;
        let of: Vec<Of> = (0..lines.len()).map(Of::Density).collect();
        let values = self.values[0].clone();
        let densities = self.expressions(&of, None, &values);
        let mut all = Vec::new();
        for (line, density) in lines.iter().zip(densities) {
            self.check_density(line, density, rows)?;
            let column = self.noise_column(line, &noisy, variables)?;
            all.push(DrivingNoise { column, density });
        }
        Ok(all)
    }

    /// Gain of a noise in the derivatives.
    fn noise_column(
        &mut self,
        line: &ProcessNoise,
        noisy: &Joint,
        variables: &[Node],
    ) -> Done<Vec<Node>> {
        let name = &line.signal.value;
        let states = &self.joint.model.states;
        if states.contains(name) {
            let entry = |own: &String| f64::from(u8::from(own == name));
            let entries: Vec<f64> = states.iter().map(entry).collect();
            return Ok(entries
                .into_iter()
                .map(|own| self.graph.constant(own))
                .collect());
        }
        let fault = |text: String| ProblemError::maybe_at(line.signal.place.as_ref(), text);
        let input = noisy
            .noise_input(name)
            .ok_or_else(|| fault(self.no_entry(name)))?;
        self.check_feedthrough(line, noisy, input)?;
        let system = &noisy.model.system;
        let mut graph = system.graph.clone();
        let column = graph.derivatives(&system.derivatives, input);
        if column.iter().all(|node| graph.is_zero(*node)) {
            return Err(fault(format!(
                "noise at `{name}` moves no state; leave it out"
            )));
        }
        let all = self.noisy_variables(noisy, variables);
        Ok(self.graph.import(&graph, &column, &all))
    }

    /// The variables of the joint model with noise inputs, which are zero.
    fn noisy_variables(&mut self, noisy: &Joint, variables: &[Node]) -> Vec<Node> {
        let joint = &self.joint.model;
        let zero = self.graph.constant(0.0);
        let first = 1 + joint.states.len();
        let (states, rest) = variables.split_at(first);
        let (inputs, parameters) = rest.split_at(joint.inputs.len());
        let own = |name: &String| joint.inputs.iter().position(|own| own == name);
        let input = |name| own(name).map_or(zero, |place| inputs[place]);
        let inputs = noisy.model.inputs.iter().map(input);
        let all = states.iter().copied().chain(inputs);
        all.chain(parameters.iter().copied()).collect()
    }

    /// Message for a name at which no noise can be added.
    fn no_entry(&self, name: &str) -> String {
        let joint = self.joint;
        if joint.signals().iter().any(|own| own == name) {
            return format!(
                "`{name}` is an output; noise is added to inputs and states: name the input that it drives"
            );
        }
        let inputs = joint
            .model
            .inputs
            .iter()
            .filter(|own| !own.starts_with("wire "));
        let mut known: Vec<String> = inputs.chain(joint.driven.keys()).cloned().collect();
        known.sort();
        known.extend(joint.model.states.iter().cloned());
        unknown("input or state", name, &known)
    }

    /// Rejects a sought density that does not start above 0. A known density may be 0.
    fn check_density(&self, line: &ProcessNoise, node: Node, rows: &[Rows]) -> Done<()> {
        let is_sought = self.depends(node, |variable| {
            self.stands
                .iter()
                .any(|stands| stands.variables(self.first_shared()).contains(&variable))
        });
        let is_wrong = |start: f64| start.is_nan() || start < 0.0 || is_sought && start == 0.0;
        let mut starts = rows.iter().map(|rows| self.number(node, rows));
        match starts.find(|start| is_wrong(*start)) {
            None => Ok(()),
            Some(start) => {
                let verb = if is_sought { "starts at" } else { "is" };
                let least = if is_sought {
                    "above 0"
                } else {
                    "that is 0 or more"
                };
                let fault = format!("the density {verb} {start}; expected a number {least}");
                Err(ProblemError::at(&self.file.place(&line.density), fault))
            }
        }
    }

    /// Rejects white noise measured without a state between noise and sensor: its samples have no finite variance.
    fn check_feedthrough(&self, line: &ProcessNoise, noisy: &Joint, input: usize) -> Done<()> {
        let seen = noisy
            .model
            .system
            .graph
            .dependants(|variable| variable == input);
        let is_seen = |name: &str| noisy.signal(name).is_some_and(|node| seen[node.index()]);
        for measured in &self.file.measured {
            let sees = match &measured.of {
                Quantity::Signal(name) => is_seen(name),
                Quantity::Expression(formula, _) => formula.names().any(is_seen),
            };
            if sees {
                let fault = format!(
                    "white noise at `{}` is measured here without a state between, and such samples have no finite \
                     variance: let it pass a lag first (coloured noise, docs/problems.md)",
                    line.signal.value
                );
                return Err(ProblemError::at(&measured.place, fault));
            }
        }
        Ok(())
    }

    /// Keeps unknowns that do not affect the response at their start values while the response is fitted, by a term of
    /// the objective that is zero there.
    pub(super) fn anchor(&mut self, derivatives: &[Node], noises: &[DrivingNoise], rows: &[Rows]) {
        if noises.is_empty() {
            return;
        }
        let recorded = self.recordings.iter().map(|own| own.output).collect();
        let is_needed = needed(&self.graph, derivatives, recorded);
        let parameters = self.parameters;
        for (k, unknown) in parameters.unknowns.iter().enumerate() {
            for variable in self.stands[k].variables(self.first_shared()) {
                let node = self.graph.variable(variable);
                if is_needed[node.index()] {
                    continue;
                }
                let prior = Prior {
                    mean: unknown.searched(unknown.start),
                    sd: unknown.searched_nominal().unwrap_or(1.0),
                    log: false,
                };
                let in_each = variable < self.first_shared();
                self.expect(node, prior, rows, |j| j == 0 || in_each);
            }
        }
    }
}

impl Made {
    /// The filter for the first `states` states. None if no noise drives them.
    pub fn filter(&self, states: usize) -> Option<Filter> {
        let noises = self.noises.iter();
        let noises: Vec<(Vec<Node>, Node)> = noises
            .map(|own| (own.column.clone(), own.density))
            .collect();
        let outputs = self
            .quantities
            .predicted
            .iter()
            .zip(&self.quantities.deviations);
        let outputs: Vec<(Node, Node)> = outputs.map(|(h, sd)| (*h, *sd)).collect();
        let equations = Equations {
            graph: &self.system.graph,
            variables: self.system.variables(),
            derivatives: &self.system.derivatives[..states],
            noises: &noises,
            outputs: &outputs,
        };
        (!noises.is_empty()).then(|| Filter::new(&equations))
    }
}
