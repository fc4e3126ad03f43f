//! A checked model file as expressions.

use crate::build::{self, Built, Delayed, FreeDelay};
use crate::error::{Fault, ModelFileError, unread};
use crate::file::{Formula, LONGEST, ModelFile, Variable};
use crate::scope::Scope;
use crate::syntax::Part;
use crate::tables::{ReadTable, TableFiles, Tables};
use crate::units;
use pilotage_expression::{Function, Graph, Model, Node, Operation, Operator, System};
use pilotage_text::document::Position;
use pilotage_text::file;
use std::io::Read;
use std::path::Path;

/// A compiled model file: its declarations, and its equations as an expression graph.
#[derive(Debug, Clone)]
pub struct Compiled {
    /// The declarations of the file.
    pub file: ModelFile,
    /// The files of the tables.
    pub tables: TableFiles,
    /// The equations. The states are the declared ones, followed by those of delays; the outputs are the locals,
    /// followed by the outputs that have their own value, before any limit is applied.
    pub model: Model,
    /// Limits of each output of [`model`](Self::model), as expressions of parameters.
    pub limits: Vec<Option<[Node; 2]>>,
    /// The states of delays.
    pub delays: Vec<DelayState>,
    /// The delays without an order.
    pub free_delays: Vec<FreeDelay>,
    starts: Vec<Node>,
    /// Time of each delay, and its byte offset in the text.
    taus: Vec<(Node, usize)>,
    /// The nodes of the parts of each formula.
    parts: Vec<(Formula, Vec<Node>)>,
}

/// A state of a delay.
#[derive(Debug, Clone)]
pub struct DelayState {
    /// Name of the state.
    pub name: String,
    /// Name of the unit of the variable whose expression contains the delay; `None` if it has none.
    pub unit: Option<String>,
    /// Description in one line.
    pub description: String,
}

