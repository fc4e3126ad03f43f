//! Models with named signals, and how they are joined.

use super::graph::{Graph, Node};
use super::operation::Operation;
use super::system::{Point, System};
use super::trace::{Obstacle, Traced};
use std::collections::HashSet;

/// A system `ẋ = f(t, x, u; p)` with names of its variables and outputs.
#[derive(Debug, Clone)]
pub struct Model {
    /// The equations.
    pub system: System,
    /// Names of the states.
    pub states: Vec<String>,
    /// Names of the inputs.
    pub inputs: Vec<String>,
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// Names of the outputs that are not states.
    pub outputs: Vec<String>,
}

/// Why models cannot be joined, or a signal cannot be found.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ModelError {
    /// There is no signal with that name.
    #[error("no {role} is called {name}; there are {known}")]
    Unknown {
        /// Kind of the name: signal, parameter, input or part.
        role: &'static str,
        /// The name.
        name: String,
        /// The known names.
        known: String,
    },
    /// A name is used twice.
    #[error("two are called {0}; give the parts and their signals names of their own")]
    Same(String),
    /// An input is driven by two signals.
    #[error("the input {0} is connected twice; one signal drives an input")]
    Twice(String),
    /// Outputs depend on each other at the same instant.
    #[error(
        "algebraic loop: {0} depends on itself at the same instant; put a state (a lag) into the loop"
    )]
    Loop(String),
}

