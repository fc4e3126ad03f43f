//! Models from model files: their variables as a table, their equations as tapes.

use pilotage_expression::{Graph, Node, Tape};
use pilotage_language::{
    Compiled, Delayed, ModelFile, ModelFileError, Variable as Declared, parse, read,
};
use pilotage_sdk::structure::{Influences, Knowledge};
use pilotage_sdk::variable::Role;
use pilotage_sdk::{At, Equations, Scalar, Table, Unit, Variable};
use smallvec::SmallVec;
use std::path::Path;
use std::sync::Arc;

/// Number of registers stored without allocation.
const ON_STACK: usize = 128;

/// A model file as [`Equations`]: it is exported, connected, linearised and simulated like any other model.
///
/// Clones share the compiled file.
#[derive(Debug, Clone)]
pub struct TextModel(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    compiled: Compiled,
    table: Table,
    derivatives: Tape,
    outputs: Tape,
    /// Times at which conditions on time change.
    switches: Tape,
    /// The equations that take delayed signals, if there are delays without an order.
    exact: Option<Exact>,
    is_linear: bool,
    has_start_formulas: bool,
}

/// Equations in which delays without an order are inputs after the others.
#[derive(Debug)]
struct Exact {
    derivatives: Tape,
    outputs: Tape,
    /// The delayed signals.
    signals: Tape,
    /// Times of the delays.
    times: Tape,
    /// Their states among those of the table, which has those of approximations, too.
    states: Vec<usize>,
}

impl Exact {
    fn of(compiled: &Compiled) -> Option<Self> {
        let free = &compiled.free_delays;
        if free.is_empty() {
            return None;
        }
        let own = compiled.with_delays(&vec![Delayed::Input; free.len()]);
        let own = own.expect("its names are among those of the states of approximations");
        let (_, graph, held) = held(&own);
        let system = &own.model.system;
        let tape = |list: &[Node]| Tape::new(&graph, system.variables(), |_| false, &[list]);
        let names = &compiled.model.states;
        let is_approximate = |state: usize| {
            free.iter().any(|own| {
                let first = names.iter().position(|name| *name == own.name);
                let order = match own.by {
                    Delayed::Pade(order) => order,
                    Delayed::Input => 0,
                };
                first.is_some_and(|first| (first..first + order).contains(&state))
            })
        };
        let signals = own.free_delays.iter().map(|own| own.signal);
        let times = own.free_delays.iter().map(|own| own.tau);
        Some(Self {
            derivatives: tape(&system.derivatives),
            outputs: tape(&held),
            signals: tape(&signals.collect::<Vec<_>>()),
            times: tape(&times.collect::<Vec<_>>()),
            states: (0..names.len()).filter(|k| !is_approximate(*k)).collect(),
        })
    }

    /// Evaluates a tape at a point of the table's states.
    fn run<T: Scalar>(&self, tape: &Tape, at: At<T>, out: &mut [T]) {
        let x: SmallVec<[T; ON_STACK]> = self.states.iter().map(|k| at.x[*k]).collect();
        run(tape, At { x: &x, ..at }, out);
    }
}

impl TextModel {
    /// Reads a model file, and its tables from the same folder.
    ///
    /// # Errors
    /// If a file cannot be read or contains a mistake: the message names file, line and column.
    pub fn read(path: &Path) -> Result<Self, ModelFileError> {
        read(path).map(Self::of)
    }

    /// Parses the text of a model file without tables; `file` is its name in messages.
    ///
    /// # Errors
    /// If the text contains a mistake: the message names file, line and column.
    pub fn parse(text: &str, file: &str) -> Result<Self, ModelFileError> {
        let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
        parse(text, file, &none).map(Self::of)
    }

    /// The model of a compiled file.
    pub fn of(compiled: Compiled) -> Self {
        let system = &compiled.model.system;
        let (order, mut graph, held) = held(&compiled);
        let is_steady = |variable| variable >= system.input(0);
        let switches = graph.switches(&system.derivatives, is_steady);
        let tape = |list: &[Node]| Tape::new(&graph, system.variables(), |_| false, &[list]);
        Self(Arc::new(Inner {
            derivatives: tape(&system.derivatives),
            outputs: tape(&held),
            switches: tape(&switches.times),
            table: table(&compiled, &order),
            exact: Exact::of(&compiled),
            is_linear: compiled.is_linear(),
            has_start_formulas: compiled.starts_on_parameters().contains(&true),
            compiled,
        }))
    }

