//! The parts of a problem, put together.

use super::Done;
use super::Limited;
use super::Posed;
use super::Variable;
use super::at;
use super::limits::size;
use crate::program::Control;
use crate::program::Duration;
use crate::program::Limits;
use crate::program::Shape;
use pilotage_collocation::Differentiated;
use pilotage_estimation::posed::unknowns::Meaning;
use pilotage_estimation::posed::unknowns::Parameters;
use pilotage_estimation::problem::control::First;
use pilotage_estimation::problem::control::Optimal;
use pilotage_estimation::problem::control::PartOf;
use pilotage_estimation::problem::file::Initial;
use pilotage_estimation::problem::file::ProblemFile;
use pilotage_estimation::problem::file::matching;
use pilotage_estimation::system::joint::Joint;
use pilotage_estimation::system::joint::unknown;
use pilotage_expression::Graph;
use pilotage_expression::Node;
use pilotage_expression::System;
use pilotage_language::file::Formula;
use std::collections::HashMap;
use std::sync::Arc;

/// The variables of the graph: τ, states, controls, slopes of controls, parameters.
pub(super) struct Assembly<'f> {
    pub(super) file: &'f ProblemFile,
    pub(super) optimal: &'f Optimal,
    pub(super) joint: Joint,
    pub(super) parameters: Parameters,
    pub(super) graph: Graph,
    pub(super) states: Vec<Variable>,
    pub(super) controls: Vec<Variable>,
    pub(super) sought: Vec<Variable>,
    pub(super) values: HashMap<String, Node>,
    /// Nodes and limits of the quantities along the path, at the start and at the end.
    pub(super) limited: [Vec<(Node, Limited)>; 3],
}

/// The expressions of a file, compiled.
pub(super) struct Compiled {
    pub(super) graph: Graph,
    pub(super) nodes: Vec<Node>,
    pub(super) signals: Vec<String>,
    pub(super) names: Vec<String>,
}

impl Assembly<'_> {
    pub(super) fn finish(mut self) -> Done<Posed> {
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
        self.constrain(&constraints, n, m, &initial)?;
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

    pub(super) fn find_states(&mut self) {
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

    pub(super) fn find_controls(&mut self) -> Done<()> {
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

    pub(super) fn find_sought(&mut self) {
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

    pub(super) fn sought(&mut self, name: &str) -> Option<Node> {
        let k = self.sought.iter().position(|own| own.name == name)?;
        let first = 1 + self.states.len() + 2 * self.controls.len();
        Some(self.graph.variable(first + k))
    }

    pub(super) fn seconds(&mut self) -> Node {
        match self.optimal.horizon.min < self.optimal.horizon.max {
            true => self.sought("duration").expect("it is sought"),
            false => self.graph.constant(self.optimal.horizon.start),
        }
    }

    pub(super) fn tied(&self) -> Vec<(String, Formula)> {
        let names = self.parameters.names.iter();
        let tied = names.filter_map(|name| match &self.parameters.meanings[name] {
            Meaning::Tied(formula) => Some((name.clone(), formula.clone())),
            Meaning::Number(_) | Meaning::Unknown(_) => None,
        });
        tied.collect()
    }

    /// States whose initial value is an expression in the file.
    pub(super) fn initial_formulas(&self) -> Vec<(usize, Formula)> {
        let states = self.joint.model.states.iter().enumerate();
        let found = states.filter_map(|(k, state)| match self.initial_line(state)? {
            Initial::Formula(formula) => Some((k, formula.clone())),
            _ => None,
        });
        found.collect()
    }

    /// The line of `[initial]` for a state: that with its name, else the last pattern.
    pub(super) fn initial_line(&self, state: &str) -> Option<&Initial> {
        let lines = || self.file.initial.iter();
        let own = lines().find(|(name, _)| name.value == state);
        let names = [state.to_owned()];
        let found =
            own.or_else(|| lines().rfind(|(name, _)| !matching(&name.value, &names).is_empty()));
        found.map(|(_, initial)| initial)
    }

    pub(super) fn posed(
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
            earlier: None,
            states: self.states,
            controls: self.controls,
            parameters: self.sought,
            initial,
        })
    }

    pub(super) fn of_controls(&self) -> Done<Vec<Control>> {
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
}
