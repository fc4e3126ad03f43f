//! A problem file as a program: one system of equations, with the controls among its states.

use crate::program::{Control, Duration, Limits, Program, Shape};
use pilotage_collocation::node::{NodeModel, Scales};
use pilotage_collocation::{Differentiated, Run, Steps};
use pilotage_estimation::ProblemError;
use pilotage_estimation::posed::unknowns::{Meaning, Parameters};
use pilotage_estimation::posed::{Open, opened};
use pilotage_estimation::problem::control::{First, Optimal, PartOf};
use pilotage_estimation::problem::file::{
    Holds, Initial, Limits as OfOutputs, ProblemFile, matching,
};
use pilotage_estimation::system::joint::{Joint, unknown};
use pilotage_expression::{Function, Graph, Node, Operation, Operator, System};
use pilotage_language::Expressions;
use pilotage_language::file::Formula;
use pilotage_text::document::Place;
use std::collections::HashMap;
use std::sync::Arc;

/// A variable: a state, a control or a parameter.
#[derive(Debug, Clone)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Name of its unit, if it has one.
    pub unit: Option<String>,
    /// Typical magnitude.
    pub scale: f64,
    /// First and last value where the search begins; of a parameter its start, twice.
    pub guess: [f64; 2],
    /// Its limits: of a control, a parameter.
    pub limits: Limits,
}

/// A limited quantity.
#[derive(Debug, Clone)]
pub struct Limited {
    /// What is limited, in the words of the file.
    pub name: String,
    /// Where the file says so.
    pub place: Option<Place>,
    /// Its limits, in its unit.
    pub limits: Limits,
    /// Its magnitude, by which it is divided.
    pub size: f64,
}

/// A problem of optimal control, ready to be discretised.
#[derive(Debug)]
pub struct Posed {
    /// States, with those that integrate parts of the objective at their end.
    pub states: Vec<Variable>,
    /// Controls.
    pub controls: Vec<Variable>,
    /// Parameters that are sought: those of the problem, the duration, initial values in the objective, and the bound on
    /// all that is under a maximum.
    pub parameters: Vec<Variable>,
    /// Limited quantities along the path, at the start and at the end.
    pub limited: [Vec<Limited>; 3],
    /// The duration.
    pub duration: Duration,
    /// Whether the objective is maximised.
    pub is_maximised: bool,
    /// Number of intervals of the first mesh.
    pub intervals: usize,
    /// Initial states, where they are known.
    pub initial: Vec<Option<f64>>,
    /// Tolerance of the solver, and permitted local error of the states.
    pub tolerance: f64,
    /// Names, units and nodes of signals that are no states: for the trajectory.
    pub signals: Vec<(String, Option<String>)>,
    /// The equations: along the path, at the start, at the end.
    pub equations: [Arc<Differentiated>; 3],
    /// The same with all signals as outputs.
    pub shown: Arc<Differentiated>,
    /// Whether the search begins with a simulation.
    pub is_simulated: bool,
    of_controls: Vec<Control>,
    regularise: f64,
}

type Done<T> = Result<T, ProblemError>;

/// The variables of the graph: τ, states, controls, slopes of controls, parameters.
struct Assembly<'f> {
    file: &'f ProblemFile,
    optimal: &'f Optimal,
    joint: Joint,
    parameters: Parameters,
    graph: Graph,
    states: Vec<Variable>,
    controls: Vec<Variable>,
    sought: Vec<Variable>,
    values: HashMap<String, Node>,
    /// Nodes and limits of the quantities along the path, at the start and at the end.
    limited: [Vec<(Node, Limited)>; 3],
}

/// The expressions of a file, compiled.
struct Compiled {
    graph: Graph,
    nodes: Vec<Node>,
    signals: Vec<String>,
    names: Vec<String>,
}

impl Posed {
    /// Poses the problem of a file with an objective.
    ///
    /// # Errors
    /// When anything in it is inconsistent. The error states file, line and column.
    pub fn new(file: &ProblemFile, open: Open<'_>) -> Done<Self> {
        let Some(optimal) = &file.optimal else {
            let fault = format!(
                "{}: nothing is optimised; add [objective] with minimise = \"...\", or fit it with `pilotage fit`",
                file.file
            );
            return Err(ProblemError::Part(fault));
        };
        let mut parts = opened(file, open)?;
        if file.options.limits == OfOutputs::Saturate {
            parts.iter_mut().for_each(|(_, part)| part.saturate());
        }
        let joint = Joint::new(&file.system, parts)?;
        let parameters = Parameters::new(file, &joint)?;
        Assembly {
            file,
            optimal,
            joint,
            parameters,
            graph: Graph::default(),
            states: Vec::new(),
            controls: Vec::new(),
            sought: Vec::new(),
            values: HashMap::new(),
            limited: [const { Vec::new() }; 3],
        }
        .finish()
    }

