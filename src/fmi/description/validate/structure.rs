//! Whether the lists of the model structure hold just what they must (FMI 2.0, section 2.2.8; FMI 3.0,
//! section 2.4.8).

use super::states::{derivative_of, is_continuous_real};
use super::unknowns::List;
use super::*;

impl Checker<'_> {
    pub(super) fn structure(&mut self) {
        let structure = &self.description.structure;
        let places = self.places;
        for (list, unknowns, places) in [
            (List::Outputs, &structure.outputs, &places.outputs),
            (
                List::Derivatives,
                &structure.derivatives,
                &places.derivatives,
            ),
            (
                List::ClockedStates,
                &structure.clocked_states,
                &places.clocked_states,
            ),
            (
                List::InitialUnknowns,
                &structure.initial_unknowns,
                &places.initial_unknowns,
            ),
            (
                List::EventIndicators,
                &structure.event_indicators,
                &places.event_indicators,
            ),
        ] {
            self.unknowns(list, unknowns, places);
        }
        let mut rules = self.outputs();
        rules.extend(self.initial_unknowns());
        rules.extend(self.derivatives());
        rules.extend(self.clocked_states());
        rules.extend(self.event_indicators());
        for rule in rules {
            self.report(places.structure, rule);
        }
    }

    /// Name of a list in the XML.
    pub(super) fn list_name(&self, list: List) -> &'static str {
        list.name(self.version)
    }

    /// How the XML refers to the variable of that index (from 1).
    pub(super) fn handle(&self, index: u32) -> Handle {
        match (self.version, self.at(index)) {
            (FmiVersion::V3, Some(variable)) => Handle::Reference(variable.value_reference),
            _ => Handle::Index(index),
        }
    }

    fn missing(&self, list: List, index: u32, variable: &ScalarVariable) -> Rule {
        Rule::MissingUnknown {
            list: self.list_name(list),
            variable: self.handle(index),
            name: variable.name.clone(),
        }
    }

    fn outputs(&self) -> Vec<Rule> {
        let listed = indices(&self.description.structure.outputs);
        let list = List::Outputs;
        let rule = |(index, variable): (u32, &ScalarVariable)| {
            let is_output = variable.causality == Causality::Output;
            match (is_output, listed.contains(&index)) {
                (true, false) => Some(self.missing(list, index, variable)),
                (false, true) => Some(Rule::NotAnOutput {
                    list: self.list_name(list),
                    variable: self.handle(index),
                    name: variable.name.clone(),
                    causality: variable.causality,
                }),
                _ => None,
            }
        };
        (1..)
            .zip(&self.description.variables)
            .filter_map(rule)
            .collect()
    }

    /// Outputs, states and derivatives with initial approx or calculated, and calculated parameters.
    /// In FMI 3.0 clocked variables may be listed, or not.
    fn initial_unknowns(&self) -> Vec<Rule> {
        let structure = &self.description.structure;
        let listed = indices(&structure.initial_unknowns);
        let derivatives = indices(&structure.derivatives);
        let list = List::InitialUnknowns;
        let rule = |(index, variable): (u32, &ScalarVariable)| {
            let is_free = !variable.clocks.is_empty()
                || (variable.kind.base_type() == BaseType::Clock
                    && variable.causality == Causality::Output);
            let computed = matches!(
                variable.effective_initial(),
                Some(Initial::Approx | Initial::Calculated)
            );
            let is_required = match variable.causality {
                Causality::Output => computed,
                Causality::CalculatedParameter => true,
                _ => computed && (self.states.contains(&index) || derivatives.contains(&index)),
            };
            match (is_required, listed.contains(&index)) {
                _ if is_free => None,
                (true, false) => Some(self.missing(list, index, variable)),
                (false, true) => Some(Rule::NotInitial {
                    list: self.list_name(list),
                    variable: self.handle(index),
                    name: variable.name.clone(),
                }),
                _ => None,
            }
        };
        (1..)
            .zip(&self.description.variables)
            .filter_map(rule)
            .collect()
    }

    fn derivatives(&self) -> Vec<Rule> {
        let list = self.list_name(List::Derivatives);
        let mut rules = Vec::new();
        let mut first: HashMap<u32, u32> = HashMap::new();
        for unknown in &self.description.structure.derivatives {
            let Some(variable) = self.at(unknown.index) else {
                continue;
            };
            let (handle, name) = (self.handle(unknown.index), variable.name.clone());
            let Some(state) = derivative_of(variable) else {
                rules.push(Rule::NotADerivative {
                    list,
                    variable: handle,
                    name,
                });
                continue;
            };
            if !is_continuous_real(variable) {
                rules.push(Rule::NotContinuous {
                    list,
                    variable: handle,
                    name: name.clone(),
                });
            }
            let before = *first.entry(state).or_insert(unknown.index);
            if let (true, Some(other), Some(state)) =
                (before != unknown.index, self.at(before), self.at(state))
            {
                rules.push(Rule::TwoDerivatives {
                    list,
                    state: state.name.clone(),
                    first: other.name.clone(),
                    second: name,
                });
            }
        }
        rules
    }

    fn clocked_states(&self) -> Vec<Rule> {
        let listed = indices(&self.description.structure.clocked_states);
        let list = List::ClockedStates;
        let rule = |(index, variable): (u32, &ScalarVariable)| match (
            variable.previous.is_some(),
            listed.contains(&index),
        ) {
            (true, false) => Some(self.missing(list, index, variable)),
            (false, true) => Some(Rule::NotAClockedState {
                list: self.list_name(list),
                variable: self.handle(index),
                name: variable.name.clone(),
            }),
            _ => None,
        };
        (1..)
            .zip(&self.description.variables)
            .filter_map(rule)
            .collect()
    }

    fn event_indicators(&self) -> Vec<Rule> {
        let unknowns = self.description.structure.event_indicators.iter();
        let rule = |unknown: &Unknown| {
            let variable = self.at(unknown.index)?;
            (!is_continuous_real(variable)).then(|| Rule::NotContinuous {
                list: self.list_name(List::EventIndicators),
                variable: self.handle(unknown.index),
                name: variable.name.clone(),
            })
        };
        unknowns.filter_map(rule).collect()
    }
}

/// Indices of the variables in a list.
fn indices(unknowns: &[Unknown]) -> BTreeSet<u32> {
    unknowns.iter().map(|u| u.index).collect()
}
