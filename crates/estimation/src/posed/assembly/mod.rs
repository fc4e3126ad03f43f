//! Assembles the contents of a problem file into one graph of equations.
//!
//! | module | contents |
//! | --- | --- |
//! | `inputs` | columns and values set by runs, as inputs |
//! | `parameters` | parameters and expressions, as nodes |
//! | `initial` | initial states, and values where the search begins |
//! | `measured` | residuals of recordings and priors |
//! | `noise` | noise that drives the states |
//! | `bounds` | limits, ranges, constraints |
//! | `delays` | delays of recorded inputs |
//! | `checks` | checks before the solve |

mod bounds;
mod checks;
mod delays;
mod initial;
mod inputs;
pub(crate) mod made;
mod measured;
mod noise;
mod parameters;

use crate::posed::assembly::made::{Names, Quantities, Stands, State};
use crate::posed::data::{Rows, RunData, Source};
use crate::posed::names::Named;
use crate::posed::unknowns::{Parameters, Unknown};
use crate::problem::error::ProblemError;
use crate::problem::file::{Limits, ProblemFile};
use crate::system::joint::Joint;
use inputs::{Key, Span};
use measured::Measurement;
pub use noise::DrivingNoise;
use pilotage_collocation::{Bound, ParameterConstraints, Recording, Run};
use pilotage_expression::{Graph, Node, System};
use std::collections::HashMap;
use std::ops::Range;

/// A problem as equations, before differentiation.
pub struct Made {
    pub system: System,
    /// The terms of the objective that come from recordings.
    pub measured: Vec<Node>,
    pub bounds: Vec<Bound>,
    pub constraints: ParameterConstraints,
    pub names: Names,
    pub runs: Vec<Run>,
    pub unknowns: Vec<(Unknown, Stands)>,
    pub shared: usize,
    pub states: Vec<State>,
    pub quantities: Quantities,
    /// States that are measured directly, each with the number of its measured signal.
    pub followed: Vec<(usize, usize)>,
    pub noises: Vec<DrivingNoise>,
    /// Whether each input is constant in each run between changes.
    pub given: Vec<bool>,
}

/// State of the assembly. The variables of its graph are time, states, inputs and shared parameters.
pub struct Assembly<'a> {
    file: &'a ProblemFile,
    joint: &'a Joint,
    /// The same without limits, if outputs saturate.
    within: &'a Joint,
    parameters: &'a Parameters,
    named: &'a Named,
    data: &'a [RunData<'a>],
    graph: Graph,
    sources: Vec<(Key, Source)>,
    stands: Vec<Stands>,
    /// Numbers of states and shared parameters.
    states: usize,
    shared: usize,
    /// Nodes of the parameters, during the run and at its start.
    values: [HashMap<String, Node>; 2],
    /// Outputs of the joint model.
    outputs: Vec<Node>,
    /// Its states at the start of the first run, with unknowns at their start values.
    begins: Vec<f64>,
    recordings: Vec<Measurement>,
    bounded: Vec<(Node, Bound)>,
    names: Names,
}

/// For each run, the initial value of each state, if known.
type Known = Vec<Vec<Option<f64>>>;

type Done<T> = Result<T, ProblemError>;