    /// The program on a mesh in τ.
    pub fn program(&self, mesh: Vec<f64>) -> Program {
        let scales = Scales {
            states: self
                .states
                .iter()
                .chain(&self.controls)
                .map(|own| own.scale)
                .collect(),
            parameters: self.parameters.iter().map(|own| own.scale).collect(),
        };
        let limits = |own: &Limited| (own.limits.0 / own.size, own.limits.1 / own.size);
        let [path, start, end] = &self.limited;
        let all = |of: &[Limited]| of.iter().map(limits).collect();
        let model = |k: usize| NodeModel::new(self.equations[k].clone(), scales.clone());
        let scaled = |own: &Variable| (own.limits.0 / own.scale, own.limits.1 / own.scale);
        let known = self.initial.iter().zip(&self.states);
        Program {
            model: model(0),
            start: model(1),
            end: model(2),
            limits: [all(path), all(start), all(end)],
            controls: self.of_controls.clone(),
            initial: known
                .map(|(own, state)| own.map(|own| own / state.scale))
                .collect(),
            parameters: self.parameters.iter().map(scaled).collect(),
            duration: self.duration,
            regularise: self.regularise,
            mesh,
        }
    }

    /// The parameters where the search begins.
    pub fn theta(&self) -> Vec<f64> {
        self.parameters.iter().map(|own| own.guess[0]).collect()
    }

    /// Variables where the search begins, from states at the nodes and midpoints, from controls and parameters, all in
    /// their units.
    pub fn variables(
        &self,
        program: &Program,
        states: &dyn Fn(f64) -> Vec<f64>,
        controls: &dyn Fn(f64) -> Vec<f64>,
        theta: &[f64],
    ) -> Vec<f64> {
        let (n, m) = (program.n(), program.m());
        let mut z = vec![0.0; program.variables()];
        let scaled = |values: Vec<f64>, of: &[Variable]| -> Vec<f64> {
            values
                .iter()
                .zip(of)
                .map(|(value, own)| value / own.scale)
                .collect()
        };
        for k in 0..=program.intervals() {
            let time = program.mesh[k];
            z[program.node(k)..][..n].copy_from_slice(&scaled(states(time), &self.states));
            z[program.node(k) + n..][..m].copy_from_slice(&scaled(controls(time), &self.controls));
            if k < program.intervals() {
                let middle = 0.5 * (time + program.mesh[k + 1]);
                z[program.middle(k)..][..n].copy_from_slice(&scaled(states(middle), &self.states));
            }
        }
        for (i, known) in program.initial.iter().enumerate() {
            z[i] = known.unwrap_or(z[i]);
        }
        for (c, control) in program.controls.iter().enumerate() {
            z[n + c] = control.first.unwrap_or(z[n + c]);
        }
        let at = program.theta();
        z[at..].copy_from_slice(&scaled(theta.to_vec(), &self.parameters));
        z
    }

    /// Number of seconds at these parameters.
    pub fn seconds(&self, theta: &[f64]) -> f64 {
        match self.duration {
            Duration::Number(seconds) => seconds,
            Duration::Sought(k) => theta[k],
        }
    }
}

fn at(place: Option<&Place>, fault: impl Into<String>) -> ProblemError {
    ProblemError::maybe_at(place, fault)
}

