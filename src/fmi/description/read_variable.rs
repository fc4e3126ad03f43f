//! Reads scalar variables.

use super::element::Element;
use super::read::read_tools;
use super::read_types::{integer_attributes, real_attributes};
use super::*;

pub(super) fn variable(e: &Element) -> ScalarVariable {
    let reference = e.unsigned("valueReference");
    let (kind, annotations) = children(e);
    ScalarVariable {
        name: e.required_text("name"),
        value_reference: e.required("valueReference", reference).unwrap_or(u32::MAX),
        description: e.text("description"),
        causality: e
            .parsed("causality", &one_of(Causality::ALL), Causality::parse)
            .unwrap_or(Causality::Local),
        variability: e
            .parsed("variability", &one_of(Variability::ALL), Variability::parse)
            .unwrap_or(Variability::Continuous),
        initial: e.parsed("initial", &one_of(Initial::ALL), Initial::parse),
        can_handle_multiple_set_per_time_instant: e.boolean("canHandleMultipleSetPerTimeInstant"),
        kind,
        annotations,
    }
}

/// `a, b or c`.
fn one_of<T: ToString>(values: &[T]) -> String {
    let words: Vec<String> = values.iter().map(T::to_string).collect();
    match words.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, first)) => format!("{} or {last}", first.join(", ")),
        None => String::new(),
    }
}

fn children(e: &Element) -> (VariableKind, Vec<Tool>) {
    let mut kind = None;
    let mut annotations = Vec::new();
    for child in e.children() {
        if child.name() == "Annotations" {
            annotations.extend(read_tools(&child));
            continue;
        }
        match variable_kind(&child) {
            Some(read) if kind.is_none() => {
                kind = Some(read);
                child.finish();
            }
            _ => child.unexpected(),
        }
    }
    if kind.is_none() {
        e.report(Rule::MissingElement {
            parent: e.name().to_owned(),
            element: "Real|Integer|Boolean|String|Enumeration",
        });
    }
    (
        kind.unwrap_or_else(|| VariableKind::real("", None)),
        annotations,
    )
}

fn variable_kind(e: &Element) -> Option<VariableKind> {
    let declared_type = e.text("declaredType");
    Some(match e.name() {
        "Real" => VariableKind::Real(RealVariable {
            declared_type,
            attributes: real_attributes(e),
            start: e.real("start"),
            derivative: e.unsigned("derivative"),
            reinit: e.flag("reinit"),
        }),
        "Integer" => VariableKind::Integer {
            declared_type,
            attributes: integer_attributes(e),
            start: e.int("start"),
        },
        "Boolean" => VariableKind::Boolean {
            declared_type,
            start: e.boolean("start"),
        },
        "String" => VariableKind::String {
            declared_type,
            start: e.text("start"),
        },
        "Enumeration" => VariableKind::Enumeration {
            declared_type: e.required_text("declaredType"),
            attributes: integer_attributes(e),
            start: e.int("start"),
        },
        _ => return None,
    })
}