    /// The equations that take delayed signals, if there are some after the inputs.
    fn exact(&self, inputs: usize) -> Option<&Exact> {
        let exact = self.0.exact.as_ref();
        exact.filter(|_| inputs > self.0.table.inputs().len())
    }

    /// The states that are none of approximations of exact delays, if there are such delays.
    pub(crate) fn states_without_delays(&self) -> Option<&[usize]> {
        self.0.exact.as_ref().map(|own| &own.states[..])
    }

    /// The compiled file.
    pub fn compiled(&self) -> &Compiled {
        &self.0.compiled
    }

    /// The table of variables.
    pub fn variables(&self) -> &Table {
        &self.0.table
    }
}

/// Indices of the compiled outputs in the order of the table: outputs, then locals; a local with the name of an output
/// is listed among the outputs. Also the graph and its nodes for these outputs, clipped to their limits.
pub(crate) fn held(compiled: &Compiled) -> (Vec<usize>, Graph, Vec<Node>) {
    let mut graph = compiled.model.system.graph.clone();
    let names = &compiled.model.outputs;
    let place = |name: &str| names.iter().position(|own| own == name);
    let file = &compiled.file;
    let mut order: Vec<usize> = (file.outputs.iter())
        .filter_map(|output| place(&output.name))
        .collect();
    let rest = (0..names.len()).filter(|k| !order.contains(k));
    let rest: Vec<usize> = rest.collect();
    order.extend(rest);
    let mut held = Vec::new();
    for &k in &order {
        let mut node = compiled.model.system.outputs[k];
        if let Some([low, high]) = compiled.limits[k] {
            node = graph.larger(node, low);
            node = graph.smaller(node, high);
        }
        held.push(node);
    }
    (order, graph, held)
}

/// The table of a model: inputs, outputs, parameters, states and locals as the file declares them.
fn table(compiled: &Compiled, order: &[usize]) -> Table {
    let file = &compiled.file;
    let starts = compiled.start_values(&compiled.parameters());
    let mut table = Table::new(&file.name, &file.description);
    for input in &file.inputs {
        table = table.with(variable(
            input,
            Role::Input,
            Some(input.start.number().unwrap_or(0.0)),
        ));
    }
    for parameter in &file.parameters {
        let role = match parameter.tunable {
            true => Role::Tunable,
            false => Role::Fixed,
        };
        table = table.with(variable(parameter, role, parameter.start.number()));
    }
    let output = |name: &str| file.outputs.iter().find(|output| output.name == name);
    for (state, start) in file.states.iter().zip(&starts) {
        let role = match output(&state.name) {
            Some(_) => Role::Output,
            None => Role::State,
        };
        let own = filled(variable(state, role, None), output(&state.name));
        table = table.state_from(own, &start_name(file, &state.name), *start);
    }
    for state in &compiled.delays {
        let unit = state.unit.as_deref().and_then(Unit::parse);
        let unit = unit.unwrap_or_else(Unit::none);
        let own = Variable::calculated(&state.name, unit, Role::State, &state.description);
        table = table.state_from(own, &start_name(file, &state.name), 0.0);
    }
    for k in order {
        let name = &compiled.model.outputs[*k];
        let local = file.locals.iter().find(|local| local.name == *name);
        let own = match (local, output(name)) {
            (Some(local), Some(output)) => {
                filled(variable(local, Role::Output, None), Some(output))
            }
            (Some(local), None) => variable(local, Role::Local, None),
            (None, Some(output)) => variable(output, Role::Output, None),
            (None, None) => continue,
        };
        table = table.with(own);
    }
    table
}

/// Name of a state's start value, which is none of the file's variables: these have no dots.
fn start_name(file: &ModelFile, state: &str) -> String {
    let usual = format!("{state}_start");
    match file.variables().any(|(other, _)| other.name == usual) {
        true => format!("{state}.start"),
        false => usual,
    }
}

fn variable(declared: &Declared, role: Role, start: Option<f64>) -> Variable {
    let unit = declared.unit.as_deref().and_then(Unit::parse);
    Variable {
        start,
        min: declared.min,
        max: declared.max,
        nominal: declared.nominal,
        ..Variable::calculated(
            &declared.name,
            unit.unwrap_or_else(Unit::none),
            role,
            &declared.description,
        )
    }
}

/// Completes a state or local with what the output of the same name declares.
fn filled(mut own: Variable, output: Option<&Declared>) -> Variable {
    let Some(output) = output else {
        return own;
    };
    if own.description.is_empty() {
        own.description.clone_from(&output.description);
    }
    own.nominal = own.nominal.or(output.nominal);
    if !own.unit.is_some() {
        let unit = output.unit.as_deref().and_then(Unit::parse);
        own.unit = unit.unwrap_or_else(Unit::none);
    }
    own
}

