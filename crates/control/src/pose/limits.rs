//! How states begin and end, and what is limited.

use super::Done;
use super::Limited;
use super::assembly::Assembly;
use super::at;
use crate::program::Limits;
use pilotage_estimation::ProblemError;
use pilotage_estimation::problem::file::Holds;
use pilotage_estimation::problem::file::Initial;
use pilotage_expression::Node;
use pilotage_text::document::Place;

impl Assembly<'_> {
    /// How the states begin: numbers, or equations at the start.
    pub(super) fn begin(
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

    pub(super) fn end(&mut self, finals: Vec<Node>) -> Done<()> {
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

    pub(super) fn constrain(
        &mut self,
        nodes: &[Node],
        n: usize,
        m: usize,
        initial: &[Option<f64>],
    ) -> Done<()> {
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
            let start = match place < 2 {
                true => self.at_known_start(*node, initial),
                false => None,
            };
            // What does not change along the path holds if it holds at the start.
            let place = if depends[node.index()] { place } else { 1 };
            let name = match own.at {
                Holds::End => format!("{name} at the end"),
                _ => name,
            };
            let mut own = limited(name, Some(own.place.clone()), (own.min, own.max));
            own.start = start;
            self.limited[place].push((*node, own));
        }
        Ok(())
    }

    /// Value at the start of what depends on known initial states alone.
    fn at_known_start(&self, node: Node, initial: &[Option<f64>]) -> Option<f64> {
        let is_free = |variable: usize| match variable.checked_sub(1) {
            Some(k) => initial.get(k).is_none_or(Option::is_none),
            None => false,
        };
        if self.graph.dependants(is_free)[node.index()] {
            return None;
        }
        let parts = self.optimal.objective.parts.len();
        let mut values = vec![0.0; self.part_variable(0) + parts];
        for (value, known) in values[1..].iter_mut().zip(initial) {
            *value = known.unwrap_or(0.0);
        }
        Some(self.graph.values(&values)[node.index()])
    }

    pub(super) fn limit_controls(&mut self, limits: &[[Option<Node>; 2]]) -> Done<()> {
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
}

pub(super) fn limited(name: String, place: Option<Place>, limits: Limits) -> Limited {
    Limited {
        name,
        place,
        limits,
        size: 1.0,
        start: None,
    }
}

/// Magnitude of a limited quantity: its largest limit, else what it is where the search begins.
pub(super) fn size(limits: Limits, values: impl Iterator<Item = f64>) -> f64 {
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
