//! From what a problem file says to one graph of equations.

use crate::data::{Rows, RunData, Source};
use crate::error::ProblemError;
use crate::file::{
    Calibration, Deviation, Hold, Holds, Initial, Measured, Noise, Per, Prior, ProblemFile,
    Quantity, Set,
};
use crate::interval::{ALL, Interval, intervals, shared};
use crate::joint::{Joint, unknown};
use crate::names::{Named, Of, matching};
use crate::posed::{Stands, State, Told};
use crate::stability;
use crate::unknowns::{Meaning, Parameters, Unknown, check_range};
use pilotage_collocation::{Bound, BoundAt, Loss, ParameterConstraints, Recording, Run};
use pilotage_expression::{Function, Graph, Node, System};
use pilotage_language::file::Formula;
use std::collections::HashMap;

/// Where an input of the equations comes from.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Key {
    /// A column that drives an input.
    Fed(String),
    /// A column in an expression.
    Column(String),
    /// A parameter that runs set: its number, 0 where it is an expression.
    Value(String, Span),
    /// Whether a parameter that runs set is that expression; without one, what it is elsewhere.
    Case(String, Option<String>, Span),
    /// Whether a run is of that subject.
    Subject(String),
    /// What was recorded, by the number of the measured signal.
    Recorded(usize),
    /// Whether there was something, by the same.
    Presence(usize),
    /// A noise level, by the same.
    Deviation(usize),
}

/// Of what a value that runs set is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Span {
    /// All of the run.
    Run,
    /// Its begin alone, for initial states.
    Begin,
}

/// A problem as equations, before it is differentiated.
pub struct Made {
    pub system: System,
    /// The terms of the objective that come from recordings.
    pub measured: Vec<Node>,
    pub bounds: Vec<Bound>,
    pub constraints: ParameterConstraints,
    pub runs: Vec<Run>,
    pub unknowns: Vec<(Unknown, Stands)>,
    pub shared: usize,
    pub states: Vec<State>,
    pub told: Told,
    /// States that are measured as they are, each with the number of its measured signal.
    pub followed: Vec<(usize, usize)>,
}

/// What is collected on the way.
pub struct Assembly<'a> {
    file: &'a ProblemFile,
    joint: &'a Joint,
    parameters: &'a Parameters,
    named: &'a Named,
    data: &'a [RunData<'a>],
    graph: Graph,
    sources: Vec<(Key, Source)>,
    stands: Vec<Stands>,
    /// Numbers of states and shared parameters.
    states: usize,
    shared: usize,
    /// Nodes of the parameters that are not tied, and of those that are.
    values: [HashMap<String, Node>; 2],
    /// Outputs of the joint model.
    outputs: Vec<Node>,
    /// Its states as the first run begins, where unknowns are at their starts.
    begins: Vec<f64>,
    recordings: Vec<Measurement>,
    bounded: Vec<(Node, Bound)>,
}

/// A term of the objective.
struct Measurement {
    output: Node,
    loss: Loss,
    /// For each run, the values of its samples; NaN where there is no term.
    values: Vec<Vec<f64>>,
    /// Beside the weight of the run, unless it counts for itself.
    weight: f64,
    is_prior: bool,
}

/// For each run, the initial value of each state that is known.
type Known = Vec<Vec<Option<f64>>>;

type Done<T> = Result<T, ProblemError>;

