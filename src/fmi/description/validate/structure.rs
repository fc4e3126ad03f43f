//! The model structure (FMI 2.0, section 2.2.8).

use super::*;
use std::collections::BTreeSet;

/// The lists of `<ModelStructure>`.
#[derive(Clone, Copy, PartialEq, Eq)]
enum List {
    Outputs,
    Derivatives,
    InitialUnknowns,
}

impl List {
    fn name(self) -> &'static str {
        match self {
            Self::Outputs => "Outputs",
            Self::Derivatives => "Derivatives",
            Self::InitialUnknowns => "InitialUnknowns",
        }
    }
}

impl Checker<'_> {
    pub(super) fn structure(&mut self) {
        let structure = &self.description.structure;
        let places = self.places;
        self.list(List::Outputs, &structure.outputs, &places.outputs);
        self.list(
            List::Derivatives,
            &structure.derivatives,
            &places.derivatives,
        );
        self.list(
            List::InitialUnknowns,
            &structure.initial_unknowns,
            &places.initial_unknowns,
        );
        self.members();
    }

    fn list(&mut self, list: List, unknowns: &[Unknown], places: &[Place]) {
        let count = self.description.variables.len();
        let mut seen = BTreeSet::new();
        let mut previous = 0;
        for (unknown, &place) in unknowns.iter().zip(places) {
            let index = unknown.index;
            if index == 0 || index as usize > count {
                self.report(place, no_such_index(list, index, count));
                continue;
            }
            if !seen.insert(index) {
                let list = list.name();
                self.report(place, Rule::DuplicateUnknown { list, index });
            } else if list == List::InitialUnknowns && index < previous {
                self.report(place, Rule::UnorderedUnknowns { index, previous });
            }
            previous = previous.max(index);
            self.dependencies(list, unknown, place);
        }
        let undeclared = unknowns.iter().filter(|u| u.dependencies.is_none());
        let undeclared = undeclared.count();
        if undeclared > 0 {
            let rule = Rule::DependenciesNotDeclared {
                list: list.name(),
                count: undeclared,
            };
            self.report(places[0], rule);
        }
    }

    fn dependencies(&mut self, list: List, unknown: &Unknown, place: Place) {
        let index = unknown.index;
        for &kind in unknown.dependencies_kind.iter().flatten() {
            let allowed = [DependencyKind::Dependent, DependencyKind::Constant];
            if list == List::InitialUnknowns && !allowed.contains(&kind) {
                self.report(place, Rule::InitialKind { kind });
            }
        }
        let Some(dependencies) = &unknown.dependencies else {
            if unknown.dependencies_kind.is_some() {
                self.report(place, Rule::KindsWithoutDependencies { index });
            }
            return;
        };
        if let Some(kinds) = &unknown.dependencies_kind
            && kinds.len() != dependencies.len()
        {
            let rule = Rule::KindCount {
                index,
                dependencies: dependencies.len(),
                kinds: kinds.len(),
            };
            self.report(place, rule);
        }
        if !dependencies.is_sorted() {
            self.report(place, Rule::UnsortedDependencies { index });
        }
        let mut seen = BTreeSet::new();
        for &known in dependencies {
            if !seen.insert(known) {
                self.report(place, Rule::DuplicateKnown { index, known });
            }
            let rule = self.bad_known(list, index, known);
            rule.into_iter().for_each(|rule| self.report(place, rule));
        }
    }

    /// Knowns of outputs and derivatives are inputs, continuous states and time; those of initial
    /// unknowns are inputs, variables with initial exact and time.
    fn bad_known(&self, list: List, index: u32, known: u32) -> Option<Rule> {
        let variables = &self.description.variables;
        let position = (known as usize).checked_sub(1);
        let Some(variable) = position.and_then(|p| variables.get(p)) else {
            return Some(no_such_index(list, known, variables.len()));
        };
        let is_known = match variable.causality {
            Causality::Input | Causality::Independent => true,
            _ if list == List::InitialUnknowns => {
                variable.effective_initial() == Some(Initial::Exact)
            }
            _ => self.states.contains(&known),
        };
        (!is_known).then(|| Rule::BadKnown {
            index,
            known,
            name: variable.name.clone(),
            causality: variable.causality,
        })
    }

    /// Whether each list holds just what it must.
    fn members(&mut self) {
        let structure = &self.description.structure;
        let place = self.places.structure;
        let required = self.required_initial_unknowns();
        let listed =
            |unknowns: &[Unknown]| -> BTreeSet<u32> { unknowns.iter().map(|u| u.index).collect() };
        let outputs = listed(&structure.outputs);
        let initial = listed(&structure.initial_unknowns);
        let mut rules = Vec::new();
        for (position, variable) in self.description.variables.iter().enumerate() {
            let (index, name) = (position as u32 + 1, &variable.name);
            let is_output = variable.causality == Causality::Output;
            let missing = |list: List| Rule::MissingUnknown {
                list: list.name(),
                index,
                name: name.clone(),
            };
            match (is_output, outputs.contains(&index)) {
                (true, false) => rules.push(missing(List::Outputs)),
                (false, true) => rules.push(Rule::NotAnOutput {
                    index,
                    name: name.clone(),
                    causality: variable.causality,
                }),
                _ => {}
            }
            match (required.contains(&index), initial.contains(&index)) {
                (true, false) => rules.push(missing(List::InitialUnknowns)),
                (false, true) => rules.push(Rule::NotInitial {
                    index,
                    name: name.clone(),
                }),
                _ => {}
            }
        }
        for unknown in &structure.derivatives {
            let position = (unknown.index as usize).checked_sub(1);
            let variable = position.and_then(|p| self.description.variables.get(p));
            if let (Some(variable), None) =
                (variable, derivative_of(self.description, unknown.index))
            {
                rules.push(Rule::NotADerivative {
                    index: unknown.index,
                    name: variable.name.clone(),
                });
            }
        }
        for rule in rules {
            self.report(place, rule);
        }
    }

    /// Outputs, states and derivatives with initial approx or calculated, and calculated parameters.
    fn required_initial_unknowns(&self) -> BTreeSet<u32> {
        let mut candidates = self.states.clone();
        candidates.extend(
            self.description
                .structure
                .derivatives
                .iter()
                .map(|u| u.index),
        );
        let is_required = |(position, variable): (usize, &ScalarVariable)| {
            let index = position as u32 + 1;
            let computed = matches!(
                variable.effective_initial(),
                Some(Initial::Approx | Initial::Calculated)
            );
            let listed = match variable.causality {
                Causality::Output => computed,
                Causality::CalculatedParameter => true,
                _ => computed && candidates.contains(&index),
            };
            listed.then_some(index)
        };
        let variables = self.description.variables.iter().enumerate();
        variables.filter_map(is_required).collect()
    }
}

/// Indices (from 1) of the continuous states: what the listed derivatives are derivatives of.
pub(super) fn states(description: &ModelDescription) -> BTreeSet<u32> {
    let derivatives = &description.structure.derivatives;
    derivatives
        .iter()
        .filter_map(|u| derivative_of(description, u.index))
        .collect()
}

/// The attribute `derivative` of the variable of that index (from 1).
fn derivative_of(description: &ModelDescription, index: u32) -> Option<u32> {
    let position = (index as usize).checked_sub(1)?;
    match &description.variables.get(position)?.kind {
        VariableKind::Real(real) => real.derivative,
        _ => None,
    }
}

fn no_such_index(list: List, index: u32, count: usize) -> Rule {
    Rule::NoSuchIndex {
        list: list.name(),
        index,
        count,
    }
}