impl Assembly<'_> {
    fn finish(mut self) -> Done<Posed> {
        self.find_states();
        self.find_controls()?;
        self.find_sought();
        let (n, m, p) = (self.states.len(), self.controls.len(), self.sought.len());
        (0..1 + n + 2 * m + p).for_each(|k| _ = self.graph.variable(k));
        let compiled = self.compile()?;
        let seconds = self.seconds();
        let tau = self.graph.variable(0);
        let time = self.graph.multiply(tau, seconds);
        self.set_values(&compiled);
        let (mut derivatives, signals) = self.equations(time, &compiled.signals);
        let nodes = self.import(&compiled, time, &signals);
        let mut nodes = nodes.into_iter();
        let mut next = || nodes.next().expect("a node for each expression");
        for (name, _) in self.tied() {
            self.values.insert(name, next());
        }
        // Tied parameters were unknown when the equations were first imported.
        let (again, signals) = self.equations(time, &compiled.signals);
        derivatives.clone_from(&again);
        let nodes = self.import(&compiled, time, &signals);
        let mut nodes = nodes.into_iter().skip(self.tied().len());
        let mut next = || nodes.next().expect("a node for each expression");
        let finals: Vec<Node> = self.optimal.finals.iter().map(|_| next()).collect();
        let firsts: Vec<(usize, Node)> = (self.initial_formulas().into_iter())
            .map(|(state, _)| (state, next()))
            .collect();
        let constraints: Vec<Node> = self.file.constraints.iter().map(|_| next()).collect();
        let limits: Vec<[Option<Node>; 2]> = (self.optimal.controls.iter())
            .map(|own| {
                own.limits
                    .each_ref()
                    .map(|limit| limit.as_ref().map(|_| next()))
            })
            .collect();
        let parts: Vec<Node> = self
            .optimal
            .objective
            .parts
            .iter()
            .map(|_| next())
            .collect();
        let objective = next();
        let initial = self.begin(&derivatives, firsts)?;
        self.end(finals)?;
        self.constrain(&constraints, n, m)?;
        self.limit_controls(&limits)?;
        let objective = self.aim(objective, &parts, &mut derivatives);
        self.posed(
            derivatives,
            objective,
            initial,
            (compiled.signals, signals),
            seconds,
        )
    }

    fn find_states(&mut self) {
        let guess = |name: &str| {
            let own = self
                .optimal
                .guess
                .states
                .iter()
                .find(|(own, _)| own.value == name);
            own.map_or([f64::NAN; 2], |(_, pair)| *pair)
        };
        let nominal = |name: &str| {
            let about = self.joint.variables.get(name);
            about.and_then(|about| about.nominal).unwrap_or(f64::NAN)
        };
        let variable = |name: &String| Variable {
            name: name.clone(),
            unit: self.joint.unit(name).map(str::to_owned),
            scale: nominal(name),
            guess: guess(name),
            limits: (f64::NEG_INFINITY, f64::INFINITY),
        };
        self.states = self.joint.model.states.iter().map(variable).collect();
        for (name, of, _) in &self.optimal.objective.parts {
            if *of == PartOf::Integral {
                self.states.push(Variable {
                    name: name.clone(),
                    unit: None,
                    scale: f64::NAN,
                    guess: [f64::NAN; 2],
                    limits: (f64::NEG_INFINITY, f64::INFINITY),
                });
            }
        }
    }

    fn find_controls(&mut self) -> Done<()> {
        let inputs: Vec<String> = self.joint.model.inputs.clone();
        for own in &self.optimal.controls {
            let name = &own.signal.value;
            let place = own.signal.place.as_ref();
            if !inputs.contains(name) {
                let fault = match self.joint.driven.contains_key(name) {
                    true => {
                        format!("`{name}` is driven by a wire; leave the wire or the control out")
                    }
                    false => unknown("free input", name, &inputs),
                };
                return Err(at(place, fault));
            }
            if self.controls.iter().any(|other| other.name == *name) {
                return Err(at(
                    place,
                    format!("`{name}` is a control twice; leave one out"),
                ));
            }
            self.controls.push(Variable {
                name: name.clone(),
                unit: self.joint.unit(name).map(str::to_owned),
                scale: f64::NAN,
                guess: [own.start.unwrap_or(f64::NAN); 2],
                limits: (f64::NEG_INFINITY, f64::INFINITY),
            });
        }
        Ok(())
    }

    fn find_sought(&mut self) {
        for own in &self.parameters.unknowns {
            self.sought.push(Variable {
                name: own.name.clone(),
                unit: own.unit.clone(),
                scale: own.nominal.unwrap_or(f64::NAN),
                guess: [own.start; 2],
                limits: (
                    own.min.unwrap_or(f64::NEG_INFINITY),
                    own.max.unwrap_or(f64::INFINITY),
                ),
            });
        }
        let own = |name: &str, guess: f64, limits: Limits, unit: Option<&str>| Variable {
            name: name.to_owned(),
            unit: unit.map(str::to_owned),
            scale: f64::NAN,
            guess: [guess; 2],
            limits,
        };
        let horizon = self.optimal.horizon;
        if horizon.min < horizon.max {
            let limits = (horizon.min, horizon.max);
            self.sought
                .push(own("duration", horizon.start, limits, Some("s")));
        }
        let everything = (f64::NEG_INFINITY, f64::INFINITY);
        for (name, of, _) in &self.optimal.objective.parts {
            if *of == PartOf::Initial {
                self.sought.push(own(name, f64::NAN, everything, None));
            }
        }
    }

    fn sought(&mut self, name: &str) -> Option<Node> {
        let k = self.sought.iter().position(|own| own.name == name)?;
        let first = 1 + self.states.len() + 2 * self.controls.len();
        Some(self.graph.variable(first + k))
    }

    fn seconds(&mut self) -> Node {
        match self.optimal.horizon.min < self.optimal.horizon.max {
            true => self.sought("duration").expect("it is sought"),
            false => self.graph.constant(self.optimal.horizon.start),
        }
    }

    fn tied(&self) -> Vec<(String, Formula)> {
        let names = self.parameters.names.iter();
        let tied = names.filter_map(|name| match &self.parameters.meanings[name] {
            Meaning::Tied(formula) => Some((name.clone(), formula.clone())),
            Meaning::Number(_) | Meaning::Unknown(_) => None,
        });
        tied.collect()
    }

    /// States whose initial value is an expression in the file.
    fn initial_formulas(&self) -> Vec<(usize, Formula)> {
        let states = self.joint.model.states.iter().enumerate();
        let found = states.filter_map(|(k, state)| match self.initial_line(state)? {
            Initial::Formula(formula) => Some((k, formula.clone())),
            _ => None,
        });
        found.collect()
    }

    /// The line of `[initial]` for a state: that with its name, else the last pattern.
    fn initial_line(&self, state: &str) -> Option<&Initial> {
        let lines = || self.file.initial.iter();
        let own = lines().find(|(name, _)| name.value == state);
        let names = [state.to_owned()];
        let found =
            own.or_else(|| lines().rfind(|(name, _)| !matching(&name.value, &names).is_empty()));
        found.map(|(_, initial)| initial)
    }

    fn compile(&self) -> Done<Compiled> {
        for (name, _) in &self.file.initial {
            if matching(&name.value, &self.joint.model.states).is_empty() {
                let fault = unknown("state", &name.value, &self.joint.model.states);
                return Err(at(name.place.as_ref(), fault));
            }
        }
        let guessed = self.optimal.guess.states.iter().map(|(name, _)| name);
        for name in guessed.chain(self.optimal.finals.iter().map(|(name, _)| name)) {
            if !self.joint.model.states.contains(&name.value) {
                let fault = unknown("state", &name.value, &self.joint.model.states);
                return Err(at(name.place.as_ref(), fault));
            }
        }
        let mut all = Expressions::new(&self.file.file, &self.file.text);
        let signals = self.joint.signals();
        for name in &signals {
            all.add_signal(name, self.joint.unit(name));
        }
        for (name, formula) in self.tied() {
            let unit = self.parameters.unit(&name, &self.joint);
            all.add(&name, unit, &formula, Some("a tied parameter"));
        }
        for (name, formula) in &self.optimal.finals {
            let unit = self.joint.unit(&name.value);
            all.add("the final value", unit, formula, Some("a final state"));
        }
        for (state, formula) in self.initial_formulas() {
            let name = &self.joint.model.states[state];
            let unit = self.joint.unit(name);
            let what = format!("the initial value of `{name}`");
            all.add(&what, unit, &formula, Some("an initial state"));
        }
        for own in &self.file.constraints {
            let constant =
                (own.at == Holds::Parameters).then_some("a constraint at the parameters");
            all.add("the constraint", None, &own.formula, constant);
        }
        for own in &self.optimal.controls {
            for limit in own.limits.iter().flatten() {
                let unit = self.joint.unit(&own.signal.value);
                all.add("the limit", unit, limit, None);
            }
        }
        let objective = &self.optimal.objective;
        for (_, _, formula) in &objective.parts {
            all.add("the objective", None, formula, None);
        }
        let what = "an objective outside final(...), initial(...) and integral(...)";
        all.add("the objective", None, &objective.formula, Some(what));
        let is_plain = |name: &&String| {
            !matches!(self.parameters.meanings[*name], Meaning::Tied(_)) && !signals.contains(name)
        };
        let mut names: Vec<String> = self
            .parameters
            .names
            .iter()
            .filter(is_plain)
            .cloned()
            .collect();
        for name in &names {
            all.add_parameter(name, self.parameters.unit(name, &self.joint));
        }
        for (name, _, _) in &objective.parts {
            all.add_parameter(name, None);
            names.push(name.clone());
        }
        if self.optimal.horizon.min < self.optimal.horizon.max
            && !names.iter().any(|own| own == "duration")
        {
            all.add_parameter("duration", Some("s"));
            names.push("duration".into());
        }
        let compiled = all.compile()?;
        Ok(Compiled {
            graph: compiled.graph,
            nodes: compiled.nodes,
            signals,
            names,
        })
    }

    /// Nodes of all parameters but tied ones, which are 0 until they are known.
    fn set_values(&mut self, compiled: &Compiled) {
        let names = self.parameters.names.clone();
        for name in names {
            let node = match self.parameters.meanings[&name] {
                Meaning::Number(value) => self.graph.constant(value),
                Meaning::Unknown(_) => self.sought(&name).expect("it is sought"),
                Meaning::Tied(_) => self.graph.constant(0.0),
            };
            self.values.insert(name, node);
        }
        for name in &compiled.names {
            if let Some(node) = self.sought(name) {
                self.values.insert(name.clone(), node);
            }
        }
    }

    /// Derivatives of the states by τ, and nodes of these signals.
    fn equations(&mut self, time: Node, signals: &[String]) -> (Vec<Node>, Vec<Node>) {
        let seconds = self.seconds();
        let n = self.states.len();
        let model = &self.joint.model;
        let mut variables = vec![time];
        variables.extend((0..model.states.len()).map(|k| self.graph.variable(1 + k)));
        for name in &model.inputs {
            let control = self.controls.iter().position(|own| own.name == *name);
            variables.push(match control {
                Some(c) => self.graph.variable(1 + n + c),
                None => self.values[name],
            });
        }
        variables.extend(model.parameters.iter().map(|name| self.values[name]));
        let system = &model.system;
        let mut derivatives = self
            .graph
            .import(&system.graph, &system.derivatives, &variables);
        for own in &mut derivatives {
            *own = self.graph.multiply(seconds, *own);
        }
        let nodes: Vec<Node> = (signals.iter())
            .map(|name| self.joint.signal(name).expect("a signal of its own"))
            .collect();
        let signals = self.graph.import(&system.graph, &nodes, &variables);
        (derivatives, signals)
    }

    fn import(&mut self, compiled: &Compiled, time: Node, signals: &[Node]) -> Vec<Node> {
        let zero = self.graph.constant(0.0);
        let mut variables = vec![time];
        variables.extend_from_slice(signals);
        let parts = &self.optimal.objective.parts;
        for name in &compiled.names {
            let part = parts.iter().position(|(own, _, _)| own == name);
            let known = self.values.get(name).copied();
            variables.push(match (known, part) {
                (Some(node), _) => node,
                (None, Some(k)) => self.graph.variable(self.part_variable(k)),
                (None, None) => zero,
            });
        }
        self.graph
            .import(&compiled.graph, &compiled.nodes, &variables)
    }

    /// How the states begin: numbers, or equations at the start.
    fn begin(
        &mut self,
        derivatives: &[Node],
        firsts: Vec<(usize, Node)>,
    ) -> Done<Vec<Option<f64>>> {
        let mut starts: Vec<Node> = Vec::new();
        for (instance, part) in &self.joint.parts {
            let zero = self.graph.constant(0.0);
            let system = &part.model.system;
            let mut variables = vec![zero; 1 + system.states + system.inputs];
            let own = part.model.parameters.iter();
            variables.extend(own.map(|name| self.values[&format!("{instance}.{name}")]));
            starts.extend(self.graph.import(&system.graph, &part.starts, &variables));
        }
        // Wires with conversions have no states.
        for (state, node) in firsts {
            starts[state] = node;
        }
        let mut initial = vec![None; self.states.len()];
        for (k, name) in self.joint.model.states.clone().iter().enumerate() {
            let variable = self.graph.variable(1 + k);
            let equation = match self.initial_line(name) {
                Some(Initial::Free) => continue,
                Some(Initial::Steady) => derivatives[k],
                Some(Initial::FirstSample) => {
                    let fault = format!(
                        "`{name}` has no first sample: nothing is measured; write a number or \"free\""
                    );
                    return Err(ProblemError::Part(format!("{}: {fault}", self.file.file)));
                }
                _ => match self.graph.value(starts[k]) {
                    Some(value) => {
                        initial[k] = Some(value);
                        continue;
                    }
                    None => self.graph.subtract(variable, starts[k]),
                },
            };
            self.limited[1].push((
                equation,
                limited(format!("the initial value of {name}"), None, (0.0, 0.0)),
            ));
        }
        for own in initial.iter_mut().skip(self.joint.model.states.len()) {
            *own = Some(0.0);
        }
        for (known, state) in initial.iter().zip(&mut self.states) {
            if state.guess[0].is_nan() {
                state.guess[0] = known.unwrap_or(f64::NAN);
            }
        }
        Ok(initial)
    }

    fn end(&mut self, finals: Vec<Node>) -> Done<()> {
        for ((name, _), node) in self.optimal.finals.iter().zip(finals) {
            let names = &self.joint.model.states;
            let k = names
                .iter()
                .position(|own| *own == name.value)
                .expect("it is checked");
            let state = self.graph.variable(1 + k);
            let difference = self.graph.subtract(state, node);
            if let (Some(value), true) = (self.graph.value(node), self.states[k].guess[1].is_nan())
            {
                self.states[k].guess[1] = value;
            }
            let own = limited(
                format!("the final value of {}", name.value),
                name.place.clone(),
                (0.0, 0.0),
            );
            self.limited[2].push((difference, own));
        }
        Ok(())
    }

    fn constrain(&mut self, nodes: &[Node], n: usize, m: usize) -> Done<()> {
        for (own, node) in self.file.constraints.iter().zip(nodes) {
            let place = match own.at {
                Holds::Samples => 0,
                Holds::Start | Holds::Parameters => 1,
                Holds::End => 2,
            };
            let name = own.formula.expression.text.clone();
            let depends = self
                .graph
                .dependants(|variable| variable > 0 && variable <= n + m);
            if place == 0 && own.min == own.max {
                let fault = "an equation along the whole path leaves no control free; solve it for a control in the model, or \
                             write a range";
                return Err(ProblemError::at(&own.place, fault));
            }
            if let Some(value) = self.graph.value(*node) {
                if !(own.min..=own.max).contains(&value) {
                    let fault = format!(
                        "`{name}` is {value}, whatever is sought; nothing meets the limits"
                    );
                    return Err(ProblemError::at(&own.place, fault));
                }
                continue;
            }
            // What does not change along the path holds if it holds at the start.
            let place = if depends[node.index()] { place } else { 1 };
            let own = limited(name, Some(own.place.clone()), (own.min, own.max));
            self.limited[place].push((*node, own));
        }
        Ok(())
    }

    fn limit_controls(&mut self, limits: &[[Option<Node>; 2]]) -> Done<()> {
        let n = self.states.len();
        for (c, own) in limits.iter().enumerate() {
            let control = self.graph.variable(1 + n + c);
            let name = self.controls[c].name.clone();
            let place = self.optimal.controls[c].signal.place.clone();
            for (side, node) in own.iter().enumerate() {
                let Some(node) = node else { continue };
                match self.graph.value(*node) {
                    Some(value) if side == 0 => self.controls[c].limits.0 = value,
                    Some(value) => self.controls[c].limits.1 = value,
                    None => {
                        let difference = self.graph.subtract(control, *node);
                        let range = match side {
                            0 => (0.0, f64::INFINITY),
                            _ => (f64::NEG_INFINITY, 0.0),
                        };
                        let own = limited(format!("the limit of {name}"), place.clone(), range);
                        self.limited[0].push((difference, own));
                    }
                }
            }
            let (low, high) = self.controls[c].limits;
            if low >= high {
                let fault =
                    format!("`{name}` may be from {low} to {high}; nothing is left to choose");
                return Err(at(place.as_ref(), fault));
            }
            let begin = match (low.is_finite(), high.is_finite()) {
                (true, true) => 0.5 * (low + high),
                (true, false) => low.max(0.0),
                _ => high.min(0.0),
            };
            let guess = &mut self.controls[c].guess;
            *guess = guess.map(|own| {
                if own.is_nan() {
                    begin
                } else {
                    own.clamp(low, high)
                }
            });
        }
        Ok(())
    }

    /// The objective at the end; what is integrated becomes a state, what is under a maximum a limit.
    fn aim(&mut self, objective: Node, parts: &[Node], derivatives: &mut Vec<Node>) -> Node {
        let seconds = self.seconds();
        let mut replaced = HashMap::new();
        let mut integrals = self.joint.model.states.len();
        for ((name, of, formula), node) in self.optimal.objective.parts.iter().zip(parts) {
            let own = match of {
                PartOf::Final => *node,
                PartOf::Integral => {
                    derivatives.push(self.graph.multiply(seconds, *node));
                    integrals += 1;
                    self.graph.variable(integrals)
                }
                PartOf::Initial => {
                    let sought = self.sought(name).expect("it is sought");
                    let difference = self.graph.subtract(*node, sought);
                    let name = format!("initial({})", formula.expression.text);
                    self.limited[1].push((difference, limited(name, None, (0.0, 0.0))));
                    sought
                }
            };
            replaced.insert(name.clone(), own);
        }
        // The expression once more, with its parts.
        self.values.extend(replaced);
        let objective = self.with_parts(objective);
        let objective = match self.optimal.objective.is_maximised {
            true => self.graph.negate(objective),
            false => objective,
        };
        let pieces = pieces(&mut self.graph, objective, false);
        if pieces.len() == 1 {
            return objective;
        }
        let index = 1 + self.states.len() + 2 * self.controls.len() + self.sought.len();
        let bound = self.graph.variable(index);
        self.sought.push(Variable {
            name: "bound of the objective".into(),
            unit: None,
            scale: f64::NAN,
            guess: [f64::NAN; 2],
            limits: (f64::NEG_INFINITY, f64::INFINITY),
        });
        for piece in pieces {
            let difference = self.graph.subtract(piece, bound);
            let own = limited("the objective".into(), None, (f64::NEG_INFINITY, 0.0));
            self.limited[2].push((difference, own));
        }
        bound
    }

    /// A part of the objective until it is known: a variable after those of the program.
    fn part_variable(&self, k: usize) -> usize {
        1 + self.states.len() + 2 * self.controls.len() + self.sought.len() + k
    }

    /// An expression with the parts of the objective in their places.
    fn with_parts(&mut self, objective: Node) -> Node {
        let mut variables: Vec<Node> = (0..self.part_variable(0))
            .map(|k| self.graph.variable(k))
            .collect();
        let parts = self.optimal.objective.parts.iter();
        variables.extend(parts.map(|(name, _, _)| self.values[name]));
        let copy = self.graph.clone();
        self.graph.import(&copy, &[objective], &variables)[0]
    }

    fn posed(
        mut self,
        derivatives: Vec<Node>,
        objective: Node,
        initial: Vec<Option<f64>>,
        (names, signals): (Vec<String>, Vec<Node>),
        seconds: Node,
    ) -> Done<Posed> {
        let (n, m, p) = (self.states.len(), self.controls.len(), self.sought.len());
        (0..1 + n + 2 * m + p).for_each(|k| _ = self.graph.variable(k));
        self.fill_guesses(&derivatives, objective);
        let zero = self.graph.constant(0.0);
        let slopes: Vec<Node> = (0..m).map(|c| self.graph.variable(1 + n + m + c)).collect();
        let mut limited = std::mem::take(&mut self.limited);
        let points = self.sampled();
        let mut rows: [Vec<Node>; 3] = [const { Vec::new() }; 3];
        for (rows, own) in rows.iter_mut().zip(&mut limited) {
            for (node, own) in own {
                own.size = size(own.limits, points.iter().map(|values| values[node.index()]));
                let size = self.graph.constant(own.size);
                rows.push(self.graph.divide(*node, size));
            }
        }
        let [path, start, end] = rows;
        let system = |derivatives: Vec<Node>, outputs: Vec<Node>| {
            Arc::new(Differentiated::new(&System {
                graph: self.graph.clone(),
                states: n + m,
                inputs: m,
                parameters: p,
                derivatives,
                outputs,
            }))
        };
        let moving = [derivatives, slopes].concat();
        let still = vec![zero; n + m];
        let end = [vec![objective], end].concat();
        let states = self.joint.model.states.clone();
        let is_other = |name: &String| {
            !states.contains(name) && !self.controls.iter().any(|own| own.name == *name)
        };
        let shown = names
            .into_iter()
            .zip(signals)
            .filter(|(name, _)| is_other(name));
        let (names, nodes): (Vec<String>, Vec<Node>) = shown.unzip();
        let duration = match self.graph.value(seconds) {
            Some(value) => Duration::Number(value),
            None => {
                let k = self.sought.iter().position(|own| own.name == "duration");
                Duration::Sought(k.expect("it is sought"))
            }
        };
        Ok(Posed {
            equations: [
                system(moving.clone(), path),
                system(still.clone(), start),
                system(still, end),
            ],
            shown: system(moving, nodes),
            signals: (names.into_iter())
                .map(|name| (name.clone(), self.joint.unit(&name).map(str::to_owned)))
                .collect(),
            of_controls: self.of_controls()?,
            limited: limited.map(|own| own.into_iter().map(|(_, own)| own).collect()),
            duration,
            is_maximised: self.optimal.objective.is_maximised,
            intervals: self.optimal.horizon.intervals,
            tolerance: self.file.options.tolerance,
            regularise: self.optimal.objective.regularise,
            is_simulated: self.optimal.guess.is_simulated,
            states: self.states,
            controls: self.controls,
            parameters: self.sought,
            initial,
        })
    }

    fn of_controls(&self) -> Done<Vec<Control>> {
        let control =
            |(own, line): (&Variable, &pilotage_estimation::problem::control::Control)| {
                let trim = match self.parameters.meanings.get(&own.name) {
                    Some(Meaning::Number(value)) => *value,
                    _ => 0.0,
                };
                let first = match line.first {
                    First::Free => None,
                    First::Number(value) => Some(value),
                    First::Trim => Some(trim),
                };
                if let Some(value) =
                    first.filter(|value| !(own.limits.0..=own.limits.1).contains(value))
                {
                    let fault = format!(
                        "`{}` begins at {value}, which is not within {} to {}; write `first`",
                        own.name, own.limits.0, own.limits.1
                    );
                    return Err(at(line.signal.place.as_ref(), fault));
                }
                Ok(Control {
                    shape: if line.is_constant {
                        Shape::Constant
                    } else {
                        Shape::Linear
                    },
                    limits: (own.limits.0 / own.scale, own.limits.1 / own.scale),
                    rate: line.rate.unwrap_or(f64::INFINITY) / own.scale,
                    first: first.map(|value| value / own.scale),
                })
            };
        self.controls
            .iter()
            .zip(&self.optimal.controls)
            .map(control)
            .collect()
    }

    /// Completes guesses and scales.
    fn fill_guesses(&mut self, derivatives: &[Node], objective: Node) {
        for own in &mut self.states {
            let [first, last] = own.guess;
            let known = if first.is_nan() { last } else { first };
            let known = if known.is_nan() { 0.0 } else { known };
            own.guess = [first, last].map(|value| if value.is_nan() { known } else { value });
        }
        for own in &mut self.controls {
            let largest = [own.limits.0, own.limits.1, own.guess[0]];
            let finite = largest.iter().filter(|value| value.is_finite());
            own.scale = finite.fold(0.0, |m, value| value.abs().max(m));
            own.scale = if own.scale > 0.0 { own.scale } else { 1.0 };
        }
        // Integrals, from the mean of what is integrated at start and end.
        let parts = self.joint.model.states.len();
        for k in parts..self.states.len() {
            let points = self.sampled();
            let rates = points.iter().map(|values| values[derivatives[k].index()]);
            let mean = rates.filter(|rate| rate.is_finite()).sum::<f64>() / points.len() as f64;
            self.states[k].guess = [0.0, mean];
        }
        for own in &mut self.states {
            let largest = own
                .guess
                .iter()
                .fold(0.0_f64, |m, value| m.max(value.abs()));
            if !own.scale.is_finite() {
                own.scale = if largest > 0.0 { largest } else { 1.0 };
            }
        }
        // Initial values that the objective names, and the bound of all that is under a maximum.
        let points = self.sampled();
        let starts = self.limited[1].iter();
        let initial: HashMap<String, f64> = starts
            .map(|(node, own)| (own.name.clone(), points[0][node.index()]))
            .collect();
        let formulas = self.optimal.objective.parts.iter();
        for (name, _, formula) in formulas.filter(|part| part.1 == PartOf::Initial) {
            let value = initial.get(&format!("initial({})", formula.expression.text));
            if let Some(own) = self.sought.iter_mut().find(|own| own.name == *name) {
                own.guess = [value.copied().unwrap_or(0.0); 2];
            }
        }
        let last = &points[points.len() - 1];
        let pieces = self.limited[2]
            .iter()
            .filter(|(_, own)| own.name == "the objective");
        let highest = pieces
            .map(|(node, _)| last[node.index()])
            .fold(f64::NEG_INFINITY, f64::max);
        let _ = objective;
        for own in &mut self.sought {
            if own.guess[0].is_nan() {
                own.guess = [if highest.is_finite() { highest } else { 0.0 }; 2];
            }
            if !own.scale.is_finite() {
                own.scale = if own.guess[0] != 0.0 {
                    own.guess[0].abs()
                } else {
                    1.0
                };
            }
        }
    }

    /// All nodes at start, middle and end of the guess.
    fn sampled(&self) -> Vec<Vec<f64>> {
        let at = |tau: f64| {
            let mix = |own: &Variable| own.guess[0] + tau * (own.guess[1] - own.guess[0]);
            let of = |value: f64| if value.is_nan() { 0.0 } else { value };
            let mut values = vec![tau];
            values.extend(self.states.iter().chain(&self.controls).map(mix).map(of));
            values.extend(self.controls.iter().map(|_| 0.0));
            values.extend(self.sought.iter().map(|own| of(own.guess[0])));
            // The parts of the objective, which nothing depends on any more.
            values.extend(self.optimal.objective.parts.iter().map(|_| 0.0));
            self.graph.values(&values)
        };
        [0.0, 0.5, 1.0].map(at).into()
    }
}

