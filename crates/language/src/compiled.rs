//! A model file that was checked, as expressions.

use crate::build::{self, Built};
use crate::error::{Fault, ModelFileError, unread};
use crate::file::{Formula, LONGEST, ModelFile, Variable};
use crate::scope::Scope;
use crate::syntax::Part;
use crate::tables::{ReadTable, TableFiles, Tables};
use crate::units;
use pilotage_expression::{Function, Graph, Model, Node, Operation, Operator, System};
use pilotage_text::document::Position;
use std::io::Read;
use std::path::Path;

/// A model of a file: what is declared, and its equations as an expression graph.
#[derive(Debug, Clone)]
pub struct Compiled {
    /// What the file declares.
    pub file: ModelFile,
    /// The files of its tables.
    pub tables: TableFiles,
    /// The equations. The states are the declared ones, then those of delays; the outputs are the locals, then the
    /// outputs that have a value of their own, as they are before any limit.
    pub model: Model,
    /// For each output of [`model`](Self::model) between which values it is held, as expressions of parameters.
    pub limits: Vec<Option<[Node; 2]>>,
    /// The states of delays.
    pub delays: Vec<DelayState>,
    starts: Vec<Node>,
    /// Time of each delay, and the byte of the text at which it stands.
    taus: Vec<(Node, usize)>,
    /// For each formula the node of each part.
    parts: Vec<(Formula, Vec<Node>)>,
}

/// A state that a delay has.
#[derive(Debug, Clone)]
pub struct DelayState {
    /// Its name.
    pub name: String,
    /// Name of the unit of the variable in whose expression it stands; `None` where that has none.
    pub unit: Option<String>,
    /// One line.
    pub description: String,
}

/// Where a number stops being finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Trouble {
    /// Line and column of the model file.
    pub position: Position,
    /// The expression, as it is written.
    pub expression: String,
    /// Its value.
    pub value: f64,
    /// What it is made of: each as it is written, and its value.
    pub of: Vec<(String, f64)>,
}

impl std::fmt::Display for Trouble {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "line {}, column {}: `{}` is {}",
            self.position.line, self.position.column, self.expression, self.value
        )?;
        let of: Vec<String> = (self.of.iter())
            .map(|(part, value)| format!("{part} = {value:?}"))
            .collect();
        match of.is_empty() {
            true => Ok(()),
            false => write!(f, ", where {}", of.join(", ")),
        }
    }
}

/// Reads a model file, and its tables from the folder in which it stands.
///
/// # Errors
/// When a file cannot be read, or there is a mistake in it: the message names file, line and column.
pub fn read(path: &Path) -> Result<Compiled, ModelFileError> {
    let mut text = String::new();
    let file = std::fs::File::open(path).map_err(|source| unread(path.to_owned(), source))?;
    // One byte more than is allowed, so that what is too long is found out without reading all of it.
    file.take(LONGEST as u64 + 1)
        .read_to_string(&mut text)
        .map_err(|source| unread(path.to_owned(), source))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    parse(&text, &path.display().to_string(), &|table| {
        std::fs::read_to_string(folder.join(table))
    })
}

/// Compiles the text of a model file. `file` is its name in messages; `read_table` gives the text of a table's file.
///
/// # Errors
/// When there is a mistake in it: the message names file, line and column.
pub fn parse(
    text: &str,
    file: &str,
    read_table: ReadTable<'_>,
) -> Result<Compiled, ModelFileError> {
    let file = ModelFile::declared(text, file)?;
    let scope = Scope::of(&file)?;
    let tables = Tables::read(&file, &scope, read_table)?;
    units::check(&file, &scope, &tables)?;
    let built = build::build(&file, &scope, &tables)?;
    let compiled = assemble(file, tables, built);
    compiled.check_starts()?;
    Ok(compiled)
}

