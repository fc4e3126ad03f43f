//! The inputs of the equations: columns, values set by runs, and subjects.

use super::{Assembly, Done};
use crate::posed::data::{RunData, Source};
use crate::posed::unknowns::Meaning;
use crate::problem::error::ProblemError;
use crate::problem::file::{Deviation, Hold, Noise, Set};
use crate::system::joint::unknown;
use pilotage_cosim::description::Spanned;
use pilotage_expression::Node;
use pilotage_language::file::Formula;

/// Number of clocks.
pub(super) const CLOCKS: usize = 3;

/// Origin of an input of the equations.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum Key {
    /// A column that drives an input.
    Fed(String),
    /// A column in an expression.
    Column(String),
    /// A parameter set by runs: its number, or 0 where it is an expression.
    Value(String, Span),
    /// 1 where a parameter set by runs is this expression, or its unset value if none; else 0.
    Case(String, Option<String>, Span),
    /// What a run has added to a state until now: all numbers, or how often it has added this expression.
    Added(String, Option<String>),
    /// Whether a run is of this subject.
    Subject(String),
    /// Recorded values of the measured signal of this number.
    Recorded(usize),
    /// Whether that signal has a recorded value.
    Presence(usize),
    /// Noise level of that signal.
    Deviation(usize),
    /// Time since the run began: at the begin and the end of a part of the mesh, and at the point itself.
    Clock(usize),
    /// Number of the run.
    Number,
}

/// Part of a run for which a set value is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Span {
    /// The whole run.
    Run,
    /// Its start only, for initial states.
    Begin,
}

/// Values of a parameter in a run and the times from which they hold. None for its unset value.
type Timeline<'r> = Vec<(f64, Option<&'r Formula>)>;

