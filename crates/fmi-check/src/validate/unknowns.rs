//! Each unknown of the model structure and its dependencies.

use super::*;

/// The lists of `<ModelStructure>`.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum List {
    Outputs,
    Derivatives,
    ClockedStates,
    InitialUnknowns,
    EventIndicators,
}

impl List {
    /// The list's element in FMI 2.0; the element of each item in FMI 3.0.
    pub(super) fn name(self, version: FmiVersion) -> &'static str {
        match (self, version) {
            (Self::Outputs, FmiVersion::V2) => "Outputs",
            (Self::Outputs, FmiVersion::V3) => "Output",
            (Self::Derivatives, FmiVersion::V2) => "Derivatives",
            (Self::Derivatives, FmiVersion::V3) => "ContinuousStateDerivative",
            (Self::ClockedStates, _) => "ClockedState",
            (Self::InitialUnknowns, FmiVersion::V2) => "InitialUnknowns",
            (Self::InitialUnknowns, FmiVersion::V3) => "InitialUnknown",
            (Self::EventIndicators, _) => "EventIndicator",
        }
    }
}

impl Checker<'_> {
    pub(super) fn unknowns(&mut self, list: List, unknowns: &[Unknown], places: &[Place]) {
        let count = self.description.variables.len();
        let mut seen = BTreeSet::new();
        let mut previous = 0;
        for (unknown, &place) in unknowns.iter().zip(places) {
            let index = unknown.index;
            let Some(variable) = self.at(index) else {
                // The reader of FMI 3.0 has reported it.
                if !self.is_v3() {
                    self.report(place, self.no_such_index(list, index, count));
                }
                continue;
            };
            let handle = self.handle(index);
            let name = self.list_name(list);
            if !seen.insert(index) {
                let rule = Rule::DuplicateUnknown {
                    list: name,
                    variable: handle,
                };
                self.report(place, rule);
            } else if list == List::InitialUnknowns && !self.is_v3() && index < previous {
                let rule = Rule::UnorderedUnknowns {
                    list: name,
                    variable: handle,
                    previous,
                };
                self.report(place, rule);
            }
            previous = previous.max(index);
            self.kinds(list, unknown, variable, place);
            self.dependencies(list, unknown, place);
        }
        let undeclared = unknowns.iter().filter(|u| u.dependencies.is_none());
        let undeclared = undeclared.count();
        let matters = !matches!(list, List::ClockedStates | List::EventIndicators);
        if undeclared > 0 && matters {
            let rule = Rule::DependenciesNotDeclared {
                list: self.list_name(list),
                count: undeclared,
            };
            self.report(places[0], rule);
        }
    }

    fn kinds(&mut self, list: List, unknown: &Unknown, variable: &ScalarVariable, place: Place) {
        let handle = self.handle(unknown.index);
        for &kind in unknown.dependencies_kind.iter().flatten() {
            let allowed = [DependencyKind::Dependent, DependencyKind::Constant];
            if list == List::InitialUnknowns && !allowed.contains(&kind) {
                let list = self.list_name(list);
                self.report(place, Rule::InitialKind { list, kind });
            } else if kind != DependencyKind::Dependent && !variable.kind.base_type().is_real() {
                let rule = Rule::KindNotReal {
                    variable: handle,
                    name: variable.name.clone(),
                    kind,
                };
                self.report(place, rule);
            }
        }
        match (&unknown.dependencies, &unknown.dependencies_kind) {
            (None, Some(_)) => {
                let variable = handle;
                self.report(place, Rule::KindsWithoutDependencies { variable });
            }
            (Some(dependencies), Some(kinds)) if dependencies.len() != kinds.len() => {
                let rule = Rule::KindCount {
                    variable: handle,
                    dependencies: dependencies.len(),
                    kinds: kinds.len(),
                };
                self.report(place, rule);
            }
            _ => {}
        }
    }

    fn dependencies(&mut self, list: List, unknown: &Unknown, place: Place) {
        let handle = self.handle(unknown.index);
        let Some(dependencies) = &unknown.dependencies else {
            return;
        };
        // FMI 3.0 requires no order, and value references need not follow the order of variables.
        if !self.is_v3() && !dependencies.is_sorted() {
            let variable = handle;
            self.report(place, Rule::UnsortedDependencies { variable });
        }
        let mut seen = BTreeSet::new();
        for &known in dependencies {
            if self.is_v3() && known == 0 {
                continue;
            }
            if !seen.insert(known) {
                let rule = Rule::DuplicateKnown {
                    variable: handle,
                    known: self.number(known),
                };
                self.report(place, rule);
            }
            let rule = self.bad_known(list, handle, known);
            rule.into_iter().for_each(|rule| self.report(place, rule));
        }
    }

    fn bad_known(&self, list: List, unknown: Handle, known: u32) -> Option<Rule> {
        let Some(variable) = self.at(known) else {
            let count = self.description.variables.len();
            return Some(self.no_such_index(list, known, count));
        };
        (!self.is_known(list, known, variable)).then(|| Rule::BadKnown {
            variable: unknown,
            known: self.number(known),
            name: variable.name.clone(),
            causality: variable.causality,
        })
    }

    /// Knowns of initial unknowns are inputs, variables with initial exact and time. Those of the other lists are
    /// inputs, continuous states and time; in FMI 3.0 also parameters, clocks and discrete states, which cannot be
    /// distinguished from other discrete variables.
    fn is_known(&self, list: List, index: u32, variable: &ScalarVariable) -> bool {
        let is_exact = variable.effective_initial() == Some(Initial::Exact);
        match variable.causality {
            Causality::Input | Causality::Independent => true,
            _ if list == List::InitialUnknowns => is_exact,
            Causality::Parameter | Causality::StructuralParameter if self.is_v3() => true,
            Causality::Local | Causality::Output
                if self.is_v3() && variable.variability == Variability::Discrete =>
            {
                true
            }
            _ => self.states.contains(&index),
        }
    }

    /// The number of a variable in the XML: its index or its value reference.
    fn number(&self, index: u32) -> u32 {
        match self.handle(index) {
            Handle::Index(number) | Handle::Reference(number) => number,
        }
    }

    fn no_such_index(&self, list: List, index: u32, count: usize) -> Rule {
        Rule::NoSuchIndex {
            list: self.list_name(list),
            index,
            count,
        }
    }
}