fn assemble(file: ModelFile, tables: Tables, built: Built) -> Compiled {
    let locals = file.locals.len();
    let own = |k: &usize| *k < locals || file.outputs[k - locals].value.is_some();
    let kept: Vec<usize> = (0..built.computed.len()).filter(own).collect();
    let names = |list: &[Variable]| -> Vec<String> {
        list.iter().map(|variable| variable.name.clone()).collect()
    };
    let delays: Vec<DelayState> = (built.delays.iter())
        .map(|state| {
            let of = file.variables().find(|(own, _)| own.name == state.of);
            DelayState {
                name: state.name.clone(),
                unit: of.and_then(|(variable, _)| variable.unit.clone()),
                description: format!("State of the delay of {} in {}", state.signal, state.of),
            }
        })
        .collect();
    let mut states = names(&file.states);
    states.extend(delays.iter().map(|state| state.name.clone()));
    let all = [names(&file.locals), names(&file.outputs)].concat();
    let system = System {
        states: states.len(),
        inputs: file.inputs.len(),
        parameters: file.parameters.len(),
        derivatives: built.derivatives,
        outputs: kept.iter().map(|k| built.computed[*k]).collect(),
        graph: built.graph,
    };
    let model = Model {
        system,
        states,
        inputs: names(&file.inputs),
        parameters: names(&file.parameters),
        outputs: kept.iter().map(|k| all[*k].clone()).collect(),
    };
    Compiled {
        limits: kept.iter().map(|k| built.limits[*k]).collect(),
        starts: built.starts,
        taus: built.taus,
        parts: built.parts,
        tables: tables.files,
        model,
        delays,
        file,
    }
}

impl Compiled {
    /// The parameters' start values.
    pub fn parameters(&self) -> Vec<f64> {
        let all = self.file.parameters.iter();
        all.map(|parameter| parameter.start.number().unwrap_or_default())
            .collect()
    }

    /// Start values of all states, where the parameters have these values; delays begin with 0.
    ///
    /// # Panics
    /// When there are not as many values as parameters.
    pub fn start_values(&self, parameters: &[f64]) -> Vec<f64> {
        let values = self.values(0.0, &[], &[], parameters);
        let mut starts: Vec<f64> = self
            .starts
            .iter()
            .map(|node| values[node.index()])
            .collect();
        starts.resize(self.model.states.len(), 0.0);
        starts
    }

    /// The declared states' start values as expressions; delays begin with 0.
    pub fn starts(&self) -> &[Node] {
        &self.starts
    }

    /// Which states have a start value that depends on parameters.
    pub fn starts_on_parameters(&self) -> Vec<bool> {
        let graph = &self.model.system.graph;
        let is_number = |node: &Node| graph.value(*node).is_some();
        self.starts.iter().map(|node| !is_number(node)).collect()
    }

    /// Whether the derivatives are linear in states and inputs, `ẋ = A(p) x + B(p) u`.
    pub fn is_linear(&self) -> bool {
        let system = &self.model.system;
        let parameters = system.parameter(0)..system.variables();
        let mut graph = system.graph.clone();
        let unknowns = system.state(0)..system.parameter(0);
        let mut slopes = Vec::new();
        for variable in unknowns.chain([0]) {
            slopes.push(graph.derivatives(&system.derivatives, variable));
        }
        let of_time = slopes.pop().unwrap_or_default();
        let varies = graph.dependants(|variable| !parameters.contains(&variable));
        let constant = slopes.iter().flatten().all(|node| !varies[node.index()]);
        // A step has a slope of 0 everywhere and is not linear.
        let needed = graph.ancestors(&system.derivatives);
        let operations = graph.operations().iter().enumerate();
        let smooth = |operation: &Operation| match operation {
            Operation::Constant(_) | Operation::Variable(_) => true,
            Operation::Unary(function, _) => *function == Function::Negate,
            Operation::Binary(operator, ..) => matches!(
                operator,
                Operator::Add | Operator::Subtract | Operator::Multiply | Operator::Divide
            ),
            Operation::Select(..) | Operation::Lookup(..) | Operation::Call(..) => false,
        };
        let mut varying = operations.filter(|(k, _)| needed[*k] && varies[*k]);
        varying.all(|(_, operation)| smooth(operation))
            && constant
            && of_time.iter().all(|node| graph.is_zero(*node))
            && self.rests_at_zero()
    }

    /// Whether all derivatives are 0 where states and inputs are, whatever the parameters.
    fn rests_at_zero(&self) -> bool {
        let system = &self.model.system;
        let mut graph = Graph::default();
        let zero = graph.constant(0.0);
        let variable = |k: usize| k >= system.parameter(0);
        let variables: Vec<Node> = (0..system.variables())
            .map(|k| match variable(k) {
                true => graph.variable(k),
                false => zero,
            })
            .collect();
        let at_zero = graph.import(&system.graph, &system.derivatives, &variables);
        at_zero.iter().all(|node| graph.is_zero(*node))
    }

