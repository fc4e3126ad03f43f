//! Converts the value references by which FMI 3.0 refers to variables into indices from 1, as in FMI 2.0.

use super::*;
use std::collections::HashMap;

/// Replaces the value references left in the fields by indices. A reference without variable is reported and becomes 0.
pub(super) fn resolve(
    description: &mut ModelDescription,
    places: &Places,
    findings: &mut Vec<Finding>,
) {
    let mut indices: HashMap<u32, u32> = HashMap::new();
    for (index, variable) in (1..).zip(&description.variables) {
        indices.entry(variable.value_reference).or_insert(index);
    }
    let mut resolver = Resolver { indices, findings };
    for (variable, &place) in description.variables.iter_mut().zip(&places.variables) {
        resolver.variable(variable, place);
    }
    let structure = &mut description.structure;
    for (element, unknowns, places) in [
        ("<Output>", &mut structure.outputs, &places.outputs),
        (
            "<ContinuousStateDerivative>",
            &mut structure.derivatives,
            &places.derivatives,
        ),
        (
            "<ClockedState>",
            &mut structure.clocked_states,
            &places.clocked_states,
        ),
        (
            "<InitialUnknown>",
            &mut structure.initial_unknowns,
            &places.initial_unknowns,
        ),
        (
            "<EventIndicator>",
            &mut structure.event_indicators,
            &places.event_indicators,
        ),
    ] {
        for (unknown, &place) in unknowns.iter_mut().zip(places) {
            resolver.replace(element, place, None, &mut unknown.index);
            for known in unknown.dependencies.iter_mut().flatten() {
                resolver.replace("dependencies", place, None, known);
            }
        }
    }
}

struct Resolver<'f> {
    /// Index from 1 by value reference.
    indices: HashMap<u32, u32>,
    findings: &'f mut Vec<Finding>,
}

impl Resolver<'_> {
    fn variable(&mut self, variable: &mut ScalarVariable, place: Place) {
        let name = Some(variable.name.as_str());
        for clock in &mut variable.clocks {
            self.replace("clocks", place, name, clock);
        }
        if let Some(previous) = &mut variable.previous {
            self.replace("previous", place, name, previous);
        }
        for dimension in &mut variable.dimensions {
            if let Dimension::Variable(reference) = dimension {
                self.replace("<Dimension>", place, name, reference);
            }
        }
        if let VariableKind::Real(real) = &mut variable.kind
            && let Some(state) = &mut real.derivative
        {
            self.replace("derivative", place, name, state);
        }
    }

    fn replace(
        &mut self,
        from: &'static str,
        place: Place,
        variable: Option<&str>,
        reference: &mut u32,
    ) {
        let found = self.indices.get(reference).copied();
        if found.is_none() {
            self.findings.push(Finding {
                version: FmiVersion::V3,
                place,
                variable: variable.map(str::to_owned),
                rule: Rule::NoSuchReference {
                    from,
                    reference: *reference,
                },
            });
        }
        *reference = found.unwrap_or(0);
    }
}
