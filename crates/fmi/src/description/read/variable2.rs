//! Reads the scalar variables of FMI 2.0.

use super::element::Element;
use super::types::{integer_attributes, real_attributes};
use super::*;

pub(super) fn variable(e: &Element) -> ScalarVariable {
    let reference = e.unsigned("valueReference");
    let (kind, annotations) = children(e);
    let causalities = Causality::all(FmiVersion::V2);
    let known = |text: &str| Causality::parse(text).filter(|c| causalities.contains(c));
    let reference = e.required("valueReference", reference).unwrap_or(u32::MAX);
    let causality = e.parsed("causality", &one_of(causalities), known);
    let variability = e.parsed("variability", &one_of(Variability::ALL), Variability::parse);
    ScalarVariable {
        description: e.text("description"),
        initial: e.parsed("initial", &one_of(Initial::ALL), Initial::parse),
        can_handle_multiple_set_per_time_instant: e.boolean("canHandleMultipleSetPerTimeInstant"),
        annotations,
        ..ScalarVariable::new(
            e.required_text("name"),
            reference,
            causality.unwrap_or(Causality::Local),
            variability.unwrap_or(Variability::Continuous),
            kind,
        )
    }
}

fn children(e: &Element) -> (VariableKind, Vec<Tool>) {
    const KINDS: &[&str] = &["Real", "Integer", "Boolean", "String", "Enumeration"];
    let mut kind = None;
    let mut annotations = None;
    for child in e.children_in_order(&[KINDS, &["Annotations"]]) {
        if child.name() == "Annotations" && annotations.is_none() {
            annotations = Some(read_annotations(&child));
        } else if child.name() == "Annotations" || kind.is_some() {
            child.unexpected();
        } else {
            kind = Some(variable_kind(&child));
            child.children_in_order(&[]);
            child.finish();
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
        annotations.unwrap_or_default(),
    )
}

fn variable_kind(e: &Element) -> VariableKind {
    const INTEGER: IntegerType = IntegerType::Int32;
    let declared_type = e.text("declaredType");
    match e.name() {
        "Real" => VariableKind::Real(RealVariable {
            precision: Precision::Double,
            declared_type,
            attributes: real_attributes(e, Precision::Double),
            start: e.real("start").into_iter().collect(),
            derivative: e.unsigned("derivative"),
            reinit: e.flag("reinit"),
        }),
        "Integer" => VariableKind::Integer {
            integer: INTEGER,
            declared_type,
            attributes: integer_attributes(e, INTEGER),
            start: e.integer("start", INTEGER).into_iter().collect(),
        },
        "Boolean" => VariableKind::Boolean {
            declared_type,
            start: e.boolean("start").into_iter().collect(),
        },
        "Enumeration" => VariableKind::Enumeration {
            declared_type: e.required_text("declaredType"),
            attributes: integer_attributes(e, INTEGER),
            start: e.integer("start", INTEGER).into_iter().collect(),
        },
        _ => VariableKind::String {
            declared_type,
            start: e.text("start").into_iter().collect(),
        },
    }
}
