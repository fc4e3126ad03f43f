//! Equations as expressions, for what writes them in another language.

use crate::text::held;
use crate::{Model, TextModel, traced};
use crate::{Table, TraceError};
use pilotage_expression::{Graph, Node, Operator, System};
use pilotage_language::Delayed;

/// All equations of a model.
#[derive(Debug, Clone)]
pub struct AllExpressions {
    /// Derivatives, and outputs within their limits; states approximate delays.
    pub equations: System,
    /// Times at which conditions on time change, in the same graph.
    pub switches: Vec<Node>,
    /// For each state its start value, in the same graph, if it depends on parameters.
    pub starts: Vec<Option<Node>>,
    /// The equations with exact delays, if there are any.
    pub exact: Option<ExactExpressions>,
}

/// Equations with delayed signals as inputs.
#[derive(Debug, Clone)]
pub struct ExactExpressions {
    /// Derivatives, and outputs within their limits; after the inputs of the table, the delayed signals.
    pub equations: System,
    /// The signals that are delayed, in the same graph.
    pub signals: Vec<Node>,
    /// The time of each delay, in the same graph.
    pub times: Vec<Node>,
    /// Its states among those of the table, which has those of approximations, too.
    pub states: Vec<usize>,
}

impl AllExpressions {
    /// Those of a built-in model.
    ///
    /// # Errors
    /// If they use an operation that a graph cannot represent.
    pub fn of_model(model: &Model) -> Result<Self, TraceError> {
        let traced = traced(model)?;
        let (table, mut graph) = (model.variable_table(), traced.system.graph.clone());
        let outputs = clipped(table, &mut graph, &traced.system);
        Ok(Self {
            starts: vec![None; table.n_states()],
            switches: Vec::new(),
            exact: None,
            equations: with(graph, &traced.system, outputs),
        })
    }

    /// Those of a model file.
    pub fn of_text(model: &TextModel) -> Self {
        let compiled = model.compiled();
        let system = &compiled.model.system;
        let (_, mut graph, outputs) = held(compiled);
        let switches = graph.switches(&system.derivatives, |variable| variable >= system.input(0));
        let depends = compiled.starts_on_parameters().into_iter();
        let starts = compiled.starts().iter().zip(depends);
        let mut starts: Vec<_> = starts.map(|(node, is)| is.then_some(*node)).collect();
        starts.resize(system.states, None);
        Self {
            switches: switches.times,
            starts,
            exact: exact(model),
            equations: with(graph, system, outputs),
        }
    }
}

fn exact(model: &TextModel) -> Option<ExactExpressions> {
    let states = model.states_without_delays()?;
    let by = vec![Delayed::Input; model.compiled().free_delays.len()];
    let own = model.compiled().with_delays(&by).ok()?;
    let (_, graph, outputs) = held(&own);
    Some(ExactExpressions {
        equations: with(graph, &own.model.system, outputs),
        signals: own.free_delays.iter().map(|own| own.signal).collect(),
        times: own.free_delays.iter().map(|own| own.tau).collect(),
        states: states.to_vec(),
    })
}

/// A system with a graph that has grown, and its outputs there.
fn with(graph: Graph, system: &System, outputs: Vec<Node>) -> System {
    System {
        graph,
        derivatives: system.derivatives.clone(),
        outputs,
        ..*system
    }
}

/// The outputs within the limits of the table.
fn clipped(table: &Table, graph: &mut Graph, system: &System) -> Vec<Node> {
    let mut outputs = system.outputs.clone();
    for &(output, parameter) in table.limits() {
        let (value, limit) = (outputs[output], graph.variable(system.parameter(parameter)));
        let low = graph.negate(limit);
        let is_low = graph.binary(Operator::Less, value, low);
        let is_high = graph.binary(Operator::Less, limit, value);
        let raised = graph.select(is_low, low, value);
        outputs[output] = graph.select(is_high, limit, raised);
    }
    outputs
}