impl<'a> Assembly<'a> {
    /// Determines states, inputs and shared parameters.
    pub fn new(
        file: &'a ProblemFile,
        (joint, within): (&'a Joint, &'a Joint),
        parameters: &'a Parameters,
        named: &'a Named,
        data: &'a [RunData<'a>],
    ) -> Done<Self> {
        let mut own = Self {
            file,
            joint,
            within,
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
            names: Names::default(),
        };
        own.find_columns()?;
        own.find_sets()?;
        own.find_unknowns()?;
        Ok(own)
    }

    /// Assembles the equations.
    pub fn finish(mut self) -> Done<Made> {
        self.check_samples()?;
        self.check_mesh()?;
        // All variables are in the graph, in order.
        for k in 0..self.variables() {
            self.graph.variable(k);
        }
        let rows = self.rows()?;
        self.values = [Span::Run, Span::Begin].map(|span| self.parameter_nodes(span));
        let (states, known) = self.initial_states(&rows)?;
        let zero = self.graph.constant(0.0);
        let mut variables = self.joint_variables(&states);
        self.delay(&mut variables, &rows);
        let joint = self.joint;
        let system = &joint.model.system;
        let signals: Vec<Node> = (self.named.signals.iter())
            .map(|name| joint.signal(name).expect("a signal of its own"))
            .collect();
        let mut import = |nodes: &[Node]| self.graph.import(&system.graph, nodes, &variables);
        let mut derivatives = import(&system.derivatives);
        self.outputs = import(&system.outputs);
        let signals = import(&signals);
        derivatives.resize(self.states, zero);
        let noises = self.driving_noises(&variables, &rows)?;
        let quantities = self.measure(&signals, variables, &rows)?;
        self.check_tied(&quantities, &rows)?;
        if self.file.options.limits == Limits::Constrain {
            self.limit();
        }
        self.hold_steady(&derivatives);
        let mut on_parameters = self.bound_unknowns();
        on_parameters.extend(self.bound_expressions());
        on_parameters.extend(self.constrain(&signals, &rows, &known)?);
        self.expect_priors(&rows);
        self.anchor(&derivatives, &noises, &rows);
        let constraints = self.parameter_constraints(on_parameters, &rows)?;
        let runs = self.runs(rows, known);
        let mut made = self.made(derivatives, states, runs, quantities, constraints);
        made.noises = noises;
        Ok(made)
    }

    /// The samples of each run.
    fn rows(&self) -> Done<Vec<Rows>> {
        let sources = self.sources.iter().map(|(_, source)| source.clone());
        let sources: Vec<Source> = sources.collect();
        let runs = self.data.iter().enumerate();
        runs.map(|(k, run)| run.rows(k, &sources)).collect()
    }

    /// Nodes of the joint model's variables.
    fn joint_variables(&mut self, states: &[State]) -> Vec<Node> {
        let joint = &self.joint.model;
        let mut variables = vec![self.graph.variable(0)];
        for (k, state) in states.iter().enumerate().take(joint.states.len()) {
            let variable = self.graph.variable(1 + k);
            variables.push(match state.shift {
                Some(shift) => self.graph.add(variable, shift),
                None => variable,
            });
        }
        for name in &joint.inputs {
            let node = self.input_node(&Key::Fed(name.clone()));
            let node = node.or_else(|| self.values[0].get(name).copied());
            // What stands for a delay follows.
            variables.push(node.unwrap_or_else(|| self.graph.constant(0.0)));
        }
        variables.extend(joint.parameters.iter().map(|name| self.values[0][name]));
        variables
    }

    /// Number of variables of the graph.
    fn variables(&self) -> usize {
        self.first_shared() + self.shared
    }

    /// The variables that are inputs.
    fn input_variables(&self) -> Range<usize> {
        1 + self.states..self.first_shared()
    }

    /// The variable of the first shared parameter.
    fn first_shared(&self) -> usize {
        1 + self.states + self.sources.len()
    }

    /// Whether an expression depends on any variable selected by `is_such`.
    fn depends(&self, node: Node, is_such: impl Fn(usize) -> bool) -> bool {
        self.graph.dependants(is_such)[node.index()]
    }

    /// The runs. Their mesh consists of their samples.
    fn runs(&self, rows: Vec<Rows>, known: Known) -> Vec<Run> {
        let recording = |own: &Measurement, j: usize| Recording {
            values: own.values[j].clone(),
            weight: match own.is_prior {
                true => own.weight,
                false => own.weight * self.data[j].line.weight,
            },
            loss: own.loss,
        };
        let run = |(j, (rows, initial)): (usize, (Rows, Vec<Option<f64>>))| {
            let mut mesh = rows.time.clone();
            mesh.dedup();
            let measured = self.recordings.iter().map(|own| recording(own, j));
            Run {
                mesh,
                time: rows.time,
                inputs: rows.inputs,
                measured: measured.collect(),
                initial,
                steps: pilotage_collocation::Steps {
                    window: self.input(&Key::Clock(0)),
                    ..Default::default()
                },
            }
        };
        let runs = rows.into_iter().zip(known).enumerate();
        runs.map(run).collect()
    }

    fn made(
        self,
        derivatives: Vec<Node>,
        states: Vec<State>,
        runs: Vec<Run>,
        quantities: Quantities,
        constraints: ParameterConstraints,
    ) -> Made {
        let measured = self.recordings.iter().filter(|own| !own.is_prior);
        let measured = measured.map(|own| own.output).collect();
        let outputs = self.recordings.iter().map(|own| own.output);
        let outputs = outputs.chain(self.bounded.iter().map(|(node, _)| *node));
        let outputs = outputs.collect();
        let unknowns = self.parameters.unknowns.iter().cloned();
        let sources = self.sources.iter();
        let given = sources.map(|(_, source)| matches!(source, Source::Given(_)));
        Made {
            given: given.collect(),
            measured,
            noises: Vec::new(),
            followed: self.measured_states(&states),
            bounds: self.bounded.iter().map(|(_, bound)| *bound).collect(),
            system: System {
                graph: self.graph,
                states: self.states,
                inputs: self.sources.len(),
                parameters: self.shared,
                derivatives,
                outputs,
            },
            constraints,
            names: self.names,
            runs,
            unknowns: unknowns.zip(self.stands).collect(),
            shared: self.shared,
            states,
            quantities,
        }
    }
}
