//! The equations of a problem with wires removed, linearised at the end of the first run.

use crate::posed::Posed;
use crate::posed::variables;
use crate::system::joint::{Joint, conversion};
use nalgebra::DMatrix;
use pilotage_expression::{Graph, Node};
use pilotage_linear::StateSpace;
use std::collections::HashMap;

/// The joint equations without some wires, from inputs to signals.
pub(crate) struct Opened<'p> {
    posed: &'p Posed<'p>,
    /// Graph of these equations. Each variable is mapped to its node in the closed equations; inputs driven by the
    /// removed wires have none.
    graph: Graph,
    variables: Vec<Option<Node>>,
    /// Those inputs, by the numbers of their variables, with the signals at the source ends of the wires, in the
    /// inputs' units.
    freed: Vec<(usize, Node)>,
    /// Factor of the first wire's unit conversion.
    pub factor: f64,
    /// Names of the inputs and of the signals.
    pub inputs: Vec<String>,
    pub signals: Vec<String>,
    /// Rows of `[A B; C D]`.
    rows: Vec<Vec<Node>>,
}

impl<'p> Opened<'p> {
    /// The equations of a problem without the wires of these numbers, from the inputs selected by `is_input` to these
    /// signals. None if the end of a removed wire is then driven by something else.
    pub fn new(
        posed: &'p Posed<'p>,
        cut: &[usize],
        is_input: impl Fn(&str) -> bool,
        signals: Vec<String>,
    ) -> Option<Self> {
        let mut open = posed.file.system.clone();
        let wires: Vec<_> = cut.iter().map(|k| open.connections[*k].clone()).collect();
        let mut number = 0;
        open.connections.retain(|_| {
            number += 1;
            !cut.contains(&(number - 1))
        });
        let joint = &posed.within_limits().joint;
        let joint = Joint::new(&open, joint.parts.clone()).ok()?;
        let (closed, own) = (&posed.joint.model, &joint.model);
        let nodes: HashMap<&String, Node> = [&closed.states, &closed.inputs, &closed.parameters]
            .into_iter()
            .flatten()
            .zip(posed.quantities.joint[1..].iter().copied())
            .collect();
        let names: Vec<&String> = [&own.states, &own.inputs, &own.parameters]
            .into_iter()
            .flatten()
            .collect();
        let known = names.iter().map(|name| nodes.get(name).copied());
        let variables: Vec<Option<Node>> = std::iter::once(Some(posed.quantities.joint[0]))
            .chain(known)
            .collect();
        let place = |name: &str| names.iter().position(|own| own.as_str() == name);
        let mut graph = own.system.graph.clone();
        let (mut freed, mut factors) = (Vec::new(), Vec::new());
        for wire in &wires {
            let signal = joint.signal(&wire.from.value)?;
            let conversion = conversion(&joint.variables, wire).ok()?;
            let offset = graph.constant(conversion.offset);
            let signal = graph.scale(conversion.factor, signal);
            factors.push(conversion.factor);
            freed.push((1 + place(&wire.to.value)?, graph.add(signal, offset)));
        }
        if variables.iter().filter(|own| own.is_none()).count() != freed.len() {
            return None;
        }
        let inputs: Vec<String> = own
            .inputs
            .iter()
            .filter(|name| is_input(name))
            .cloned()
            .collect();
        let driven = inputs.iter().filter_map(|name| Some(1 + place(name)?));
        let columns = (0..own.states.len())
            .map(|k| own.system.state(k))
            .chain(driven);
        let values = signals.iter().map(|name| joint.signal(name));
        let values: Option<Vec<Node>> = values.collect();
        let outputs = [&own.system.derivatives[..], &values?].concat();
        let columns: Vec<Vec<Node>> = columns
            .map(|variable| graph.derivatives(&outputs, variable))
            .collect();
        let row = |i: usize| columns.iter().map(|column| column[i]).collect();
        Some(Self {
            rows: (0..outputs.len()).map(row).collect(),
            posed,
            graph,
            variables,
            factor: factors.first().copied().unwrap_or(1.0),
            freed,
            inputs,
            signals,
        })
    }

    /// The linear system from the inputs to the signals, with these shared parameters and these states at the end of
    /// the first run. None if a derivative is not finite.
    pub fn linear(&self, x: &[f64], theta: &[f64]) -> Option<StateSpace> {
        let last = self.posed.runs[0].time.len() - 1;
        let system = &self.posed.model.system.graph;
        let closed_values = system.values(&variables(self.posed, 0, last, x, theta));
        let mut point: Vec<f64> = (self.variables.iter())
            .map(|node| node.map_or(0.0, |node| closed_values[node.index()]))
            .collect();
        // The value of a freed input is the signal at its wire's source, which may depend on another freed input.
        for _ in &self.freed {
            let values = self.graph.values(&point);
            for (input, signal) in &self.freed {
                point[*input] = values[signal.index()];
            }
        }
        let values = self.graph.values(&point);
        let n = self.rows.len() - self.signals.len();
        let (inputs, outputs) = (self.inputs.len(), self.signals.len());
        let entry = |i: usize, j: usize| values[self.rows[i][j].index()];
        let own = StateSpace {
            a: DMatrix::from_fn(n, n, entry),
            b: DMatrix::from_fn(n, inputs, |i, j| entry(i, n + j)),
            c: DMatrix::from_fn(outputs, n, |i, j| entry(n + i, j)),
            d: DMatrix::from_fn(outputs, inputs, |i, j| entry(n + i, n + j)),
            states: self.posed.joint.model.states.clone(),
            inputs: self.inputs.clone(),
            outputs: self.signals.clone(),
        };
        own.check_finite().ok()?;
        Some(own)
    }
}
