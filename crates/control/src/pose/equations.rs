//! The expressions of the file and the equations of its models, in one graph.

use super::Done;
use super::assembly::Assembly;
use super::assembly::Compiled;
use super::at;
use pilotage_estimation::posed::unknowns::Meaning;
use pilotage_estimation::problem::file::Holds;
use pilotage_estimation::problem::file::matching;
use pilotage_estimation::system::joint::unknown;
use pilotage_expression::Node;
use pilotage_language::Expressions;

impl Assembly<'_> {
    pub(super) fn compile(&self) -> Done<Compiled> {
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
    pub(super) fn set_values(&mut self, compiled: &Compiled) {
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
    pub(super) fn equations(&mut self, time: Node, signals: &[String]) -> (Vec<Node>, Vec<Node>) {
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

    pub(super) fn import(
        &mut self,
        compiled: &Compiled,
        time: Node,
        signals: &[Node],
    ) -> Vec<Node> {
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
}
