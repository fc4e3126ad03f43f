//! The inputs that stand for delays: recorded inputs, shifted (`posed::delayed`).

use super::Assembly;
use super::inputs::{CLOCKS, Key};
use crate::posed::data::Rows;
use crate::posed::delayed::Shifted;
use pilotage_expression::{Node, Opaque, Partial};
use std::sync::Arc;

impl Assembly<'_> {
    /// Puts shifted recordings in place of the inputs that stand for delays, among the nodes of the joint model's variables.
    pub(super) fn delay(&mut self, variables: &mut [Node], rows: &[Rows]) {
        let (joint, model) = (self.joint, &self.joint.model);
        for own in joint.delayed() {
            let of = |name: &str| model.signal(name).expect("an output of its own");
            let of = [of(&own.signal), of(&own.tau)];
            let [signal, tau] = self.imported(of, variables);
            let inputs = self.input_variables();
            let node = match self.depends(signal, |variable| !inputs.contains(&variable)) {
                false => {
                    let values = |rows: &Rows| self.along(signal, rows);
                    let values = rows.iter().map(values).collect();
                    self.shifted(rows, values, tau)
                }
                true => self.shifted_inputs(of, variables, rows),
            };
            let place = model.inputs.iter().position(|name| *name == own.name);
            variables[model.system.input(place.expect("an input of its own"))] = node;
            self.values[0].insert(own.name, node);
        }
    }

    fn imported(&mut self, nodes: [Node; 2], variables: &[Node]) -> [Node; 2] {
        let graph = &self.joint.model.system.graph;
        let found = self.graph.import(graph, &nodes, variables);
        [found[0], found[1]]
    }

    /// Values of an expression of inputs at the samples of a run.
    fn along(&self, node: Node, rows: &Rows) -> Vec<f64> {
        let mut at = vec![0.0; self.variables()];
        let values = rows.inputs.iter().map(|inputs| {
            at[self.input_variables()].copy_from_slice(inputs);
            self.graph.values(&at)[node.index()]
        });
        values.collect()
    }

    /// A signal that is a line in its inputs and depends on what is sought: that of the shifted inputs, without its value without
    /// inputs as long as it was 0.
    fn shifted_inputs(&mut self, of: [Node; 2], variables: &[Node], rows: &[Rows]) -> Node {
        let model = &self.joint.model;
        let [_, tau] = self.imported(of, variables);
        let needed = model.system.graph.ancestors(&of[..1]);
        let [mut shifted, mut without] = [variables.to_vec(), variables.to_vec()];
        for (k, name) in model.inputs.iter().enumerate() {
            let variable = model.system.input(k);
            let node = model.system.graph.known_variable(variable);
            let fed = self.input(&Key::Fed(name.clone()));
            if let (Some(input), true) = (fed, node.is_some_and(|own| needed[own.index()])) {
                let of_run = |rows: &Rows| rows.inputs.iter().map(|row| row[input]).collect();
                let values = rows.iter().map(of_run).collect();
                shifted[variable] = self.shifted(rows, values, tau);
                without[variable] = self.graph.constant(0.0);
            }
        }
        let [moved, _] = self.imported(of, &shifted);
        let [none, _] = self.imported(of, &without);
        if self.graph.is_zero(none) {
            return moved;
        }
        let ones = rows.iter().map(|rows| vec![1.0; rows.time.len()]).collect();
        let since = self.shifted(rows, ones, tau);
        let one = self.graph.constant(1.0);
        let before = self.graph.subtract(one, since);
        let before = self.graph.multiply(none, before);
        self.graph.subtract(moved, before)
    }

    /// The node of a signal with these values at the samples of each run, shifted by `tau`.
    fn shifted(&mut self, rows: &[Rows], values: Vec<Vec<f64>>, tau: Node) -> Node {
        let times = rows.iter().map(|rows| &rows.time);
        let times = times.map(|time| time.iter().map(|t| t - time[0]).collect::<Vec<f64>>());
        let function: Arc<dyn Opaque> = Arc::new(Shifted::new(times.zip(values)));
        let keys = (0..CLOCKS).map(Key::Clock).chain([Key::Number]);
        let mut arguments: Vec<Option<Node>> = keys.map(|key| self.input_node(&key)).collect();
        arguments.push(Some(tau));
        self.graph.call(&function, &arguments, Partial::of(0))
    }
}
