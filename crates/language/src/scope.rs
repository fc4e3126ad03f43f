//! Resolution of the names in expressions, and the order in which their values can be computed.

use crate::error::{Fault, ModelFileError};
use crate::file::{Formula, ModelFile, Variable};
use crate::functions::{self, Name};
use crate::syntax::{Expression, Part, Term};
use pilotage_text::suggestion::suggestion;
use std::collections::HashMap;

/// Meaning of a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Symbol {
    Time,
    Pi,
    Input(usize),
    Parameter(usize),
    State(usize),
    /// Locals, then outputs.
    Computed(usize),
}

/// The names of a file.
#[derive(Debug)]
pub(crate) struct Scope<'f> {
    file: &'f ModelFile,
    symbols: HashMap<&'f str, Symbol>,
    /// Indices of locals and outputs, each after those it depends on.
    pub(crate) order: Vec<usize>,
    /// True for locals and outputs that depend only on parameters and numbers.
    constant: Vec<bool>,
}

impl<'f> Scope<'f> {
    /// The names of a file; fails for unknown names and circles.
    pub(crate) fn of(file: &'f ModelFile) -> Result<Self, ModelFileError> {
        let mut symbols = HashMap::from([("time", Symbol::Time), ("pi", Symbol::Pi)]);
        let mut add = |list: &'f [Variable], symbol: &dyn Fn(usize) -> Symbol| {
            for (k, variable) in list.iter().enumerate() {
                symbols
                    .entry(variable.name.as_str())
                    .or_insert_with(|| symbol(k));
            }
        };
        add(&file.inputs, &Symbol::Input);
        add(&file.parameters, &Symbol::Parameter);
        add(&file.states, &Symbol::State);
        add(&file.locals, &Symbol::Computed);
        add(&file.outputs, &|k| Symbol::Computed(file.locals.len() + k));
        let mut scope = Self {
            file,
            symbols,
            order: Vec::new(),
            constant: vec![false; file.locals.len() + file.outputs.len()],
        };
        scope.sort()?;
        scope.check_constants()?;
        Ok(scope)
    }

    /// A local, or an output.
    pub(crate) fn computed(&self, k: usize) -> &'f Variable {
        let locals = self.file.locals.len();
        match k < locals {
            true => &self.file.locals[k],
            false => &self.file.outputs[k - locals],
        }
    }

    /// Meaning of a name in a checked expression.
    pub(crate) fn symbol(&self, name: &str) -> Symbol {
        self.symbols[name]
    }

    /// The expressions of derivatives and values, with their variables.
    pub(crate) fn formulas(&self) -> impl Iterator<Item = (&'f Variable, &'f Formula)> {
        let file = self.file;
        let all = file.states.iter().chain(&file.locals).chain(&file.outputs);
        all.filter_map(|variable| Some((variable, variable.value.as_ref()?)))
    }

    /// Resolves a name.
    fn resolve(&self, formula: &Formula, name: &str, part: Part) -> Result<Symbol, ModelFileError> {
        let error = |fault| self.file.at(formula.byte(part), fault);
        if let Some(&symbol) = self.symbols.get(name) {
            return match symbol {
                Symbol::Computed(k) if self.computed(k).limit.is_some() => {
                    Err(error(Fault::LimitedUsed(name.to_owned())))
                }
                _ => Ok(symbol),
            };
        }
        if let Some(function) = functions::find(name) {
            return Err(error(Fault::Uncalled {
                name: function.word,
                form: function.form,
            }));
        }
        let variables = self.file.variables().map(|(variable, _)| variable);
        let mut known: Vec<&str> = variables.map(|variable| variable.name.as_str()).collect();
        known.extend(crate::file::RESERVED);
        let mut seen = std::collections::HashSet::new();
        known.retain(|name| is_spelt(name) && seen.insert(*name));
        Err(error(Fault::UnknownName {
            name: name.to_owned(),
            suggestion: suggestion(name, known.iter().copied()).map(str::to_owned),
            known: listed(&known),
        }))
    }

    /// Determines the order of locals and outputs.
    fn sort(&mut self) -> Result<(), ModelFileError> {
        for (_, formula) in self.formulas() {
            for (name, part) in formula.expression.names() {
                self.resolve(formula, name, part)?;
            }
        }
        let count = self.constant.len();
        let mut takes: Vec<Vec<usize>> = vec![Vec::new(); count];
        let mut taken: Vec<Vec<usize>> = vec![Vec::new(); count];
        let mut constant = vec![true; count];
        for k in 0..count {
            let variable = self.computed(k);
            let Some(formula) = &variable.value else {
                // Another name of a state or local; no expression refers to this entry.
                constant[k] = false;
                continue;
            };
            for (name, _) in formula.expression.names() {
                match self.symbol(name) {
                    Symbol::Computed(other) => takes[k].push(other),
                    Symbol::Parameter(_) | Symbol::Pi => {}
                    _ => constant[k] = false,
                }
            }
            let mut terms = formula.expression.terms.iter();
            constant[k] &= !terms.any(|term| matches!(term, Term::Call(Name::Delay, _)));
            takes[k].sort_unstable();
            takes[k].dedup();
            takes[k].iter().for_each(|other| taken[*other].push(k));
        }
        let mut open: Vec<usize> = takes.iter().map(Vec::len).collect();
        let mut ready: Vec<usize> = (0..count).rev().filter(|k| open[*k] == 0).collect();
        while let Some(k) = ready.pop() {
            constant[k] &= takes[k].iter().all(|other| constant[*other]);
            self.order.push(k);
            for user in &taken[k] {
                open[*user] -= 1;
                if open[*user] == 0 {
                    ready.push(*user);
                }
            }
        }
        self.constant = constant;
        match (0..count).find(|k| open[*k] > 0) {
            Some(_) => Err(self.circle(&takes, &open)),
            None => Ok(()),
        }
    }

    /// Reports a circle among the variables that could not be ordered.
    fn circle(&self, takes: &[Vec<usize>], open: &[usize]) -> ModelFileError {
        let next = |k: usize| {
            let mut others = takes[k].iter().copied();
            others.find(|other| open[*other] > 0).unwrap_or(k)
        };
        let first = (0..open.len()).find(|k| open[*k] > 0).unwrap_or_default();
        let mut path = vec![first];
        let begin = loop {
            let following = next(path[path.len() - 1]);
            if let Some(begin) = path.iter().position(|k| *k == following) {
                break begin;
            }
            path.push(following);
        };
        let circle = path[begin..].iter().chain([&path[begin]]);
        let names: Vec<&str> = circle.map(|k| self.computed(*k).name.as_str()).collect();
        let variable = self.computed(path[begin]);
        self.file
            .at(variable.byte, Fault::Circle(names.join(" → ")))
    }

    /// Rejects start values, limits and delay times that change in time.
    fn check_constants(&self) -> Result<(), ModelFileError> {
        for state in &self.file.states {
            self.check_constant("the start value of a state", &state.start, None)?;
        }
        for output in &self.file.outputs {
            for limit in output.limit.iter().flatten() {
                self.check_constant("a limit", limit, None)?;
            }
        }
        for (_, formula) in self.formulas() {
            for term in &formula.expression.terms {
                if let Term::Call(Name::Delay, arguments) = term {
                    self.check_constant("the time of a delay", formula, Some(arguments[1]))?;
                }
            }
        }
        Ok(())
    }

    /// Rejects an expression, or a part of it, that does not only depend on parameters and numbers.
    pub(crate) fn check_constant(
        &self,
        what: &'static str,
        formula: &Formula,
        part: Option<Part>,
    ) -> Result<(), ModelFileError> {
        self.check_constant_but(what, formula, part, &[])
    }

    /// The same, where the time may be taken if some locals may: directly, and by these.
    pub(crate) fn check_constant_but(
        &self,
        what: &'static str,
        formula: &Formula,
        part: Option<Part>,
        over_time: &[bool],
    ) -> Result<(), ModelFileError> {
        let within = subtree(&formula.expression, part);
        for (name, part) in formula.expression.names() {
            if !within[part] {
                continue;
            }
            let role = match self.resolve(formula, name, part)? {
                Symbol::Parameter(_) | Symbol::Pi => continue,
                Symbol::Computed(k) if self.constant[k] => continue,
                Symbol::Computed(k) if over_time.get(k) == Some(&true) => continue,
                Symbol::Time if !over_time.is_empty() => continue,
                Symbol::Time => "the time",
                Symbol::Input(_) => "an input",
                Symbol::State(_) => "a state",
                Symbol::Computed(k) if k < self.file.locals.len() => "a local",
                Symbol::Computed(_) => "an output",
            };
            let name = name.to_owned();
            let fault = Fault::NotConstant { what, name, role };
            return Err(self.file.at(formula.byte(part), fault));
        }
        let terms = formula.expression.terms.iter().zip(&within);
        let mut delays =
            terms.filter(|(term, within)| **within && matches!(term, Term::Call(Name::Delay, _)));
        match delays.next().is_some() {
            true => {
                let (name, role) = ("delay".to_owned(), "a function of time");
                let fault = Fault::NotConstant { what, name, role };
                Err(self.file.at(formula.byte(0), fault))
            }
            false => Ok(()),
        }
    }
}

/// True if this name can be used in an expression.
pub(crate) fn is_spelt(name: &str) -> bool {
    name.chars()
        .all(|c| c.is_alphanumeric() || c == '_' || c == '.')
}

/// The first names of a list, and the number of the others.
fn listed(names: &[&str]) -> String {
    const MOST: usize = 30;
    let shown = names[..names.len().min(MOST)].join(", ");
    match names.len().checked_sub(MOST) {
        None | Some(0) => shown,
        Some(more) => format!("{shown} and {more} more"),
    }
}

/// True for the parts that belong to a part, or to the whole expression.
fn subtree(expression: &Expression, part: Option<Part>) -> Vec<bool> {
    let mut within = vec![false; expression.terms.len()];
    within[part.unwrap_or(expression.whole())] = true;
    for k in (0..within.len()).rev() {
        if within[k] {
            let parts = expression.terms[k].parts();
            parts.into_iter().for_each(|part| within[part] = true);
        }
    }
    within
}