impl Assembly<'_> {
    pub(super) fn find_columns(&mut self) -> Done<()> {
        for fed in &self.file.inputs {
            let name = &fed.signal.value;
            self.check_fed(&fed.signal)?;
            let source = Source::Column {
                name: fed.column.clone(),
                unit: self.joint.unit(name).map(str::to_owned),
                hold: fed.hold.unwrap_or(Hold::Linear),
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
        (0..self.file.measured.len()).for_each(|k| self.find_measured(k));
        if self.joint.delayed().next().is_some() {
            let clocks = (0..CLOCKS).map(|k| (Key::Clock(k), Source::Elapsed));
            self.sources.extend(clocks);
            let number = |j: usize| vec![(f64::NEG_INFINITY, j as f64)];
            let numbers = (0..self.data.len()).map(number).collect();
            self.sources.push((Key::Number, Source::Given(numbers)));
        }
        Ok(())
    }

    /// Rejects columns for signals that are not free inputs.
    fn check_fed(&self, signal: &Spanned<String>) -> Done<()> {
        let name = &signal.value;
        let inputs = &self.joint.model.inputs;
        if inputs.contains(name) {
            return Ok(());
        }
        let fault = match self.joint.driven.contains_key(name) {
            true => format!("`{name}` is driven by a wire; leave the wire or the column out"),
            false => unknown("free input", name, inputs),
        };
        Err(ProblemError::maybe_at(signal.place.as_ref(), fault))
    }

    /// Adds the columns of a measured signal that appear in the equations.
    fn find_measured(&mut self, k: usize) {
        let measured = &self.file.measured[k];
        let unit = measured.unit(self.joint);
        let source = |name: &Spanned<String>| Source::Column {
            name: name.clone(),
            unit: unit.map(str::to_owned),
            hold: Hold::Linear,
            missing: Some(1.0),
        };
        if self.is_scaled(k) {
            let presence = Source::Presence(measured.column.clone());
            self.sources
                .push((Key::Recorded(k), source(&measured.column)));
            self.sources.push((Key::Presence(k), presence));
        }
        if let Deviation::Column(name) = &measured.sd {
            self.sources.push((Key::Deviation(k), source(name)));
        }
    }

    /// Whether the equations divide the residual by the noise level: unless that is a number.
    pub(super) fn is_scaled(&self, k: usize) -> bool {
        let measured = &self.file.measured[k];
        let number = match &measured.sd {
            Deviation::Formula(formula) => formula.number(),
            Deviation::Column(_) => None,
        };
        number.is_none() || measured.noise != Noise::Normal
    }

    /// Values set by runs: inputs that are constant in each run or jump at its changes.
    pub(super) fn find_sets(&mut self) -> Done<()> {
        let sets: Vec<&Set> = (self.data.iter()).flat_map(|run| run.line.sets()).collect();
        let mut names: Vec<&String> = Vec::new();
        for set in &sets {
            if !names.contains(&&set.name.value) {
                names.push(&set.name.value);
            }
        }
        for name in &names {
            for set in sets.iter().filter(|set| set.name.value == **name) {
                let mut taken = set.value.names();
                if let Some(other) = taken.find(|other| names.iter().any(|own| own == other)) {
                    let fault = format!("`{other}` is set by runs itself; write its value here");
                    return Err(ProblemError::maybe_at(set.name.place.as_ref(), fault));
                }
            }
            if !self.joint.model.states.contains(name) {
                self.find_set(name, Span::Run);
            }
            self.find_set(name, Span::Begin);
        }
        self.find_added();
        Ok(())
    }

    /// Adds the inputs that jump where runs add to states.
    fn find_added(&mut self) {
        let text = |set: &Set| match set.value.number() {
            Some(_) => None,
            None => Some(set.value.expression.text.clone()),
        };
        for set in self.data.iter().flat_map(|run| run.line.added()) {
            let key = Key::Added(set.name.value.clone(), text(set));
            if self.input(&key).is_some() {
                continue;
            }
            let is_own =
                |other: &&Set| other.name.value == set.name.value && text(other) == text(set);
            let of_run = |run: &RunData<'_>| {
                let mut sum = 0.0;
                let mut line = vec![(f64::NEG_INFINITY, sum)];
                for (time, change) in run.changes() {
                    let own = change.add.iter().filter(is_own);
                    sum += own
                        .map(|own| own.value.number().unwrap_or(1.0))
                        .sum::<f64>();
                    line.push((time, sum));
                }
                line
            };
            let values = self.data.iter().map(of_run).collect();
            self.sources.push((key, Source::Given(values)));
        }
    }

    /// Adds the inputs that give a parameter the values set by runs: the numbers, and which expression applies when.
    fn find_set(&mut self, name: &str, span: Span) {
        let timelines: Vec<Timeline<'_>> = (self.data.iter())
            .map(|run| timeline(run, name, span))
            .collect();
        let elsewhere = match self.parameters.meanings.get(name) {
            Some(Meaning::Number(value)) => Some(*value),
            _ => None,
        };
        let number = |formula: Option<&Formula>| formula.map_or(elsewhere, Formula::number);
        let given = |of: &dyn Fn(Option<&Formula>) -> f64| {
            let of_run = |line: &Timeline<'_>| {
                let values = line.iter().map(|(time, formula)| (*time, of(*formula)));
                values.collect()
            };
            Source::Given(timelines.iter().map(of_run).collect())
        };
        let key = Key::Value(name.to_owned(), span);
        let numbers = given(&|formula| number(formula).unwrap_or(0.0));
        self.sources.push((key, numbers));
        let text = |formula: Option<&Formula>| formula.map(|own| own.expression.text.clone());
        let mut cases: Vec<Option<String>> = Vec::new();
        for (_, formula) in timelines.iter().flatten() {
            let case = text(*formula);
            if number(*formula).is_none() && !cases.contains(&case) {
                cases.push(case);
            }
        }
        for case in cases {
            let is_case = given(&|formula| f64::from(text(formula) == case));
            let key = Key::Case(name.to_owned(), case, span);
            self.sources.push((key, is_case));
        }
    }

    /// Adds an input that is 1 in the runs of a subject.
    pub(super) fn find_subject(&mut self, subject: &str) {
        let key = Key::Subject(subject.to_owned());
        if self.input(&key).is_some() {
            return;
        }
        let is_own = |run: &RunData<'_>| f64::from(run.line.subject.as_deref() == Some(subject));
        let of_run = |run: &RunData<'_>| vec![(f64::NEG_INFINITY, is_own(run))];
        let values = self.data.iter().map(of_run).collect();
        self.sources.push((key, Source::Given(values)));
    }

    /// Index of an input.
    pub(super) fn input(&self, key: &Key) -> Option<usize> {
        self.sources.iter().position(|(own, _)| own == key)
    }

    /// The variable of an input.
    pub(super) fn input_node(&mut self, key: &Key) -> Option<Node> {
        let input = self.input(key)?;
        Some(self.graph.variable(1 + self.states + input))
    }
}

fn timeline<'r>(run: &'r RunData<'_>, name: &str, span: Span) -> Timeline<'r> {
    let find = |sets: &'r [Set]| {
        let set = sets.iter().find(|set| set.name.value == name);
        set.map(|set| &set.value)
    };
    let mut line = vec![(f64::NEG_INFINITY, find(&run.line.set))];
    if span == Span::Run {
        line.extend(
            run.changes()
                .filter_map(|(time, change)| Some((time, Some(find(&change.set)?)))),
        );
    }
    line
}
