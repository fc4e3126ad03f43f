//! FMI 3.0 refers to variables by value reference; here they become indices from 1, as in FMI 2.0.

use super::*;
use std::collections::HashMap;

/// Replaces the value references that the readers left in the fields for indices. A reference that no
/// variable has is reported and becomes 0.
pub(super) fn resolve(
    description: &mut ModelDescription,
    places: &Places,
    findings: &mut Vec<Finding>,
) {
    let mut indices: HashMap<u32, u32> = HashMap::new();
    for (index, variable) in (1..).zip(&description.variables) {
        indices.entry(variable.value_reference).or_insert(index);
    }
    for (variable, &place) in description.variables.iter_mut().zip(&places.variables) {
        let name = variable.name.clone();
        let mut replace = |attribute, reference: &mut u32| {
            let found = indices.get(reference).copied();
            if found.is_none() {
                findings.push(missing(place, Some(name.clone()), attribute, *reference));
            }
            *reference = found.unwrap_or(0);
        };
        variable
            .clocks
            .iter_mut()
            .for_each(|clock| replace("clocks", clock));
        variable
            .previous
            .iter_mut()
            .for_each(|previous| replace("previous", previous));
        for dimension in &mut variable.dimensions {
            if let Dimension::Variable(reference) = dimension {
                replace("valueReference of <Dimension>", reference);
            }
        }
        if let VariableKind::Real(real) = &mut variable.kind {
            let derivative = real.derivative.iter_mut();
            derivative.for_each(|state| replace("derivative", state));
        }
    }
    let structure = &mut description.structure;
    for (unknowns, places) in [
        (&mut structure.outputs, &places.outputs),
        (&mut structure.derivatives, &places.derivatives),
        (&mut structure.clocked_states, &places.clocked_states),
        (&mut structure.initial_unknowns, &places.initial_unknowns),
        (&mut structure.event_indicators, &places.event_indicators),
    ] {
        for (unknown, &place) in unknowns.iter_mut().zip(places) {
            let mut replace = |attribute, reference: &mut u32| {
                let found = indices.get(reference).copied();
                if found.is_none() {
                    findings.push(missing(place, None, attribute, *reference));
                }
                *reference = found.unwrap_or(0);
            };
            replace("valueReference", &mut unknown.index);
            let dependencies = unknown.dependencies.iter_mut().flatten();
            dependencies.for_each(|known| replace("dependencies", known));
        }
    }
}

fn missing(
    place: Place,
    variable: Option<String>,
    attribute: &'static str,
    reference: u32,
) -> Finding {
    Finding {
        version: FmiVersion::V3,
        place,
        variable,
        rule: Rule::NoSuchReference {
            attribute,
            reference,
        },
    }
}