    /// The first expression that is no finite number though all of which it is made are, at a point; none where
    /// all are finite that derivatives and outputs are made of.
    ///
    /// # Panics
    /// When states, inputs or parameters are not as many as the model's.
    pub fn trouble(&self, time: f64, x: &[f64], u: &[f64], p: &[f64]) -> Option<Trouble> {
        let values = self.values(time, x, u, p);
        let system = &self.model.system;
        let bad = |nodes: &[Node]| -> Vec<Node> {
            let bad = nodes.iter().copied();
            bad.filter(|node| !values[node.index()].is_finite())
                .collect()
        };
        // An output matters where the derivatives are finite.
        let bad = match bad(&system.derivatives) {
            of_derivatives if !of_derivatives.is_empty() => of_derivatives,
            _ => bad(&system.outputs),
        };
        let needed = system.graph.ancestors(&bad);
        let of = |nodes: &[Node], part: Part| values[nodes[part].index()];
        for (formula, nodes) in &self.parts {
            let terms = &formula.expression.terms;
            for part in 0..terms.len() {
                let value = of(nodes, part);
                let parts = terms[part].parts();
                let finite = parts.iter().all(|own| of(nodes, *own).is_finite());
                let is_cause = !value.is_finite() && finite;
                if is_cause && needed[nodes[part].index()] {
                    return Some(self.described(formula, part, value, |part| of(nodes, part)));
                }
            }
        }
        None
    }

    fn described(
        &self,
        formula: &Formula,
        part: Part,
        value: f64,
        value_of: impl Fn(Part) -> f64,
    ) -> Trouble {
        let expression = &formula.expression;
        let of = expression.terms[part].parts().into_iter();
        let of = of.filter(|own| !expression.is_number(*own));
        Trouble {
            position: Position::of(&self.file.text, formula.byte(part)),
            expression: expression.shown(part).to_owned(),
            value,
            of: of
                .map(|own| (expression.shown(own).to_owned(), value_of(own)))
                .collect(),
        }
    }

    /// The values of all nodes at a point; states and inputs that are not given are 0.
    fn values(&self, time: f64, x: &[f64], u: &[f64], p: &[f64]) -> Vec<f64> {
        let system = &self.model.system;
        assert_eq!(p.len(), system.parameters, "a value for each parameter");
        let mut variables = vec![0.0; system.variables()];
        variables[0] = time;
        variables[1..][..x.len()].copy_from_slice(x);
        variables[1 + system.states..][..u.len()].copy_from_slice(u);
        variables[1 + system.states + system.inputs..].copy_from_slice(p);
        system.graph.values(&variables)
    }

    /// Refuses start values that are out of range or no numbers, and limits that are reversed.
    fn check_starts(&self) -> Result<(), ModelFileError> {
        let parameters = self.parameters();
        let starts = self.start_values(&parameters);
        for (state, &value) in self.file.states.iter().zip(&starts) {
            let byte = match state.start.number() {
                Some(_) => state.byte,
                None => state.start.byte(0),
            };
            if !value.is_finite() {
                let name = state.name.clone();
                return Err(self.file.at(byte, Fault::StartValue { name, value }));
            }
            let min = state.min.unwrap_or(f64::NEG_INFINITY);
            let max = state.max.unwrap_or(f64::INFINITY);
            if !(min..=max).contains(&value) {
                let start = value;
                return Err(self.file.at(byte, Fault::StartRange { start, min, max }));
            }
        }
        let values = self.values(0.0, &[], &[], &parameters);
        for (tau, byte) in &self.taus {
            let tau = values[tau.index()];
            if tau.is_nan() || tau <= 0.0 {
                return Err(self.file.at(*byte, Fault::DelayTime(tau)));
            }
        }
        for (name, limit) in self.model.outputs.iter().zip(&self.limits) {
            let Some([low, high]) = limit.map(|ends| ends.map(|node| values[node.index()])) else {
                continue;
            };
            let output = self.file.outputs.iter().find(|output| output.name == *name);
            let formulas = output.and_then(|output| output.limit.as_ref());
            let is_ordered = low
                .partial_cmp(&high)
                .is_some_and(std::cmp::Ordering::is_le);
            if let Some([first, _]) = formulas.filter(|_| !is_ordered) {
                return Err(self.file.at(first.byte(0), Fault::Limit { low, high }));
            }
        }
        Ok(())
    }
}