/// The location at which a value becomes infinite or NaN.
#[derive(Debug, Clone, PartialEq)]
pub struct Trouble {
    /// Line and column in the model file.
    pub position: Position,
    /// The expression as written.
    pub expression: String,
    /// Its value.
    pub value: f64,
    /// Its operands, each as written and with its value.
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

/// Reads a model file, and its tables from the same folder.
///
/// # Errors
/// If a file cannot be read or contains a mistake. The message contains file, line and column.
pub fn read(path: &Path) -> Result<Compiled, ModelFileError> {
    let mut bytes = Vec::new();
    let file = file::open(path).map_err(|source| unread(path.to_owned(), source))?;
    // One byte more than permitted, to detect a file that is too long without reading all of it.
    file.take(LONGEST as u64 + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| unread(path.to_owned(), source))?;
    let text = match String::from_utf8(bytes) {
        Ok(text) => text,
        // The cut may be within a character.
        Err(error) if error.as_bytes().len() > LONGEST => {
            String::from_utf8_lossy(error.as_bytes()).into_owned()
        }
        Err(error) => {
            let source = std::io::Error::new(std::io::ErrorKind::InvalidData, error);
            return Err(unread(path.to_owned(), source));
        }
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    parse(&text, &path.display().to_string(), &|table| {
        file::text(&folder.join(table))
    })
}

/// Compiles the text of a model file. `file` is its name in messages; `read_table` returns the text of a table's file.
///
/// # Errors
/// If the text contains a mistake. The message contains file, line and column.
pub fn parse(
    text: &str,
    file: &str,
    read_table: ReadTable<'_>,
) -> Result<Compiled, ModelFileError> {
    let file = ModelFile::declared(text, file)?;
    let scope = Scope::of(&file)?;
    let tables = Tables::read(&file, &scope, read_table)?;
    units::check(&file, &scope, &tables)?;
    let built = build::build(&file, &scope, &tables, &[])?;
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
    let mut inputs = names(&file.inputs);
    let is_input = |own: &&FreeDelay| own.by == Delayed::Input;
    inputs.extend(
        built
            .free
            .iter()
            .filter(is_input)
            .map(|own| own.name.clone()),
    );
    let system = System {
        states: states.len(),
        inputs: inputs.len(),
        parameters: file.parameters.len(),
        derivatives: built.derivatives,
        outputs: kept.iter().map(|k| built.computed[*k]).collect(),
        graph: built.graph,
    };
    let model = Model {
        system,
        states,
        inputs,
        parameters: names(&file.parameters),
        outputs: kept.iter().map(|k| all[*k].clone()).collect(),
    };
    Compiled {
        limits: kept.iter().map(|k| built.limits[*k]).collect(),
        starts: built.starts,
        taus: built.taus,
        free_delays: built.free,
        parts: built.parts,
        tables: tables.files,
        model,
        delays,
        file,
    }
}

impl Compiled {
    /// The same file with this in place of each delay without an order, in the order of
    /// [`free_delays`](Self::free_delays).
    ///
    /// # Errors
    /// If a variable of the file has the name of a state that an order needs.
    pub fn with_delays(&self, by: &[Delayed]) -> Result<Self, ModelFileError> {
        let tables = Tables {
            files: self.tables.clone(),
        };
        let file = self.file.clone();
        let scope = Scope::of(&file)?;
        let built = build::build(&file, &scope, &tables, by)?;
        Ok(assemble(file.clone(), tables, built))
    }

    /// Start values of the parameters.
    pub fn parameters(&self) -> Vec<f64> {
        let all = self.file.parameters.iter();
        all.map(|parameter| parameter.start.number().unwrap_or_default())
            .collect()
    }

    /// Start values of all states for these parameter values; states of delays start at 0.
    ///
    /// # Panics
    /// If the number of values differs from the number of parameters.
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

    /// Start values of the declared states as expressions; states of delays start at 0.
    pub fn starts(&self) -> &[Node] {
        &self.starts
    }

    /// True for states whose start value depends on parameters.
    pub fn starts_on_parameters(&self) -> Vec<bool> {
        let graph = &self.model.system.graph;
        let is_number = |node: &Node| graph.value(*node).is_some();
        self.starts.iter().map(|node| !is_number(node)).collect()
    }

    /// True if the derivatives are linear in states and inputs, `ẋ = A(p) x + B(p) u`, by the operations that they use.
    pub fn is_linear(&self) -> bool {
        let system = &self.model.system;
        let graph = &system.graph;
        let parameters = system.parameter(0)..system.variables();
        let varies = graph.dependants(|variable| !parameters.contains(&variable));
        let of_time = graph.dependants(|variable| variable == 0);
        let is_linear = |operation: &Operation| match operation {
            Operation::Constant(_) | Operation::Variable(_) => true,
            Operation::Unary(function, _) => *function == Function::Negate,
            Operation::Binary(Operator::Add | Operator::Subtract, ..) => true,
            Operation::Binary(Operator::Multiply, a, b) => {
                !(varies[a.index()] && varies[b.index()])
            }
            Operation::Binary(Operator::Divide, _, below) => !varies[below.index()],
            // A step function has zero slope everywhere but is not linear.
            _ => false,
        };
        let needed = graph.ancestors(&system.derivatives);
        let mut needed = (0..needed.len()).filter(|k| needed[*k]);
        needed.all(|k| !of_time[k] && (!varies[k] || is_linear(&graph.operations()[k])))
            && self.rests_at_zero()
    }

    /// True if all derivatives are 0 for zero states and inputs, for all parameters.
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

    /// The first expression at a point that is not finite although all its operands are. None if all values on which
    /// derivatives and outputs depend are finite.
    ///
    /// # Panics
    /// If the numbers of states, inputs or parameters differ from those of the model.
    pub fn trouble(&self, time: f64, x: &[f64], u: &[f64], p: &[f64]) -> Option<Trouble> {
        let values = self.values(time, x, u, p);
        let system = &self.model.system;
        let bad = |nodes: &[Node]| -> Vec<Node> {
            let bad = nodes.iter().copied();
            bad.filter(|node| !values[node.index()].is_finite())
                .collect()
        };
        // Outputs are only checked if the derivatives are finite.
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

    /// Rejects start values that are out of range or not finite, delay times that are not positive, and reversed
    /// limits.
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
