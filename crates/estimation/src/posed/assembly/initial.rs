//! Initial states, and the values of variables where the search begins.

use super::inputs::{Key, Span};
use super::{Assembly, Done, Known};
use crate::posed::assembly::made::{Stands, State};
use crate::posed::data::{Rows, RunData};
use crate::posed::names::Of;
use crate::problem::error::ProblemError;
use crate::problem::file::{Initial, Measured, Quantity};
use pilotage_expression::Node;
use pilotage_text::document::Place;

impl Assembly<'_> {
    /// The states, and for each run the known initial values.
    pub(super) fn initial_states(&mut self, rows: &[Rows]) -> Done<(Vec<State>, Known)> {
        let (mut states, mut known) = (Vec::new(), vec![Vec::new(); rows.len()]);
        let joint = self.joint;
        for (name, start) in joint.model.states.iter().zip(self.start_nodes()) {
            let (state, values) = self.initial_state(name, start, rows)?;
            states.push(state);
            for (known, value) in known.iter_mut().zip(values) {
                known.push(value);
            }
        }
        for (unknown, stands) in self.parameters.unknowns.iter().zip(&self.stands) {
            if let Stands::State(_) = stands {
                let start = unknown.searched(unknown.start);
                states.push(State {
                    name: unknown.name.clone(),
                    nominal: unknown.searched_nominal(),
                    guesses: vec![start; rows.len()],
                    shift: None,
                });
                // A run that sets the parameter does not determine this value.
                for (run, known) in self.data.iter().zip(&mut known) {
                    known.push(run.line.is_set(&unknown.name).then_some(start));
                }
            }
        }
        if states.is_empty() {
            states.push(State::at_rest(rows.len()));
            known.iter_mut().for_each(|known| known.push(Some(0.0)));
        }
        Ok((states, known))
    }

    /// A state of the joint model, and its initial value in each run if known.
    fn initial_state(
        &mut self,
        name: &str,
        start: Node,
        rows: &[Rows],
    ) -> Done<(State, Vec<Option<f64>>)> {
        let line = self.initial_line(name);
        let declared = line.map(|line| &self.file.initial[line].1);
        let place = line.and_then(|line| self.file.initial[line].0.place.as_ref());
        let node = match (line, declared) {
            (Some(line), Some(Initial::Formula(_))) => {
                let values = self.values[1].clone();
                self.expressions(&[Of::Initial(line, name.to_owned())], None, &values)[0]
            }
            _ => start,
        };
        if self.varies(node) && self.depends_on_sought(node) {
            let fault = format!(
                "`{name}` begins with a parameter that is tied to the time; give it an initial value of its own"
            );
            return Err(ProblemError::maybe_at(place, fault));
        }
        let is_given = matches!(declared, None | Some(Initial::Formula(_)));
        let set = self.set_begin(name, is_given.then_some(node));
        let node = set.filter(|_| is_given).unwrap_or(node);
        let numbers = self.begins_at(name, node, rows, place)?;
        let (mut guesses, mut known, mut shift) = match declared {
            None | Some(Initial::Formula(_)) if self.depends_on_sought(node) => (
                vec![0.0; rows.len()],
                vec![Some(0.0); rows.len()],
                Some(node),
            ),
            None | Some(Initial::Formula(_)) => (
                numbers.clone(),
                numbers.into_iter().map(Some).collect(),
                None,
            ),
            Some(Initial::FirstSample) => {
                let first = self.samples_at_begin(name, place)?;
                (numbers, first.into_iter().map(Some).collect(), None)
            }
            Some(Initial::Free | Initial::Steady) => {
                let guesses = self.first_samples(name).unwrap_or(numbers);
                (guesses, vec![None; rows.len()], None)
            }
        };
        if let Some(set) = set.filter(|_| !is_given) {
            let own = self.begins_at(name, set, rows, place)?;
            shift = Some(set).filter(|set| self.depends_on_sought(*set));
            for j in (0..rows.len()).filter(|j| self.data[*j].line.is_set(name)) {
                guesses[j] = shift.map_or(own[j], |_| 0.0);
                known[j] = Some(guesses[j]);
            }
        }
        // What is added on the way is an offset that jumps: the state of the equations goes on as it was.
        if let Some(added) = self.added_node(name) {
            let before = shift.unwrap_or_else(|| self.graph.constant(0.0));
            shift = Some(self.graph.add(before, added));
        }
        let begin = shift.map_or(0.0, |shift| self.number(shift, &rows[0]));
        self.begins.push(begin + known[0].unwrap_or(guesses[0]));
        let about = self.joint.variables.get(name);
        let state = State {
            name: name.to_owned(),
            nominal: about.and_then(|about| about.nominal),
            guesses,
            shift,
        };
        Ok((state, known))
    }

    /// How a state begins where runs set it, and this node, or 0, where they do not; none if no run does.
    fn set_begin(&mut self, name: &str, elsewhere: Option<Node>) -> Option<Node> {
        let mut values = self.values[1].clone();
        let zero = self.graph.constant(0.0);
        values.insert(name.to_owned(), elsewhere.unwrap_or(zero));
        self.set_node(name, Span::Begin, &values)
    }

    /// Where a state begins in each run, with unknowns at their start values.
    fn begins_at(
        &self,
        name: &str,
        node: Node,
        rows: &[Rows],
        place: Option<&Place>,
    ) -> Done<Vec<f64>> {
        let numbers: Vec<f64> = rows.iter().map(|rows| self.number(node, rows)).collect();
        match numbers.iter().find(|number| !number.is_finite()) {
            None => Ok(numbers),
            Some(number) => {
                let fault = format!(
                    "`{name}` begins at {number} where the search starts; expected a finite number"
                );
                Err(ProblemError::maybe_at(place, fault))
            }
        }
    }

    /// The line of `[initial]` that applies to a state: the line with its name, else the last matching pattern.
    pub(super) fn initial_line(&self, state: &str) -> Option<usize> {
        self.file.initial_line(state)
    }

    /// Start values of the models.
    fn start_nodes(&mut self) -> Vec<Node> {
        let mut starts = Vec::new();
        for (instance, part) in &self.joint.parts {
            let variables = self.part_variables(instance, part, Span::Begin);
            let graph = &part.model.system.graph;
            starts.extend(self.graph.import(graph, &part.starts, &variables));
        }
        starts
    }

    /// Whether an expression depends on states or shared parameters.
    pub(super) fn depends_on_sought(&self, node: Node) -> bool {
        let inputs = self.input_variables();
        self.depends(node, |variable| variable > 0 && !inputs.contains(&variable))
    }

    /// Value of an expression at the start of a run, with unknowns at their start values.
    pub(super) fn number(&self, node: Node, rows: &Rows) -> f64 {
        self.graph.values(&self.begin_values(rows))[node.index()]
    }

    /// All variables at the start of a run, with unknowns at their start values and other states at 0.
    pub(super) fn begin_values(&self, rows: &Rows) -> Vec<f64> {
        let mut values = vec![0.0; self.variables()];
        values[0] = rows.time[0];
        values[self.input_variables()].copy_from_slice(&rows.inputs[0]);
        for (unknown, stands) in self.parameters.unknowns.iter().zip(&self.stands) {
            for variable in stands.variables(self.first_shared()) {
                values[variable] = unknown.searched(unknown.start);
            }
        }
        values
    }

    /// States and inputs of the joint model at the start of the first run, where it is linearised.
    pub(super) fn operating_point(&self, rows: &[Rows]) -> (Vec<f64>, Vec<f64>) {
        let values = self.graph.values(&self.begin_values(&rows[0]));
        let input = |name: &String| match self.input(&Key::Fed(name.clone())) {
            Some(input) => rows[0].inputs[0][input],
            None => values[self.values[0][name].index()],
        };
        let inputs = self.joint.model.inputs.iter().map(input);
        (self.begins.clone(), inputs.collect())
    }

    /// The sample of a state at the start of each run.
    fn samples_at_begin(&self, state: &str, place: Option<&Place>) -> Done<Vec<f64>> {
        let fault = |fault: String| ProblemError::maybe_at(place, fault);
        let measured = self.measured_as(state).ok_or_else(|| {
            fault(format!(
                "`{state}` begins at its first sample, but no [[measured]] has signal = \"{state}\" without gain and \
                 offset"
            ))
        })?;
        let measured = &self.file.measured[measured];
        let unit = measured.unit(self.joint);
        let sample = |run: &RunData<'_>| {
            // Its value is not taken.
            if run.line.is_set(state) {
                return Ok(0.0);
            }
            let values = run.column(&measured.column, unit)?;
            run.at_begin(&values).ok_or_else(|| {
                fault(format!(
                    "{}: the column `{}` has no sample at {}, where the run begins; write \"free\"",
                    run.line.file.display(),
                    measured.column.value,
                    run.shown(run.begin())
                ))
            })
        };
        self.data.iter().map(sample).collect()
    }

    /// The first measurement of a state in each run, if it is measured directly.
    fn first_samples(&self, state: &str) -> Option<Vec<f64>> {
        let measured = &self.file.measured[self.measured_as(state)?];
        let unit = measured.unit(self.joint);
        let first = |run: &RunData<'_>| {
            let values = run.column(&measured.column, unit).ok()?;
            values.into_iter().find(|value| value.is_finite())
        };
        self.data.iter().map(first).collect()
    }

    /// States that are measured directly, each with its first such measured signal.
    pub(super) fn measured_states(&self, states: &[State]) -> Vec<(usize, usize)> {
        let names = self.joint.model.states.iter().enumerate();
        let plain = names.filter(|(k, _)| states[*k].shift.is_none());
        let found = plain.filter_map(|(k, name)| Some((k, self.measured_as(name)?)));
        found.collect()
    }

    /// The first measured signal whose sensor shows a state directly.
    fn measured_as(&self, state: &str) -> Option<usize> {
        let is_it = |own: &Measured| match &own.of {
            Quantity::Signal(name) => self.is_state(name, state) && own.is_plain(),
            Quantity::Expression(..) => false,
        };
        self.file.measured.iter().position(is_it)
    }

    /// Whether a signal is a state, by its name or as an output that equals the state.
    fn is_state(&self, signal: &str, state: &str) -> bool {
        let node = |name: &str| self.joint.signal(name);
        signal == state || (node(signal).is_some() && node(signal) == node(state))
    }
}
