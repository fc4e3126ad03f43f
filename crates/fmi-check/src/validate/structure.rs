//! Checks that the lists of the model structure contain exactly the required variables (FMI 2.0, section 2.2.8; FMI
//! 3.0, section 2.4.8).

use super::states::{derivative_of, is_continuous_real};
use super::unknowns::List;
use super::*;
use std::collections::BTreeMap;

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
        for (place, rule) in rules {
            self.report(place, rule);
        }
    }

    /// Name of a list in the XML.
    pub(super) fn list_name(&self, list: List) -> &'static str {
        list.name(self.version)
    }

    /// How the XML refers to the variable with that index (from 1).
    pub(super) fn handle(&self, index: u32) -> Handle {
        match (self.version, self.at(index)) {
            (FmiVersion::V3, Some(variable)) => Handle::Reference(variable.value_reference),
            _ => Handle::Index(index),
        }
    }

    /// Compares a list with its required contents: `required` returns whether a variable must be listed, `None` if it
    /// may be; `wrong` creates the rule for a variable that must not be listed.
    fn compare(
        &self,
        list: List,
        listed: &BTreeMap<u32, Place>,
        required: impl Fn(u32, &ScalarVariable) -> Option<bool>,
        wrong: impl Fn(Handle, &ScalarVariable) -> Rule,
    ) -> Vec<(Place, Rule)> {
        let rule = |(index, variable): (u32, &ScalarVariable)| {
            let handle = self.handle(index);
            match (required(index, variable)?, listed.get(&index)) {
                (true, None) => {
                    let rule = Rule::MissingUnknown {
                        list: self.list_name(list),
                        variable: handle,
                        name: variable.name.clone(),
                    };
                    Some((self.places.structure, rule))
                }
                (false, Some(&place)) => Some((place, wrong(handle, variable))),
                _ => None,
            }
        };
        let variables = (1..).zip(&self.description.variables);
        variables.filter_map(rule).collect()
    }

    fn outputs(&self) -> Vec<(Place, Rule)> {
        let listed = listed(&self.description.structure.outputs, &self.places.outputs);
        let list = self.list_name(List::Outputs);
        self.compare(
            List::Outputs,
            &listed,
            |_, variable| Some(variable.causality == Causality::Output),
            |handle, variable| Rule::NotAnOutput {
                list,
                variable: handle,
                name: variable.name.clone(),
                causality: variable.causality,
            },
        )
    }

    /// Outputs, states and derivatives with initial approx or calculated, and calculated parameters. In FMI 3.0 clocked
    /// variables and clocks are optional.
    fn initial_unknowns(&self) -> Vec<(Place, Rule)> {
        let structure = &self.description.structure;
        let places = &self.places.initial_unknowns;
        let listed_here = listed(&structure.initial_unknowns, places);
        let derivatives = listed(&structure.derivatives, &self.places.derivatives);
        let list = self.list_name(List::InitialUnknowns);
        let required = |index: u32, variable: &ScalarVariable| {
            let is_clock = variable.kind.base_type() == BaseType::Clock;
            if !variable.clocks.is_empty() || is_clock {
                return None;
            }
            let is_computed = matches!(
                variable.effective_initial(),
                Some(Initial::Approx | Initial::Calculated)
            );
            Some(match variable.causality {
                Causality::Output => is_computed,
                Causality::CalculatedParameter => true,
                _ => {
                    let is_state = self.states.contains(&index);
                    is_computed && (is_state || derivatives.contains_key(&index))
                }
            })
        };
        self.compare(
            List::InitialUnknowns,
            &listed_here,
            required,
            |handle, variable| Rule::NotInitial {
                list,
                variable: handle,
                name: variable.name.clone(),
            },
        )
    }

    fn derivatives(&self) -> Vec<(Place, Rule)> {
        let list = self.list_name(List::Derivatives);
        let mut rules = Vec::new();
        let mut first: HashMap<u32, u32> = HashMap::new();
        let unknowns = self.description.structure.derivatives.iter();
        for (unknown, &place) in unknowns.zip(&self.places.derivatives) {
            let Some(variable) = self.at(unknown.index) else {
                continue;
            };
            let (handle, name) = (self.handle(unknown.index), variable.name.clone());
            let Some(state) = derivative_of(variable) else {
                let rule = Rule::NotADerivative {
                    list,
                    variable: handle,
                    name,
                };
                rules.push((place, rule));
                continue;
            };
            if !is_continuous_real(variable) {
                let rule = Rule::NotContinuous {
                    list,
                    variable: handle,
                    name: name.clone(),
                };
                rules.push((place, rule));
            }
            let before = *first.entry(state).or_insert(unknown.index);
            if let (true, Some(other), Some(state)) =
                (before != unknown.index, self.at(before), self.at(state))
            {
                let rule = Rule::TwoDerivatives {
                    list,
                    state: state.name.clone(),
                    first: other.name.clone(),
                    second: name,
                };
                rules.push((place, rule));
            }
        }
        rules
    }

    fn clocked_states(&self) -> Vec<(Place, Rule)> {
        let unknowns = &self.description.structure.clocked_states;
        let listed = listed(unknowns, &self.places.clocked_states);
        let list = self.list_name(List::ClockedStates);
        self.compare(
            List::ClockedStates,
            &listed,
            |_, variable| Some(variable.previous.is_some()),
            |handle, variable| Rule::NotAClockedState {
                list,
                variable: handle,
                name: variable.name.clone(),
            },
        )
    }

    fn event_indicators(&self) -> Vec<(Place, Rule)> {
        let unknowns = &self.description.structure.event_indicators;
        let listed = listed(unknowns, &self.places.event_indicators);
        let list = self.list_name(List::EventIndicators);
        self.compare(
            List::EventIndicators,
            &listed,
            |_, variable| (!is_continuous_real(variable)).then_some(false),
            |handle, variable| Rule::NotContinuous {
                list,
                variable: handle,
                name: variable.name.clone(),
            },
        )
    }
}

/// Indices of the variables in a list, with the place of their first occurrence.
fn listed(unknowns: &[Unknown], places: &[Place]) -> BTreeMap<u32, Place> {
    let mut listed = BTreeMap::new();
    for (unknown, &place) in unknowns.iter().zip(places) {
        listed.entry(unknown.index).or_insert(place);
    }
    listed
}