impl Model {
    /// A model from equations that return the derivatives of the states and the outputs.
    ///
    /// # Errors
    /// If the equations perform an operation that a graph cannot represent.
    ///
    /// # Panics
    /// If the numbers of returned derivatives and outputs differ from the numbers of names.
    pub fn trace(
        [states, inputs, parameters, outputs]: [&[&str]; 4],
        equations: impl FnOnce(Point<'_>) -> [Vec<Traced>; 2],
    ) -> Result<Self, Obstacle> {
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let sizes = [states, inputs, parameters].map(<[&str]>::len);
        let system = System::trace(sizes, equations)?;
        assert_eq!(
            system.outputs.len(),
            outputs.len(),
            "an output for each name"
        );
        Ok(Self {
            system,
            states: owned(states),
            inputs: owned(inputs),
            parameters: owned(parameters),
            outputs: owned(outputs),
        })
    }

    /// The expression of a state, an output or an input.
    ///
    /// # Errors
    /// If there is no signal with that name.
    pub fn signal(&self, name: &str) -> Result<Node, ModelError> {
        let system = &self.system;
        let at = |names: &[String]| names.iter().position(|own| own == name);
        if let Some(k) = at(&self.outputs) {
            return Ok(system.outputs[k]);
        }
        let state = at(&self.states).map(|k| system.state(k));
        let variable = state.or_else(|| at(&self.inputs).map(|k| system.input(k)));
        let node = variable.and_then(|variable| system.graph.known_variable(variable));
        node.ok_or_else(|| {
            let all = [&self.outputs, &self.states, &self.inputs];
            unknown("signal", name, all.into_iter().flatten())
        })
    }

    /// The system with these signals as its outputs.
    ///
    /// # Errors
    /// If there is no signal with a given name.
    pub fn observed(self, signals: &[&str]) -> Result<System, ModelError> {
        let outputs = signals.iter().map(|name| self.signal(name));
        let outputs = outputs.collect::<Result<_, _>>()?;
        Ok(System {
            outputs,
            ..self.system
        })
    }

    /// The model with some parameters replaced by numbers.
    ///
    /// # Errors
    /// If there is no parameter with a given name.
    pub fn with_values<'a>(
        self,
        values: impl IntoIterator<Item = (&'a str, f64)>,
    ) -> Result<Self, ModelError> {
        let mut fixed: Vec<Option<f64>> = vec![None; self.parameters.len()];
        for (name, value) in values {
            let place = self.parameters.iter().position(|own| own == name);
            let place = place.ok_or_else(|| unknown("parameter", name, self.parameters.iter()))?;
            fixed[place] = Some(value);
        }
        let system = self.system.with_parameters(&fixed);
        let names = self.parameters.iter().zip(&fixed);
        let left = names.filter(|(_, value)| value.is_none());
        let parameters = left.map(|(name, _)| name.clone()).collect();
        Ok(Self {
            system,
            parameters,
            ..self
        })
    }

    /// Joins several named models into one. Connections `(from, to)` drive inputs, from `part.signal` to `part.input`.
    /// States, parameters, outputs and the remaining inputs are named `part.name`, part by part.
    ///
    /// # Errors
    /// If a name is unknown or used twice, an input is driven twice, or the connections form a loop without a state.
    pub fn join(parts: &[(&str, Self)], connections: &[(&str, &str)]) -> Result<Self, ModelError> {
        check_names(parts)?;
        let drivers = drivers(parts, connections)?;
        let mut joint = Joint::new(parts, drivers);
        let mut derivatives = Vec::new();
        for (part, (_, model)) in parts.iter().enumerate() {
            joint.drive(part, &|_| true)?;
            derivatives.extend(joint.import(part, &model.system.derivatives));
        }
        let mut outputs = Vec::new();
        for (part, (_, model)) in parts.iter().enumerate() {
            outputs.extend(joint.import(part, &model.system.outputs));
        }
        let named = |of: fn(&Self) -> &Vec<String>| -> Vec<String> {
            let names = parts.iter().flat_map(|(part, model)| {
                let own = of(model).iter();
                own.map(move |name| format!("{part}.{name}"))
            });
            names.collect()
        };
        let [states, all, parameters] = [
            named(|model| &model.states),
            named(|model| &model.inputs),
            named(|model| &model.parameters),
        ];
        let drivers = joint.drivers.iter().flatten();
        let inputs = all.into_iter().zip(drivers);
        let inputs: Vec<String> = inputs
            .filter(|(_, driver)| driver.is_none())
            .map(|(name, _)| name)
            .collect();
        Ok(Self {
            system: System {
                graph: joint.graph,
                states: states.len(),
                inputs: inputs.len(),
                parameters: parameters.len(),
                derivatives,
                outputs,
            },
            states,
            inputs,
            parameters,
            outputs: named(|model| &model.outputs),
        })
    }
}

/// Rejects duplicate names.
fn check_names(parts: &[(&str, Model)]) -> Result<(), ModelError> {
    let mut seen = HashSet::new();
    for (part, model) in parts {
        let own = [
            &model.states,
            &model.inputs,
            &model.parameters,
            &model.outputs,
        ];
        for name in own.into_iter().flatten() {
            let name = format!("{part}.{name}");
            if !seen.insert(name.clone()) {
                return Err(ModelError::Same(name));
            }
        }
    }
    Ok(())
}

/// The driver of an input: a part and its signal; `None` if it is not connected.
type Driver = Option<(usize, Node)>;

/// The drivers of all inputs of each part.
fn drivers(
    parts: &[(&str, Model)],
    connections: &[(&str, &str)],
) -> Result<Vec<Vec<Driver>>, ModelError> {
    let split = |name: &str| {
        let found = parts.iter().enumerate().filter_map(|(k, (part, _))| {
            let rest = name.strip_prefix(part)?;
            Some((k, rest.strip_prefix('.')?.to_owned()))
        });
        // With parts `a` and `a.b`, the longer name takes precedence.
        let found = found.max_by_key(|(k, _)| parts[*k].0.len());
        let known = parts.iter().map(|(part, _)| format!("{part}."));
        found.ok_or_else(|| ModelError::Unknown {
            role: "part",
            name: name.to_owned(),
            known: known.collect::<Vec<_>>().join(", "),
        })
    };
    let none = parts
        .iter()
        .map(|(_, model)| vec![None; model.inputs.len()]);
    let mut drivers: Vec<Vec<Driver>> = none.collect();
    for (from, to) in connections {
        let ((source, signal), (target, input)) = (split(from)?, split(to)?);
        let node = parts[source].1.signal(&signal);
        let node = node.map_err(|error| match error {
            ModelError::Unknown { role, known, .. } => ModelError::Unknown {
                role,
                name: (*from).to_owned(),
                known,
            },
            other => other,
        })?;
        let inputs = &parts[target].1.inputs;
        let place = inputs.iter().position(|own| *own == input);
        let place = place.ok_or_else(|| unknown("input", to, inputs.iter()))?;
        if drivers[target][place].replace((source, node)).is_some() {
            return Err(ModelError::Twice((*to).to_owned()));
        }
    }
    Ok(drivers)
}

/// A joint model under construction.
struct Joint<'a> {
    parts: &'a [(&'a str, Model)],
    drivers: Vec<Vec<Driver>>,
    graph: Graph,
    /// For each part, the nodes of its variables in the joint graph; those of driven inputs once they are resolved.
    variables: Vec<Vec<Option<Node>>>,
    /// Inputs that are being resolved.
    open: Vec<(usize, usize)>,
}