fn limited(name: String, place: Option<Place>, limits: Limits) -> Limited {
    Limited {
        name,
        place,
        limits,
        size: 1.0,
    }
}

/// Magnitude of a limited quantity: its largest limit, else what it is where the search begins.
fn size(limits: Limits, values: impl Iterator<Item = f64>) -> f64 {
    let finite = [limits.0, limits.1]
        .into_iter()
        .filter(|limit| limit.is_finite());
    let largest = finite.fold(0.0_f64, |m, limit| m.max(limit.abs()));
    if largest > 0.0 {
        return largest;
    }
    let known = values.filter(|value| value.is_finite());
    let largest = known.fold(0.0_f64, |m, value| m.max(value.abs()));
    if largest > 1e-3 { largest } else { 1.0 }
}

/// Smooth expressions whose maximum (minimum, if `least`) is the given one, as far as its sums, factors, magnitudes, maxima
/// and minima show.
fn pieces(graph: &mut Graph, node: Node, least: bool) -> Vec<Node> {
    match graph.operation(node) {
        Operation::Unary(Function::Abs, inner) if !least => {
            let negative = graph.negate(inner);
            vec![inner, negative]
        }
        Operation::Unary(Function::Negate, inner) => {
            let own = pieces(graph, inner, !least);
            own.into_iter().map(|piece| graph.negate(piece)).collect()
        }
        // max(a, b) is written `if a < b then b else a`, min(a, b) `if b < a then b else a`.
        Operation::Select(condition, yes, no) => {
            let compared = match graph.operation(condition) {
                Operation::Binary(Operator::Less, a, b) => Some((a, b)),
                _ => None,
            };
            let is_extreme = match least {
                false => compared == Some((no, yes)),
                true => compared == Some((yes, no)),
            };
            match is_extreme {
                true => [pieces(graph, no, least), pieces(graph, yes, least)].concat(),
                false => vec![node],
            }
        }
        Operation::Binary(operator @ (Operator::Multiply | Operator::Divide), a, b) => {
            let (inner, factor) = match (graph.value(a), graph.value(b)) {
                (_, Some(factor)) => (a, factor),
                (Some(factor), None) if operator == Operator::Multiply => (b, factor),
                _ => return vec![node],
            };
            let factor = if operator == Operator::Divide {
                1.0 / factor
            } else {
                factor
            };
            let own = pieces(graph, inner, least != (factor < 0.0));
            own.into_iter()
                .map(|piece| graph.scale(factor, piece))
                .collect()
        }
        Operation::Binary(operator @ (Operator::Add | Operator::Subtract), a, b) => {
            let first = pieces(graph, a, least);
            let second = pieces(graph, b, least != (operator == Operator::Subtract));
            if first.len() * second.len() == 1 {
                return vec![node];
            }
            let pairs = first
                .iter()
                .flat_map(|a| second.iter().map(move |b| (*a, *b)));
            let pairs: Vec<(Node, Node)> = pairs.collect();
            pairs
                .into_iter()
                .map(|(a, b)| graph.binary(operator, a, b))
                .collect()
        }
        _ => vec![node],
    }
}

/// A run without data over an interval in τ, with slopes of the controls.
pub(crate) fn bare_run([from, to]: [f64; 2], slopes: Vec<f64>, states: usize) -> Run {
    Run {
        mesh: vec![from, to],
        time: vec![from, to],
        inputs: vec![slopes.clone(), slopes],
        measured: Vec::new(),
        initial: vec![None; states],
        steps: Steps::default(),
    }
}