impl<'a> Assembly<'a> {
    /// Finds what is a state, an input, a shared parameter.
    pub fn new(
        file: &'a ProblemFile,
        joint: &'a Joint,
        parameters: &'a Parameters,
        named: &'a Named,
        data: &'a [RunData<'a>],
    ) -> Done<Self> {
        let mut own = Self {
            file,
            joint,
            parameters,
            named,
            data,
            graph: Graph::default(),
            sources: Vec::new(),
            stands: Vec::new(),
            states: joint.model.states.len(),
            shared: 0,
            values: [HashMap::new(), HashMap::new()],
            outputs: Vec::new(),
            begins: Vec::new(),
            recordings: Vec::new(),
            bounded: Vec::new(),
        };
        own.find_columns()?;
        own.find_sets()?;
        own.find_unknowns()?;
        Ok(own)
    }

    fn find_columns(&mut self) -> Done<()> {
        for fed in &self.file.inputs {
            let name = &fed.signal.value;
            if !self.joint.model.inputs.contains(name) {
                let fault = match self.joint.driven.contains_key(name) {
                    true => {
                        format!("`{name}` is driven by a wire; leave the wire or the column out")
                    }
                    false => unknown("free input", name, &self.joint.model.inputs),
                };
                return Err(ProblemError::maybe_at(fed.signal.place.as_ref(), fault));
            }
            let source = Source::Column {
                name: fed.column.clone(),
                unit: self.joint.unit(name).map(str::to_owned),
                hold: fed.hold,
                missing: None,
            };
            self.sources.push((Key::Fed(name.clone()), source));
        }
        for name in &self.named.columns {
            let source = Source::Column {
                name: name.clone(),
                unit: None,
                hold: Hold::Linear,
                missing: None,
            };
            self.sources.push((Key::Column(name.value.clone()), source));
        }
        for (k, measured) in self.file.measured.iter().enumerate() {
            let unit = self.unit_of(measured);
            if self.is_scaled(k) {
                let source = Source::Column {
                    name: measured.column.clone(),
                    unit: unit.clone(),
                    hold: Hold::Linear,
                    missing: Some(1.0),
                };
                self.sources.push((Key::Recorded(k), source));
                let source = Source::Presence(measured.column.clone());
                self.sources.push((Key::Presence(k), source));
            }
            if let Deviation::Column(name) = &measured.sd {
                let source = Source::Column {
                    name: name.clone(),
                    unit,
                    hold: Hold::Linear,
                    missing: Some(1.0),
                };
                self.sources.push((Key::Deviation(k), source));
            }
        }
        Ok(())
    }

    /// Name of the unit of what was measured.
    fn unit_of(&self, measured: &Measured) -> Option<String> {
        match &measured.of {
            Quantity::Signal(name) => self.joint.unit(name).map(str::to_owned),
            Quantity::Expression(_, unit) => unit.clone(),
        }
    }

    /// Whether the residual is divided by the noise level in the equations: unless that is a number.
    fn is_scaled(&self, k: usize) -> bool {
        let measured = &self.file.measured[k];
        let number = match &measured.sd {
            Deviation::Formula(formula) => formula.number(),
            Deviation::Column(_) => None,
        };
        number.is_none() || measured.noise != Noise::Normal
    }

    /// What runs set: inputs that are constant in each, or jump where it changes.
    fn find_sets(&mut self) -> Done<()> {
        let of_run = |run: &'a RunData<'a>| run.line.sets();
        let mut names: Vec<&String> = Vec::new();
        for set in self.data.iter().flat_map(of_run) {
            if !names.contains(&&set.name.value) {
                names.push(&set.name.value);
            }
        }
        for name in &names {
            for set in self
                .data
                .iter()
                .flat_map(of_run)
                .filter(|set| set.name.value == **name)
            {
                let mut taken = set.value.names();
                if let Some(other) = taken.find(|other| names.iter().any(|own| own == other)) {
                    let fault = format!("`{other}` is set by runs itself; write its value here");
                    return Err(ProblemError::maybe_at(set.name.place.as_ref(), fault));
                }
            }
            for span in [Span::Run, Span::Begin] {
                self.find_set(name, span);
            }
        }
        Ok(())
    }

    fn find_set(&mut self, name: &str, span: Span) {
        let timelines: Vec<Vec<(f64, Option<&Formula>)>> = self
            .data
            .iter()
            .map(|run| timeline(run, name, span))
            .collect();
        let base = match self.parameters.meanings[name] {
            Meaning::Number(value) => Some(value),
            _ => None,
        };
        let number = |formula: Option<&Formula>| match formula {
            Some(formula) => formula.number().unwrap_or(0.0),
            None => base.unwrap_or(0.0),
        };
        let given = |of: &dyn Fn(Option<&Formula>) -> f64| {
            let run = |line: &Vec<(f64, Option<&Formula>)>| {
                line.iter()
                    .map(|(time, formula)| (*time, of(*formula)))
                    .collect()
            };
            Source::Given(timelines.iter().map(run).collect())
        };
        let key = Key::Value(name.to_owned(), span);
        self.sources.push((key, given(&number)));
        let mut cases: Vec<Option<String>> = Vec::new();
        for (_, formula) in timelines.iter().flatten() {
            let case = formula.map(|formula| formula.expression.text.clone());
            let is_number = match formula {
                Some(formula) => formula.number().is_some(),
                None => base.is_some(),
            };
            if !is_number && !cases.contains(&case) {
                cases.push(case);
            }
        }
        for case in cases {
            let is_case = |formula: Option<&Formula>| {
                f64::from(formula.map(|formula| &formula.expression.text) == case.as_ref())
            };
            let key = Key::Case(name.to_owned(), case.clone(), span);
            self.sources.push((key, given(&is_case)));
        }
    }

    /// Where each unknown stands.
    fn find_unknowns(&mut self) -> Done<()> {
        for unknown in &self.parameters.unknowns {
            let per = match self.data.len() {
                1 => Per::All,
                _ => unknown.per,
            };
            let stands = match per {
                Per::All => {
                    self.shared += 1;
                    Stands::Shared(self.shared - 1)
                }
                Per::Run => {
                    self.states += 1;
                    Stands::State(self.states - 1)
                }
                Per::Subject => Stands::Subjects(self.find_subjects(&unknown.name)?),
            };
            self.stands.push(stands);
        }
        Ok(())
    }

    /// A parameter for each subject.
    fn find_subjects(&mut self, name: &str) -> Done<Vec<(String, usize)>> {
        let mut subjects: Vec<(String, usize)> = Vec::new();
        for run in self.data {
            let Some(subject) = &run.line.subject else {
                let fault = format!(
                    "`{name}` has one value for each subject, and this run has none; write subject = \"...\""
                );
                return Err(ProblemError::at(&run.line.place, fault));
            };
            if subjects.iter().all(|(own, _)| own != subject) {
                subjects.push((subject.clone(), self.shared));
                self.shared += 1;
            }
        }
        for (subject, _) in &subjects {
            let key = Key::Subject(subject.clone());
            if self.input(&key).is_some() {
                continue;
            }
            let is_own = |run: &RunData<'_>| f64::from(run.line.subject.as_ref() == Some(subject));
            let values = self
                .data
                .iter()
                .map(|run| vec![(f64::NEG_INFINITY, is_own(run))]);
            self.sources.push((key, Source::Given(values.collect())));
        }
        Ok(subjects)
    }

    fn input(&self, key: &Key) -> Option<usize> {
        self.sources.iter().position(|(own, _)| own == key)
    }

    /// The variable of an input.
    fn input_node(&mut self, key: &Key) -> Option<Node> {
        let input = self.input(key)?;
        Some(self.graph.variable(1 + self.states + input))
    }

    fn theta(&mut self, k: usize) -> Node {
        self.graph
            .variable(1 + self.states + self.sources.len() + k)
    }

    fn variables(&self) -> usize {
        1 + self.states + self.sources.len() + self.shared
    }

    /// The equations.
    pub fn finish(mut self) -> Done<Made> {
        // All variables stand in the graph, in their order.
        (0..self.variables()).for_each(|k| {
            self.graph.variable(k);
        });
        let sources: Vec<Source> = self
            .sources
            .iter()
            .map(|(_, source)| source.clone())
            .collect();
        let rows = self.data.iter().enumerate();
        let rows: Vec<Rows> = rows
            .map(|(k, run)| run.rows(k, &sources))
            .collect::<Done<_>>()?;
        for (k, span) in [(0, Span::Run), (1, Span::Begin)] {
            self.values[k] = self.parameter_nodes(span);
        }
        let (states, known) = self.initial_states(&rows)?;
        let zero = self.graph.constant(0.0);
        let joint_states = self.joint.model.states.len();
        let x: Vec<Node> = (0..joint_states)
            .map(|k| {
                let variable = self.graph.variable(1 + k);
                match states[k].shift {
                    Some(shift) => self.graph.add(variable, shift),
                    None => variable,
                }
            })
            .collect();
        let variables = self.joint_variables(&x);
        let system = &self.joint.model.system;
        let mut derivatives = self
            .graph
            .import(&system.graph, &system.derivatives, &variables);
        derivatives.resize(self.states, zero);
        self.outputs = self
            .graph
            .import(&system.graph, &system.outputs, &variables);
        let signals: Vec<Node> = (self.named.signals.iter())
            .map(|name| self.joint.signal(name).expect("a signal of its own"))
            .collect();
        let signals = self.graph.import(&system.graph, &signals, &variables);
        let mut told = self.measure(&signals, &rows)?;
        told.joint = variables;
        self.check_tied(&told, &rows)?;
        self.limit();
        self.hold_steady(&derivatives);
        let on_parameters = self.bound_all(&signals, &rows)?;
        self.expect_priors(&rows);
        let constraints = self.parameter_constraints(on_parameters, &rows)?;
        Ok(self.made(derivatives, states, known, rows, told, constraints))
    }

    /// What the variables of the joint model are.
    fn joint_variables(&mut self, x: &[Node]) -> Vec<Node> {
        let joint = &self.joint.model;
        let mut variables = vec![self.graph.variable(0)];
        variables.extend_from_slice(x);
        for name in &joint.inputs {
            let node = self.input_node(&Key::Fed(name.clone()));
            variables.push(node.unwrap_or_else(|| self.values[0][name]));
        }
        variables.extend(joint.parameters.iter().map(|name| self.values[0][name]));
        variables
    }

    fn made(
        mut self,
        derivatives: Vec<Node>,
        states: Vec<State>,
        known: Known,
        rows: Vec<Rows>,
        told: Told,
        constraints: ParameterConstraints,
    ) -> Made {
        let outputs = self.recordings.iter().map(|own| own.output);
        let outputs = outputs
            .chain(self.bounded.iter().map(|(node, _)| *node))
            .collect();
        let runs = rows
            .into_iter()
            .zip(known)
            .enumerate()
            .map(|(j, (rows, initial))| {
                let measured = self.recordings.iter().map(|own| Recording {
                    values: own.values[j].clone(),
                    weight: match own.is_prior {
                        true => own.weight,
                        false => own.weight * self.data[j].line.weight,
                    },
                    loss: own.loss,
                });
                let mut mesh = rows.time.clone();
                mesh.dedup();
                Run {
                    mesh,
                    time: rows.time,
                    inputs: rows.inputs,
                    measured: measured.collect(),
                    initial,
                }
            });
        let runs: Vec<Run> = runs.collect();
        let unknowns = self
            .parameters
            .unknowns
            .iter()
            .cloned()
            .zip(std::mem::take(&mut self.stands));
        let measured = self.recordings.iter().filter(|own| !own.is_prior);
        Made {
            measured: measured.map(|own| own.output).collect(),
            followed: self.measured_states(&states),
            system: System {
                graph: self.graph,
                states: self.states,
                inputs: self.sources.len(),
                parameters: self.shared,
                derivatives,
                outputs,
            },
            bounds: self.bounded.iter().map(|(_, bound)| *bound).collect(),
            constraints,
            runs,
            unknowns: unknowns.collect(),
            shared: self.shared,
            states,
            told,
        }
    }

    // Parameters.

    /// The node of each parameter.
    fn parameter_nodes(&mut self, span: Span) -> HashMap<String, Node> {
        let mut nodes = HashMap::new();
        let parameters = self.parameters;
        for name in &parameters.names {
            let node = match &parameters.meanings[name] {
                Meaning::Number(value) => self.graph.constant(*value),
                Meaning::Unknown(k) => self.unknown_node(*k),
                Meaning::Tied(_) => continue,
            };
            nodes.insert(name.clone(), node);
        }
        let plain = nodes.clone();
        for name in &parameters.names {
            let Some(mut sum) = self.input_node(&Key::Value(name.clone(), span)) else {
                continue;
            };
            let cases: Vec<(Key, Option<String>)> = (self.sources.iter())
                .filter_map(|(key, _)| match key {
                    Key::Case(own, case, at) if own == name && *at == span => {
                        Some((key.clone(), case.clone()))
                    }
                    _ => None,
                })
                .collect();
            for (key, case) in cases {
                let value = match case {
                    None => plain[name],
                    Some(text) => self.expressions(&[Of::Set(name.clone(), text)], None, &plain)[0],
                };
                let is_case = self.input_node(&key).expect("it was found");
                let part = self.graph.multiply(is_case, value);
                sum = self.graph.add(sum, part);
            }
            nodes.insert(name.clone(), sum);
        }
        let tied: Vec<String> = (parameters.names.iter())
            .filter(|name| matches!(parameters.meanings[*name], Meaning::Tied(_)))
            .cloned()
            .collect();
        let of: Vec<Of> = tied.iter().cloned().map(Of::Tied).collect();
        let found = self.expressions(&of, None, &nodes);
        nodes.extend(tied.into_iter().zip(found));
        nodes
    }

    fn unknown_node(&mut self, k: usize) -> Node {
        let log = self.parameters.unknowns[k].log;
        let plain = |graph: &mut Graph, variable: Node| match log {
            true => graph.unary(Function::Exp, variable),
            false => variable,
        };
        match self.stands[k].clone() {
            Stands::Shared(theta) => {
                let variable = self.theta(theta);
                plain(&mut self.graph, variable)
            }
            Stands::State(state) => {
                let variable = self.graph.variable(1 + state);
                plain(&mut self.graph, variable)
            }
            Stands::Subjects(subjects) => {
                let mut sum = self.graph.constant(0.0);
                for (subject, theta) in subjects {
                    let variable = self.theta(theta);
                    let value = plain(&mut self.graph, variable);
                    let is_own = self
                        .input_node(&Key::Subject(subject))
                        .expect("it was found");
                    let part = self.graph.multiply(is_own, value);
                    sum = self.graph.add(sum, part);
                }
                sum
            }
        }
    }

    /// Expressions of the file over signals and parameters.
    fn expressions(
        &mut self,
        of: &[Of],
        signals: Option<(&[Node], Node)>,
        parameters: &HashMap<String, Node>,
    ) -> Vec<Node> {
        let named = self.named;
        let zero = self.graph.constant(0.0);
        let mut variables = vec![self.graph.variable(0)];
        match signals {
            Some((signals, predicted)) => {
                variables.extend_from_slice(signals);
                for name in &named.columns {
                    let node = self.input_node(&Key::Column(name.value.clone()));
                    variables.push(node.unwrap_or(zero));
                }
                variables.push(predicted);
            }
            None => variables.resize(2 + named.signals.len() + named.columns.len(), zero),
        }
        let values = named
            .parameters
            .iter()
            .map(|name| parameters.get(name).copied());
        variables.extend(values.map(|node| node.unwrap_or(zero)));
        let compiled = &named.compiled;
        let nodes = of
            .iter()
            .map(|of| named.place(of).map(|place| compiled.nodes[place]));
        let nodes: Vec<Node> = nodes.map(|node| node.expect("it was compiled")).collect();
        self.graph.import(&compiled.graph, &nodes, &variables)
    }

    /// Refuses parameters that are tied to a value out of their range, where the search begins.
    fn check_tied(&self, told: &Told, rows: &[Rows]) -> Done<()> {
        for (name, node) in &told.tied {
            let range = self.parameters.range(name, self.joint);
            let line = self
                .file
                .parameters
                .iter()
                .find(|line| line.name.value == *name);
            let place = line.and_then(|line| line.name.place.as_ref());
            for rows in rows {
                check_range(name, self.number(*node, rows), range, place)?;
            }
        }
        Ok(())
    }

    /// Refuses noise levels that are not above 0: where they are recorded, or, if neither states nor time change them, at
    /// the start.
    fn check_deviation(
        &self,
        k: usize,
        node: Node,
        recorded: &[Vec<f64>],
        rows: &[Rows],
    ) -> Done<()> {
        let measured = &self.file.measured[k];
        match &measured.sd {
            Deviation::Column(name) => {
                let unit = self.unit_of(measured);
                for ((run, rows), recorded) in self.data.iter().zip(rows).zip(recorded) {
                    let column = run.column(name, unit.as_deref())?;
                    for (sample, row) in rows.rows.iter().enumerate() {
                        let Some(sd) = row.map(|row| column[row]) else {
                            continue;
                        };
                        if recorded[sample].is_finite() && (sd.is_nan() || sd <= 0.0) {
                            let fault = format!(
                                "{}: the column `{}` is {sd} at {} s; a standard deviation is above 0",
                                run.line.file.display(),
                                name.value,
                                rows.time[sample]
                            );
                            return Err(ProblemError::maybe_at(name.place.as_ref(), fault));
                        }
                    }
                }
                Ok(())
            }
            Deviation::Formula(formula) => {
                let changes = self
                    .graph
                    .dependants(|variable| variable <= self.joint.model.states.len());
                let start = self.number(node, &rows[0]);
                match changes[node.index()] || start > 0.0 {
                    true => Ok(()),
                    false => {
                        let fault = format!(
                            "the standard deviation starts at {start}; expected a number above 0"
                        );
                        Err(ProblemError::at(&self.file.place(formula), fault))
                    }
                }
            }
        }
    }

    /// Refuses constraints that nothing within the ranges of what is sought and recorded fulfils.
    fn check_constraints(&self, nodes: &[Node], rows: &[Rows]) -> Done<()> {
        let mut found = intervals(&self.graph, &self.ranges(rows));
        for (line, node) in self.file.constraints.iter().zip(nodes) {
            if line.formula.names().next().is_none() {
                let fault = "a constraint on a number, which nothing changes; leave it out";
                return Err(ProblemError::at(&line.place, fault));
            }
            let own = &mut found[node.index()];
            let [low, high] = *own;
            *own = shared(*own, [line.min, line.max]).ok_or_else(|| {
                let shown = &line.formula.expression.text;
                let fault = match low == high {
                    true => format!("`{shown}` is always {low}, never from {} to {}; change one of them", line.min, line.max),
                    false => format!(
                        "`{shown}` is from {low} to {high} by what else is said, never from {} to {}; change one of them",
                        line.min, line.max
                    ),
                };
                ProblemError::at(&line.place, fault)
            })?;
        }
        Ok(())
    }

    /// Between which values each variable of the equations lies.
    fn ranges(&self, rows: &[Rows]) -> Vec<Interval> {
        let mut ranges = vec![ALL; self.variables()];
        let sources = 1 + self.states;
        for k in 0..self.sources.len() {
            let values = || {
                rows.iter()
                    .flat_map(|rows| rows.inputs.iter().map(|own| own[k]))
            };
            ranges[sources + k] = [
                values().fold(f64::INFINITY, f64::min),
                values().fold(f64::NEG_INFINITY, f64::max),
            ];
        }
        let shared = self.variables() - self.shared;
        for (unknown, stands) in self.parameters.unknowns.iter().zip(&self.stands) {
            let low = unknown.min.map_or(ALL[0], |min| unknown.searched(min));
            let high = unknown.max.map_or(ALL[1], |max| unknown.searched(max));
            for variable in stands.variables(shared) {
                ranges[variable] = [low, high];
            }
        }
        ranges
    }

    // Initial states.

    /// The states, and for each run what is known of their initial values.
    fn initial_states(&mut self, rows: &[Rows]) -> Done<(Vec<State>, Known)> {
        let runs = rows.len();
        let (mut states, mut known) = (Vec::new(), vec![Vec::new(); runs]);
        let starts = self.start_nodes();
        for (k, name) in self.joint.model.states.iter().enumerate() {
            let about = self.joint.variables.get(name);
            let line = self.initial_line(name);
            let node = match line.map(|line| (line, &self.file.initial[line].1)) {
                Some((line, Initial::Formula(_))) => {
                    let values = self.values[1].clone();
                    self.expressions(&[Of::Initial(line, name.clone())], None, &values)[0]
                }
                _ => starts[k],
            };
            let depends = self.depends_on_sought(node);
            let numbers: Vec<f64> = rows.iter().map(|rows| self.number(node, rows)).collect();
            if let Some(number) = numbers.iter().find(|number| !number.is_finite()) {
                let place = line.and_then(|line| self.file.initial[line].0.place.as_ref());
                let fault = format!(
                    "`{name}` begins at {number} where the search starts; expected a finite number"
                );
                return Err(ProblemError::maybe_at(place, fault));
            }
            let mut state = State {
                name: name.clone(),
                nominal: about.and_then(|about| about.nominal),
                guesses: numbers.clone(),
                shift: None,
            };
            let first = self.first_samples(name);
            let begin = match line.map(|line| &self.file.initial[line].1) {
                None | Some(Initial::Formula(_)) => numbers[0],
                Some(_) => first.as_ref().map_or(numbers[0], |first| first[0]),
            };
            self.begins.push(begin);
            match line.map(|line| &self.file.initial[line].1) {
                None | Some(Initial::Formula(_)) if depends => {
                    state.shift = Some(node);
                    state.guesses = vec![0.0; runs];
                    known.iter_mut().for_each(|own| own.push(Some(0.0)));
                }
                None | Some(Initial::Formula(_)) => {
                    for (own, number) in known.iter_mut().zip(&numbers) {
                        own.push(Some(*number));
                    }
                }
                Some(Initial::FirstSample) => {
                    let first = first.ok_or_else(|| {
                        let place = line.and_then(|line| self.file.initial[line].0.place.as_ref());
                        let fault = format!(
                            "`{name}` begins at its first sample, but no [[measured]] has signal = \"{name}\" without gain \
                             and offset"
                        );
                        ProblemError::maybe_at(place, fault)
                    })?;
                    for (own, first) in known.iter_mut().zip(first) {
                        own.push(Some(first));
                    }
                }
                Some(Initial::Free | Initial::Steady) => {
                    if let Some(first) = first {
                        state.guesses = first;
                    }
                    known.iter_mut().for_each(|own| own.push(None));
                }
            }
            states.push(state);
        }
        for (k, unknown) in self.parameters.unknowns.iter().enumerate() {
            if let Stands::State(_) = self.stands[k] {
                states.push(State {
                    name: unknown.name.clone(),
                    nominal: unknown.searched_nominal(),
                    guesses: vec![unknown.searched(unknown.start); runs],
                    shift: None,
                });
                known.iter_mut().for_each(|own| own.push(None));
            }
        }
        Ok((states, known))
    }

    /// The line of `[initial]` that is meant for a state: its own, else the last pattern.
    fn initial_line(&self, state: &str) -> Option<usize> {
        let lines = self.file.initial.iter().map(|(name, _)| &name.value);
        let own = lines.clone().position(|name| name == state);
        let state = [state.to_owned()];
        own.or_else(|| {
            lines
                .clone()
                .rposition(|name| !matching(name, &state).is_empty())
        })
    }

    /// The models' start values.
    fn start_nodes(&mut self) -> Vec<Node> {
        let joint = self.joint;
        let zero = self.graph.constant(0.0);
        let mut starts = Vec::new();
        for (instance, part) in &joint.parts {
            let system = &part.model.system;
            let mut variables = vec![zero; 1 + system.states + system.inputs];
            let own = part.model.parameters.iter();
            variables.extend(own.map(|name| self.values[1][&format!("{instance}.{name}")]));
            starts.extend(self.graph.import(&system.graph, &part.starts, &variables));
        }
        starts
    }

    fn depends_on_sought(&self, node: Node) -> bool {
        let inputs = 1 + self.states..1 + self.states + self.sources.len();
        let depends = self
            .graph
            .dependants(|variable| variable > 0 && !inputs.contains(&variable));
        depends[node.index()]
    }

    /// The value of an expression at the begin of a run, where unknowns are at their starts.
    fn number(&self, node: Node, rows: &Rows) -> f64 {
        self.graph.values(&self.begin_values(rows))[node.index()]
    }

    /// All variables at the begin of a run, where unknowns are at their starts and other states 0.
    fn begin_values(&self, rows: &Rows) -> Vec<f64> {
        let mut variables = vec![0.0; self.variables()];
        variables[0] = rows.time[0];
        variables[1 + self.states..][..self.sources.len()].copy_from_slice(&rows.inputs[0]);
        let shared = self.variables() - self.shared;
        for (unknown, stands) in self.parameters.unknowns.iter().zip(&self.stands) {
            let start = unknown.searched(unknown.start);
            match stands {
                Stands::Shared(k) => variables[shared + k] = start,
                Stands::State(k) => variables[1 + k] = start,
                Stands::Subjects(all) => {
                    all.iter().for_each(|(_, k)| variables[shared + k] = start)
                }
            }
        }
        variables
    }

    /// States and inputs of the joint model as the first run begins: where it is linearised.
    fn operating_point(&self, rows: &[Rows]) -> (Vec<f64>, Vec<f64>) {
        let values = self.graph.values(&self.begin_values(&rows[0]));
        let inputs =
            self.joint
                .model
                .inputs
                .iter()
                .map(|name| match self.input(&Key::Fed(name.clone())) {
                    Some(input) => rows[0].inputs[0][input],
                    None => values[self.values[0][name].index()],
                });
        (self.begins.clone(), inputs.collect())
    }

    /// The first measurement of a state in each run, where it is measured as it is.
    fn first_samples(&self, state: &str) -> Option<Vec<f64>> {
        let is_it = |own: &&Measured| self.measures(own, state);
        let measured = self.file.measured.iter().find(is_it)?;
        let unit = self.unit_of(measured);
        let first = |run: &RunData<'_>| {
            let values = run.column(&measured.column, unit.as_deref()).ok()?;
            values.into_iter().find(|value| value.is_finite())
        };
        self.data.iter().map(first).collect()
    }

    /// States that are measured as they are, each with the first measured signal that is.
    fn measured_states(&self, states: &[State]) -> Vec<(usize, usize)> {
        let names = self.joint.model.states.iter().enumerate();
        let plain = |k: usize| states[k].shift.is_none();
        let found = names.filter(|(k, _)| plain(*k)).filter_map(|(k, name)| {
            let is_it = |own: &Measured| self.measures(own, name);
            Some((k, self.file.measured.iter().position(is_it)?))
        });
        found.collect()
    }

    /// Whether a sensor shows a state as it is.
    fn measures(&self, measured: &Measured, state: &str) -> bool {
        matches!(&measured.of, Quantity::Signal(name) if self.is_state(name, state))
            && measured.is_plain()
    }

    /// Whether a signal is a state, by its name or as an output that is nothing else.
    fn is_state(&self, signal: &str, state: &str) -> bool {
        let node = |name: &str| self.joint.signal(name);
        signal == state || (node(signal).is_some() && node(signal) == node(state))
    }

    // What is measured and bounded.

    fn measure(&mut self, signals: &[Node], rows: &[Rows]) -> Done<Told> {
        let mut told = Told {
            predicted: Vec::new(),
            deviations: Vec::new(),
            joint: Vec::new(),
            tied: Vec::new(),
            recorded: Vec::new(),
        };
        for k in 0..self.file.measured.len() {
            let predicted = self.predicted(k, signals)?;
            let deviation = self.deviation(k, signals, predicted);
            let recorded = self.recorded(k, rows)?;
            self.check_deviation(k, deviation, &recorded, rows)?;
            self.add_residual(k, predicted, deviation, &recorded)?;
            told.predicted.push(predicted);
            told.deviations.push(deviation);
            told.recorded.push(recorded);
        }
        for name in &self.parameters.names {
            if let Meaning::Tied(_) = self.parameters.meanings[name] {
                told.tied.push((name.clone(), self.values[0][name]));
            }
        }
        Ok(told)
    }

    /// What a sensor should show.
    fn predicted(&mut self, k: usize, signals: &[Node]) -> Done<Node> {
        let measured = &self.file.measured[k];
        let zero = self.graph.constant(0.0);
        let values = self.values[0].clone();
        let plain = match &measured.of {
            Quantity::Signal(name) => {
                let place = self.named.signals.iter().position(|own| own == name);
                let place = place.ok_or_else(|| {
                    let fault = unknown("signal", name, &self.named.signals);
                    ProblemError::at(&measured.place, fault)
                })?;
                signals[place]
            }
            Quantity::Expression(..) => {
                self.expressions(&[Of::Measured(k)], Some((signals, zero)), &values)[0]
            }
        };
        let mut sensor = |what: &str, of: Of, calibration: &Calibration| match calibration {
            Calibration::Formula(_) => self.expressions(&[of], Some((signals, zero)), &values)[0],
            Calibration::Sought(_) => {
                values[&crate::unknowns::calibration(what, &measured.column.value)]
            }
        };
        let gain = sensor("gain", Of::Gain(k), &measured.gain);
        let offset = sensor("offset", Of::Offset(k), &measured.offset);
        let scaled = self.graph.multiply(gain, plain);
        Ok(self.graph.add(scaled, offset))
    }

    fn deviation(&mut self, k: usize, signals: &[Node], predicted: Node) -> Node {
        let values = self.values[0].clone();
        match &self.file.measured[k].sd {
            Deviation::Formula(_) => {
                self.expressions(&[Of::Deviation(k)], Some((signals, predicted)), &values)[0]
            }
            Deviation::Column(_) => self.input_node(&Key::Deviation(k)).expect("it was found"),
        }
    }

    /// The recorded values of each run's samples.
    fn recorded(&self, k: usize, rows: &[Rows]) -> Done<Vec<Vec<f64>>> {
        let measured = &self.file.measured[k];
        let unit = self.unit_of(measured);
        let mut all = Vec::new();
        for (run, rows) in self.data.iter().zip(rows) {
            let column = run.column(&measured.column, unit.as_deref())?;
            let value = |row: &Option<usize>| row.map_or(f64::NAN, |row| column[row]);
            let values: Vec<f64> = rows.rows.iter().map(value).collect();
            if let Some(sample) = values
                .iter()
                .position(|value| *value <= 0.0)
                .filter(|_| measured.noise == Noise::LogNormal)
            {
                let fault = format!(
                    "{}: the column `{}` is {} at {} s, and log-normal noise has values above 0",
                    run.line.file.display(),
                    measured.column.value,
                    values[sample],
                    rows.time[sample]
                );
                return Err(ProblemError::maybe_at(
                    measured.column.place.as_ref(),
                    fault,
                ));
            }
            all.push(values);
        }
        match all.iter().flatten().any(|value| value.is_finite()) {
            true => Ok(all),
            false => {
                let fault = format!(
                    "the column `{}` has no number in any run",
                    measured.column.value
                );
                Err(ProblemError::maybe_at(
                    measured.column.place.as_ref(),
                    fault,
                ))
            }
        }
    }

    fn add_residual(
        &mut self,
        k: usize,
        predicted: Node,
        deviation: Node,
        recorded: &[Vec<f64>],
    ) -> Done<()> {
        let noise = self.file.measured[k].noise;
        if let (false, Some(sd)) = (self.is_scaled(k), self.graph.value(deviation)) {
            self.recordings.push(Measurement {
                output: predicted,
                loss: Loss::Square,
                values: recorded.to_vec(),
                weight: sd.powi(-2),
                is_prior: false,
            });
            return Ok(());
        }
        let mut seen = self.input_node(&Key::Recorded(k)).expect("it was found");
        // Where nothing was recorded both may be zero, and an infinite residual is no missing one.
        let is_there = self.input_node(&Key::Presence(k)).expect("it was found");
        let one = self.graph.constant(1.0);
        let mut expected = self.graph.select(is_there, predicted, one);
        let deviation = self.graph.select(is_there, deviation, one);
        if noise == Noise::LogNormal {
            seen = self.graph.unary(Function::Ln, seen);
            expected = self.graph.unary(Function::Ln, expected);
        }
        let difference = self.graph.subtract(expected, seen);
        let output = self.graph.divide(difference, deviation);
        let there = |own: &Vec<f64>| -> Vec<f64> {
            own.iter()
                .map(|value| if value.is_finite() { 0.0 } else { f64::NAN })
                .collect()
        };
        let values: Vec<Vec<f64>> = recorded.iter().map(there).collect();
        let loss = match noise {
            Noise::Normal | Noise::LogNormal => Loss::Square,
            Noise::Laplace => Loss::Absolute {
                smoothing: LAPLACE_SMOOTHING,
            },
            Noise::Student(dof) => Loss::Student { dof },
        };
        let term = |output, loss| Measurement {
            output,
            loss,
            values: values.clone(),
            weight: 1.0,
            is_prior: false,
        };
        self.recordings.push(term(output, loss));
        if self.depends_on_variables(deviation) {
            let log = self.graph.unary(Function::Ln, deviation);
            let twice = self.graph.scale(2.0, log);
            self.recordings.push(term(twice, Loss::Linear));
        }
        Ok(())
    }

    /// Whether a noise level depends on more than recorded columns.
    fn depends_on_variables(&self, node: Node) -> bool {
        let inputs = 1 + self.states..1 + self.states + self.sources.len();
        let depends = self
            .graph
            .dependants(|variable| !inputs.contains(&variable));
        depends[node.index()]
    }

    fn bound(&mut self, node: Node, lower: f64, upper: f64, at: BoundAt) {
        if self.graph.value(node).is_none() && (lower > f64::NEG_INFINITY || upper < f64::INFINITY)
        {
            self.bounded.push((node, Bound { lower, upper, at }));
        }
    }

    /// Limits of outputs hold at every sample.
    fn limit(&mut self) {
        let joint = self.joint;
        let mut first = 0;
        let zero = self.graph.constant(0.0);
        for (instance, part) in &joint.parts {
            let system = &part.model.system;
            let mut variables = vec![zero; 1 + system.states + system.inputs];
            let own = part.model.parameters.iter();
            variables.extend(own.map(|name| self.values[0][&format!("{instance}.{name}")]));
            for (k, limit) in part.limits.iter().enumerate() {
                let Some(limit) = limit else { continue };
                let [low, high]: [Node; 2] = self
                    .graph
                    .import(&system.graph, limit, &variables)
                    .try_into()
                    .expect("two for two");
                let output = self.outputs[first + k];
                match (self.graph.value(low), self.graph.value(high)) {
                    (Some(low), Some(high)) => self.bound(output, low, high, BoundAt::Samples),
                    _ => {
                        let above = self.graph.subtract(output, low);
                        let below = self.graph.subtract(high, output);
                        self.bound(above, 0.0, f64::INFINITY, BoundAt::Samples);
                        self.bound(below, 0.0, f64::INFINITY, BoundAt::Samples);
                    }
                }
            }
            first += part.model.outputs.len();
        }
    }

    /// States at rest at the start.
    fn hold_steady(&mut self, derivatives: &[Node]) {
        for (k, name) in self.joint.model.states.iter().enumerate() {
            let line = self
                .initial_line(name)
                .map(|line| &self.file.initial[line].1);
            if let Some(Initial::Steady) = line {
                self.bound(derivatives[k], 0.0, 0.0, BoundAt::Start);
            }
        }
    }

    /// Ranges of what is sought, and the file's constraints. Those on shared parameters alone are returned: each
    /// expression is at least zero.
    fn bound_all(&mut self, signals: &[Node], rows: &[Rows]) -> Done<Vec<Node>> {
        let mut on_parameters = Vec::new();
        for k in 0..self.parameters.unknowns.len() {
            let unknown = &self.parameters.unknowns[k];
            let ends = [unknown.min, unknown.max].map(|end| end.map(|end| unknown.searched(end)));
            let [low, high] = [
                ends[0].unwrap_or(f64::NEG_INFINITY),
                ends[1].unwrap_or(f64::INFINITY),
            ];
            match self.stands[k].clone() {
                Stands::State(state) => {
                    let variable = self.graph.variable(1 + state);
                    self.bound(variable, low, high, BoundAt::Start);
                }
                Stands::Shared(theta) => {
                    let variable = self.theta(theta);
                    on_parameters.extend(self.within(variable, low, high));
                }
                Stands::Subjects(subjects) => {
                    for (_, theta) in subjects {
                        let variable = self.theta(theta);
                        on_parameters.extend(self.within(variable, low, high));
                    }
                }
            }
        }
        let zero = self.graph.constant(0.0);
        let values = self.values[0].clone();
        let all: Vec<Of> = (0..self.file.constraints.len())
            .map(Of::Constraint)
            .collect();
        let nodes = self.expressions(&all, Some((signals, zero)), &values);
        self.check_constraints(&nodes, rows)?;
        for (line, node) in self.file.constraints.iter().zip(nodes) {
            let at = match line.at {
                Holds::Samples => BoundAt::Samples,
                Holds::Start => BoundAt::Start,
                Holds::End => BoundAt::End,
                Holds::Parameters if self.is_shared(node) => {
                    on_parameters.extend(self.within(node, line.min, line.max));
                    continue;
                }
                Holds::Parameters => BoundAt::Start,
            };
            self.bound(node, line.min, line.max, at);
        }
        Ok(on_parameters)
    }

    /// Whether an expression depends on shared parameters alone.
    fn is_shared(&self, node: Node) -> bool {
        let shared = 1 + self.states + self.sources.len();
        let depends = self.graph.dependants(|variable| variable < shared);
        !depends[node.index()]
    }

    /// `x - low` and `high - x`, where there are such ends.
    fn within(&mut self, node: Node, low: f64, high: f64) -> Vec<Node> {
        let mut found = Vec::new();
        for (sign, end) in [(1.0, low), (-1.0, high)] {
            if end.is_finite() {
                let end = self.graph.constant(end);
                let above = self.graph.subtract(node, end);
                found.push(self.graph.scale(sign, above));
            }
        }
        found
    }

    /// Residuals of what is known beforehand, once for each value.
    fn expect_priors(&mut self, rows: &[Rows]) {
        for k in 0..self.parameters.unknowns.len() {
            let unknown = self.parameters.unknowns[k].clone();
            let Some(prior) = unknown.prior else { continue };
            let (variables, in_each): (Vec<Node>, bool) = match self.stands[k].clone() {
                Stands::Shared(theta) => (vec![self.theta(theta)], false),
                Stands::State(state) => (vec![self.graph.variable(1 + state)], true),
                Stands::Subjects(all) => (
                    all.into_iter()
                        .map(|(_, theta)| self.theta(theta))
                        .collect(),
                    false,
                ),
            };
            for variable in variables {
                let output = match (unknown.log, prior.log) {
                    (true, false) => self.graph.unary(Function::Exp, variable),
                    (false, true) => self.graph.unary(Function::Ln, variable),
                    _ => variable,
                };
                self.expect(output, prior, rows, in_each);
            }
        }
    }

    fn expect(&mut self, output: Node, prior: Prior, rows: &[Rows], in_each: bool) {
        let values = rows.iter().enumerate().map(|(j, rows)| {
            let mut values = vec![f64::NAN; rows.time.len()];
            if j == 0 || in_each {
                values[0] = prior.mean;
            }
            values
        });
        self.recordings.push(Measurement {
            output,
            loss: Loss::Square,
            values: values.collect(),
            weight: prior.sd.powi(-2),
            is_prior: true,
        });
    }

    /// Constraints on the shared parameters, stability among them.
    fn parameter_constraints(
        &mut self,
        mut on_parameters: Vec<Node>,
        rows: &[Rows],
    ) -> Done<ParameterConstraints> {
        let at = stability::Point {
            joint: self.joint,
            file: self.file,
            values: &self.values[0].clone(),
            initial: &self.operating_point(rows),
        };
        on_parameters.extend(stability::conditions(&mut self.graph, &at)?);
        // Over the shared parameters alone; runs' own values and numbers are as the first run begins.
        let mut graph = Graph::default();
        let begin = self.begin_values(&rows[0]);
        let shared = self.variables() - self.shared;
        let variables: Vec<Node> = (0..self.variables())
            .map(|k| match k.checked_sub(shared) {
                Some(theta) => graph.variable(theta),
                None => graph.constant(begin[k]),
            })
            .collect();
        let nodes = graph.import(&self.graph, &on_parameters, &variables);
        Ok(ParameterConstraints::of(&graph, self.shared, &nodes))
    }
}