impl<'a> Joint<'a> {
    fn new(parts: &'a [(&'a str, Model)], drivers: Vec<Vec<Driver>>) -> Self {
        let systems = || parts.iter().map(|(_, model)| &model.system);
        let states: usize = systems().map(|own| own.states).sum();
        let all_drivers = drivers.iter().flatten();
        let inputs = all_drivers.filter(|driver| driver.is_none()).count();
        let mut graph = Graph::default();
        let (mut state, mut input, mut parameter) = (1, 1 + states, 1 + states + inputs);
        let mut variables = Vec::new();
        for (system, drivers) in systems().zip(&drivers) {
            let mut own = vec![Some(graph.variable(0))];
            let mut next = |counter: &mut usize| {
                *counter += 1;
                graph.variable(*counter - 1)
            };
            own.extend((0..system.states).map(|_| Some(next(&mut state))));
            let free = drivers
                .iter()
                .map(|driver| driver.is_none().then(|| next(&mut input)));
            own.extend(free);
            own.extend((0..system.parameters).map(|_| Some(next(&mut parameter))));
            variables.push(own);
        }
        Self {
            parts,
            drivers,
            graph,
            variables,
            open: Vec::new(),
        }
    }

    /// Resolves those driven inputs of a part for which `wanted` holds.
    fn drive(&mut self, part: usize, wanted: &dyn Fn(usize) -> bool) -> Result<(), ModelError> {
        let parts = self.parts;
        for input in 0..self.drivers[part].len() {
            let variable = parts[part].1.system.input(input);
            let Some((source, node)) = self.drivers[part][input] else {
                continue;
            };
            if !wanted(variable) || self.variables[part][variable].is_some() {
                continue;
            }
            if self.open.contains(&(part, input)) {
                let (name, model) = &parts[part];
                return Err(ModelError::Loop(format!("{name}.{}", model.inputs[input])));
            }
            self.open.push((part, input));
            let graph = &parts[source].1.system.graph;
            let needed = graph.ancestors(&[node]);
            let of_source: Vec<usize> = (graph.operations().iter().zip(needed))
                .filter_map(|(operation, needed)| match operation {
                    Operation::Variable(index) if needed => Some(*index as usize),
                    _ => None,
                })
                .collect();
            self.drive(source, &|index| of_source.contains(&index))?;
            let here = self.import(source, &[node])[0];
            self.variables[part][variable] = Some(here);
            self.open.pop();
        }
        Ok(())
    }

    /// Imports expressions of a part. The inputs that they need are resolved.
    fn import(&mut self, part: usize, expressions: &[Node]) -> Vec<Node> {
        let zero = self.graph.constant(0.0);
        let known = self.variables[part].iter();
        let variables: Vec<Node> = known.map(|node| node.unwrap_or(zero)).collect();
        let from = &self.parts[part].1.system.graph;
        self.graph.import(from, expressions, &variables)
    }
}

fn unknown<'a>(
    role: &'static str,
    name: &str,
    known: impl Iterator<Item = &'a String>,
) -> ModelError {
    let known: Vec<&str> = known.map(String::as_str).collect();
    ModelError::Unknown {
        role,
        name: name.to_owned(),
        known: known.join(", "),
    }
}
