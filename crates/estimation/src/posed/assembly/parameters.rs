//! Parameters and expressions of parameters, as nodes of the graph.

use super::inputs::{Key, Span};
use super::{Assembly, Done};
use crate::posed::assembly::made::Stands;
use crate::posed::names::Of;
use crate::posed::unknowns::{Meaning, Unknown};
use crate::problem::error::ProblemError;
use crate::problem::file::Per;
use crate::system::part::Part;
use pilotage_expression::{Function, Node};
use std::collections::HashMap;

impl Assembly<'_> {
    /// Assigns each unknown its place.
    pub(super) fn find_unknowns(&mut self) -> Done<()> {
        for unknown in &self.parameters.unknowns {
            let is_set_in_all = self.data.iter().all(|run| run.line.is_set(&unknown.name));
            let per = match self.data.len() == 1 || is_set_in_all {
                true => Per::All,
                false => unknown.per,
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
        // Collocation needs a state: without one, a constant state is added.
        self.states = self.states.max(1);
        Ok(())
    }

    /// Adds a shared parameter for each subject with a run that does not set it.
    fn find_subjects(&mut self, name: &str) -> Done<Vec<(String, usize)>> {
        let mut subjects: Vec<(String, usize)> = Vec::new();
        for run in self.data.iter().filter(|run| !run.line.is_set(name)) {
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
            self.find_subject(subject);
        }
        Ok(subjects)
    }

    /// The node of each parameter.
    pub(super) fn parameter_nodes(&mut self, span: Span) -> HashMap<String, Node> {
        let parameters = self.parameters;
        let mut plain = HashMap::new();
        let mut tied = Vec::new();
        for name in &parameters.names {
            let node = match &parameters.meanings[name] {
                Meaning::Number(value) => self.graph.constant(*value),
                Meaning::Unknown(k) => self.unknown_node(*k),
                Meaning::Tied(_) => {
                    tied.push(name.clone());
                    continue;
                }
            };
            plain.insert(name.clone(), node);
        }
        let mut nodes = plain.clone();
        for name in &parameters.names {
            if let Some(node) = self.set_node(name, span, &plain) {
                nodes.insert(name.clone(), node);
            }
        }
        let of: Vec<Of> = tied.iter().cloned().map(Of::Tied).collect();
        let found = self.expressions(&of, None, &nodes);
        nodes.extend(tied.into_iter().zip(found));
        nodes
    }

    /// The node of a parameter set by runs, or of how a state begins, with other parameters as in `plain`.
    pub(super) fn set_node(
        &mut self,
        name: &str,
        span: Span,
        plain: &HashMap<String, Node>,
    ) -> Option<Node> {
        let mut sum = self.input_node(&Key::Value(name.to_owned(), span))?;
        let is_case =
            |key: &&Key| matches!(key, Key::Case(own, _, at) if own == name && *at == span);
        let keys = self.sources.iter().map(|(key, _)| key).filter(is_case);
        let keys: Vec<Key> = keys.cloned().collect();
        for key in keys {
            let value = match &key {
                Key::Case(_, Some(text), _) => {
                    let of = Of::Set(name.to_owned(), text.clone());
                    self.expressions(&[of], None, plain)[0]
                }
                _ => plain[name],
            };
            sum = self.add_where(sum, &key, value);
        }
        Some(sum)
    }

    /// What runs have added to a state until now.
    pub(super) fn added_node(&mut self, state: &str) -> Option<Node> {
        let keys = self.sources.iter().map(|(key, _)| key);
        let keys = keys.filter(|key| matches!(key, Key::Added(own, _) if own == state));
        let keys: Vec<Key> = keys.cloned().collect();
        let values = self.values[1].clone();
        let mut sum = None;
        for key in keys {
            let amount = match &key {
                Key::Added(_, Some(text)) => {
                    let of = Of::Added(state.to_owned(), text.clone());
                    self.expressions(&[of], None, &values)[0]
                }
                _ => self.graph.constant(1.0),
            };
            let before = sum.unwrap_or_else(|| self.graph.constant(0.0));
            sum = Some(self.add_where(before, &key, amount));
        }
        sum
    }

    /// The sum plus the value where the input is 1, or as often as it says.
    fn add_where(&mut self, sum: Node, key: &Key, value: Node) -> Node {
        let is_there = self.input_node(key).expect("it was found");
        let part = self.graph.multiply(is_there, value);
        self.graph.add(sum, part)
    }

    fn unknown_node(&mut self, k: usize) -> Node {
        let log = self.parameters.unknowns[k].log;
        let shared = self.first_shared();
        let value = |own: &mut Self, variable: usize| {
            let variable = own.graph.variable(variable);
            match log {
                true => own.graph.unary(Function::Exp, variable),
                false => variable,
            }
        };
        match self.stands[k].clone() {
            Stands::Shared(theta) => value(self, shared + theta),
            Stands::State(state) => value(self, 1 + state),
            Stands::Subjects(subjects) => {
                let mut sum = self.graph.constant(0.0);
                for (subject, theta) in subjects {
                    let value = value(self, shared + theta);
                    sum = self.add_where(sum, &Key::Subject(subject), value);
                }
                sum
            }
        }
    }

    /// Expressions of the file over signals, the predicted value and parameters during the run.
    pub(super) fn of_signals(&mut self, of: &[Of], signals: &[Node], predicted: Node) -> Vec<Node> {
        let values = self.values[0].clone();
        self.expressions(of, Some((signals, predicted)), &values)
    }

    /// Expressions of the file over signals and parameters.
    pub(super) fn expressions(
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
        let values = named.parameters.iter().map(|name| parameters.get(name));
        variables.extend(values.map(|node| node.copied().unwrap_or(zero)));
        let place = |of: &Of| named.place(of).expect("it was compiled");
        let nodes = of.iter().map(|of| named.compiled.nodes[place(of)]);
        let nodes: Vec<Node> = nodes.collect();
        self.graph.import(&named.compiled.graph, &nodes, &variables)
    }

    /// The variables of an instance's own equations, of which only its parameters matter.
    pub(super) fn part_variables(&mut self, instance: &str, part: &Part, span: Span) -> Vec<Node> {
        let values = match span {
            Span::Run => &self.values[0],
            Span::Begin => &self.values[1],
        };
        let system = &part.model.system;
        let zero = self.graph.constant(0.0);
        let mut variables = vec![zero; 1 + system.states + system.inputs];
        let own = part.model.parameters.iter();
        variables.extend(own.map(|name| values[&format!("{instance}.{name}")]));
        variables
    }
}

impl Unknown {
    /// A value in the coordinates of the search.
    pub fn searched(&self, value: f64) -> f64 {
        match self.log {
            true => value.ln(),
            false => value,
        }
    }

    /// The value for coordinates of the search.
    pub fn found(&self, searched: f64) -> f64 {
        match self.log {
            true => searched.exp(),
            false => searched,
        }
    }

    /// A value clamped to its range.
    pub fn kept(&self, value: f64) -> f64 {
        let min = self.min.unwrap_or(f64::NEG_INFINITY);
        value.clamp(min, self.max.unwrap_or(f64::INFINITY))
    }

    /// Typical magnitude in the coordinates of the search.
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