/// Evaluates a tape.
fn run<T: Scalar>(tape: &Tape, at: At<T>, out: &mut [T]) {
    let mut registers: SmallVec<[T; ON_STACK]> = SmallVec::with_capacity(tape.size());
    registers.push(at.time);
    registers.extend_from_slice(at.x);
    registers.extend_from_slice(at.u);
    registers.extend_from_slice(at.p);
    registers.resize(tape.size(), T::from(0.0));
    tape.compute(&mut registers);
    for (out, register) in out.iter_mut().zip(tape.outputs(0)) {
        *out = registers[*register];
    }
}

impl Equations for TextModel {
    fn table(&self) -> Table {
        self.0.table.clone()
    }

    fn derivative<T: Scalar>(&self, at: At<T>, dx: &mut [T]) {
        match self.exact(at.u.len()) {
            Some(exact) => {
                let mut rates: SmallVec<[T; ON_STACK]> =
                    SmallVec::from_elem(T::from(0.0), exact.states.len());
                exact.run(&exact.derivatives, at, &mut rates);
                dx.fill(T::from(0.0));
                for (state, rate) in exact.states.iter().zip(rates) {
                    dx[*state] = rate;
                }
            }
            None => run(&self.0.derivatives, at, dx),
        }
    }

    fn output<T: Scalar>(&self, at: At<T>, y: &mut [T]) {
        match self.exact(at.u.len()) {
            Some(exact) => exact.run(&exact.outputs, at, y),
            None => run(&self.0.outputs, at, y),
        }
    }

    fn delays(&self, p: &[f64], times: &mut Vec<f64>) {
        let Some(exact) = &self.0.exact else {
            return;
        };
        let count = exact.times.outputs(0).len();
        let first = times.len();
        times.resize(first + count, 0.0);
        let x = vec![0.0; self.0.table.n_states()];
        let u = vec![0.0; self.0.table.inputs().len() + count];
        let at = At {
            time: 0.0,
            x: &x[..],
            u: &u[..],
            p,
        };
        exact.run(&exact.times, at, &mut times[first..]);
    }

    fn signals<T: Scalar>(&self, at: At<T>, signals: &mut [T]) {
        if let Some(exact) = &self.0.exact {
            exact.run(&exact.signals, at, signals);
        }
    }

    fn is_linear(&self) -> bool {
        self.0.is_linear
    }

    fn start(&self, p: &[f64], x: &mut [f64]) {
        if self.0.has_start_formulas {
            let depends = self.0.compiled.starts_on_parameters();
            let starts = self.0.compiled.start_values(p);
            for ((x, start), depends) in x.iter_mut().zip(starts).zip(depends) {
                if depends {
                    *x = start;
                }
            }
        }
    }

    fn time_events(&self, u: &[f64], p: &[f64], times: &mut Vec<f64>) {
        let tape = &self.0.switches;
        let count = tape.outputs(0).len();
        if count > 0 {
            let x = vec![0.0; self.0.table.n_states()];
            let first = times.len();
            times.resize(first + count, 0.0);
            let (time, x) = (0.0, &x[..]);
            run(tape, At { time, x, u, p }, &mut times[first..]);
        }
    }

    fn trouble(&self, at: At<f64>) -> Option<String> {
        let u = &at.u[..self.0.table.inputs().len()];
        let trouble = self.0.compiled.trouble(at.time, at.x, u, at.p)?;
        Some(format!("{}, {trouble}", self.0.compiled.file.file))
    }

    fn influences(&self) -> Option<Influences> {
        let system = &self.0.compiled.model.system;
        let (_, graph, held) = held(&self.0.compiled);
        let unknowns = [&system.derivatives[..], &held].concat();
        let rows = graph.influences(&unknowns).into_iter();
        let known = |(variable, is_constant)| (knowledge(system, variable), is_constant);
        Some(Influences {
            rows: rows
                .map(|row| row.into_iter().map(known).collect())
                .collect(),
        })
    }
}

fn knowledge(system: &pilotage_expression::System, variable: usize) -> Knowledge {
    match variable {
        0 => Knowledge::Time,
        k if k < system.input(0) => Knowledge::State(k - system.state(0)),
        k if k < system.parameter(0) => Knowledge::Input(k - system.input(0)),
        k => Knowledge::Parameter(k - system.parameter(0)),
    }
}
