//! A model as expressions, for fitting, linearisation and simulation.

use super::graph::{Graph, Node};
use super::trace::{Obstacle, Traced, trace};

/// A system `ẋ = f(t, x, u; p)` with outputs `y = h(t, x, u; p)`, as an expression graph.
///
/// Its variables are numbered in the order time, states, inputs, parameters; all of them are in the graph.
#[derive(Debug, Clone)]
pub struct System {
    /// The expressions.
    pub graph: Graph,
    /// Number of states.
    pub states: usize,
    /// Number of inputs.
    pub inputs: usize,
    /// Number of parameters.
    pub parameters: usize,
    /// Derivative of each state.
    pub derivatives: Vec<Node>,
    /// The outputs.
    pub outputs: Vec<Node>,
}

/// The point at which equations in generic Rust are evaluated.
#[derive(Debug, Clone, Copy)]
pub struct Point<'a> {
    /// Time.
    pub time: Traced,
    /// The states.
    pub x: &'a [Traced],
    /// The inputs.
    pub u: &'a [Traced],
    /// The parameters.
    pub p: &'a [Traced],
}

impl System {
    /// The system of equations that return the derivatives of the states and the outputs.
    ///
    /// # Errors
    /// If the equations perform an operation that a graph cannot represent.
    ///
    /// # Panics
    /// If the number of returned derivatives differs from the number of states.
    pub fn trace(
        [states, inputs, parameters]: [usize; 3],
        equations: impl FnOnce(Point<'_>) -> [Vec<Traced>; 2],
    ) -> Result<Self, Obstacle> {
        let (graph, mut derivatives) = trace(1 + states + inputs + parameters, |all| {
            let (x, rest) = all[1..].split_at(states);
            let (u, p) = rest.split_at(inputs);
            let time = all[0];
            let [dx, y] = equations(Point { time, x, u, p });
            assert_eq!(dx.len(), states, "a derivative for each state");
            [dx, y].concat()
        })?;
        let outputs = derivatives.split_off(states);
        Ok(Self {
            graph,
            states,
            inputs,
            parameters,
            derivatives,
            outputs,
        })
    }

    /// The system with the parameters that have a value replaced by numbers; the others keep their order.
    ///
    /// # Panics
    /// If the number of values is not that of the parameters.
    pub fn with_parameters(&self, values: &[Option<f64>]) -> Self {
        assert_eq!(
            values.len(),
            self.parameters,
            "a value or none for each parameter"
        );
        let free = values.iter().filter(|value| value.is_none()).count();
        let first = self.variables() - self.parameters;
        let mut graph = Graph::default();
        let all: Vec<Node> = (0..first + free).map(|k| graph.variable(k)).collect();
        let (mut variables, mut left) = (all[..first].to_vec(), all[first..].iter());
        for value in values {
            let constant = value.map(|value| graph.constant(value));
            let node = constant.or_else(|| left.next().copied());
            variables.push(node.expect("as many as have no value"));
        }
        let derivatives = graph.import(&self.graph, &self.derivatives, &variables);
        let outputs = graph.import(&self.graph, &self.outputs, &variables);
        Self {
            graph,
            derivatives,
            outputs,
            parameters: free,
            ..*self
        }
    }

    /// The system with a parameter turned into an additional, last input.
    ///
    /// # Panics
    /// If there is no such parameter.
    pub fn with_input(&self, parameter: usize) -> Self {
        assert!(parameter < self.parameters, "a parameter");
        let moved = self.parameter(parameter);
        let mut graph = Graph::default();
        let all: Vec<Node> = (0..self.variables()).map(|k| graph.variable(k)).collect();
        // The position after the inputs is that of the first parameter.
        let first = self.parameter(0);
        let place = |variable: usize| match variable {
            _ if variable == moved => first,
            _ if variable >= first && variable < moved => variable + 1,
            _ => variable,
        };
        let variables: Vec<Node> = (0..self.variables()).map(|k| all[place(k)]).collect();
        Self {
            derivatives: graph.import(&self.graph, &self.derivatives, &variables),
            outputs: graph.import(&self.graph, &self.outputs, &variables),
            graph,
            inputs: self.inputs + 1,
            parameters: self.parameters - 1,
            ..*self
        }
    }

    /// Number of variables.
    pub fn variables(&self) -> usize {
        1 + self.states + self.inputs + self.parameters
    }

    /// Index of the variable of a state.
    pub fn state(&self, k: usize) -> usize {
        1 + k
    }

    /// Index of the variable of an input.
    pub fn input(&self, k: usize) -> usize {
        1 + self.states + k
    }

    /// Index of the variable of a parameter.
    pub fn parameter(&self, k: usize) -> usize {
        1 + self.states + self.inputs + k
    }
}
