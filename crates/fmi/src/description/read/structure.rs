//! Reads the model structure.

use super::element::Element;
use super::*;

pub(super) fn structure2(e: &Element, places: &mut Places) -> ModelStructure {
    let mut structure = ModelStructure::default();
    let lists = e.children_in_order(&[&["Outputs"], &["Derivatives"], &["InitialUnknowns"]]);
    for list in Element::first_of_each(lists) {
        let (unknowns, places) = match list.name() {
            "Outputs" => (&mut structure.outputs, &mut places.outputs),
            "Derivatives" => (&mut structure.derivatives, &mut places.derivatives),
            _ => (
                &mut structure.initial_unknowns,
                &mut places.initial_unknowns,
            ),
        };
        let mut all = Vec::new();
        let read = read_list(&list, &["Unknown"], &mut all, |e| {
            e.children_in_order(&[]);
            unknown(e, "index")
        });
        for (unknown, place) in read.into_iter().zip(all) {
            if let Some(unknown) = unknown {
                unknowns.push(unknown);
                places.push(place);
            }
        }
    }
    e.finish();
    structure
}

/// Reads unknowns of FMI 3.0, which hold value references; [`references`] converts them to indices.
pub(super) fn structure3(e: &Element, places: &mut Places) -> ModelStructure {
    let mut structure = ModelStructure::default();
    for child in e.children_in_order(&[
        &["Output"],
        &["ContinuousStateDerivative"],
        &["ClockedState"],
        &["InitialUnknown"],
        &["EventIndicator"],
    ]) {
        let (unknowns, places) = match child.name() {
            "Output" => (&mut structure.outputs, &mut places.outputs),
            "ContinuousStateDerivative" => (&mut structure.derivatives, &mut places.derivatives),
            "ClockedState" => (&mut structure.clocked_states, &mut places.clocked_states),
            "InitialUnknown" => (
                &mut structure.initial_unknowns,
                &mut places.initial_unknowns,
            ),
            _ => (
                &mut structure.event_indicators,
                &mut places.event_indicators,
            ),
        };
        skip_annotations(&child);
        if let Some(unknown) = unknown(&child, "valueReference") {
            unknowns.push(unknown);
            places.push(child.place());
        }
        child.finish();
    }
    e.finish();
    structure
}

/// An unknown, if it states its variable.
fn unknown(e: &Element, attribute: &'static str) -> Option<Unknown> {
    let numbers = |text: &str| lexical::words(text).map(lexical::parse_unsigned).collect();
    let kinds = |text: &str| lexical::words(text).map(DependencyKind::parse).collect();
    let expected = match attribute {
        "index" => "a list of indices",
        _ => "a list of value references",
    };
    let index = e.required(attribute, e.unsigned(attribute));
    let dependencies = e.parsed("dependencies", expected, numbers);
    let dependencies_kind = e.parsed(
        "dependenciesKind",
        "a list of dependent, constant, fixed, tunable and discrete",
        kinds,
    );
    Some(Unknown {
        index: index?,
        dependencies,
        dependencies_kind,
    })
}