impl Unknown {
    /// What the search sees of a value.
    pub fn searched(&self, value: f64) -> f64 {
        match self.log {
            true => value.ln(),
            false => value,
        }
    }

    /// The value of what the search has found.
    pub fn found(&self, searched: f64) -> f64 {
        match self.log {
            true => searched.exp(),
            false => searched,
        }
    }

    /// Typical magnitude of what the search sees.
    pub fn searched_nominal(&self) -> Option<f64> {
        match self.log {
            true => Some(1.0),
            false => self
                .nominal
                .or(Some(self.start.abs()))
                .filter(|size| *size > 0.0),
        }
    }
}

impl Measured {
    /// Whether the sensor shows what it measures.
    fn is_plain(&self) -> bool {
        let is = |calibration: &Calibration, value: f64| matches!(calibration, Calibration::Formula(formula) if formula.number() == Some(value));
        is(&self.gain, 1.0) && is(&self.offset, 0.0)
    }
}

/// Where the absolute value of Laplace's noise is rounded off, in standard deviations.
pub const LAPLACE_SMOOTHING: f64 = 1e-3;

/// From when on a parameter has which value in a run; none for what it has else.
fn timeline<'r>(run: &'r RunData<'_>, name: &str, span: Span) -> Vec<(f64, Option<&'r Formula>)> {
    let find = |set: &'r [Set]| {
        set.iter()
            .find(|set| set.name.value == name)
            .map(|set| &set.value)
    };
    let mut line = vec![(f64::NEG_INFINITY, find(&run.line.set))];
    if span == Span::Run {
        let changes = run.line.changes.iter();
        line.extend(changes.filter_map(|change| Some((change.time, Some(find(&change.set)?)))));
    }
    line
}
