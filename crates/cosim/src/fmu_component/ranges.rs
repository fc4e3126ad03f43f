//! Value ranges of an FMU's variables.

use pilotage_fmi::description::{
    EnumerationItem, IntegerAttributes, ModelDescription, Precision, RealAttributes, RealVariable,
    ScalarVariable, TypeKind, VariableKind,
};
use std::collections::HashMap;

/// Returns a function for the smallest and largest value of a variable: the range of its type, restricted by its
/// attributes or those of its declared type.
pub(super) fn ranges_of(
    description: &ModelDescription,
) -> impl Fn(&ScalarVariable) -> [f64; 2] + '_ {
    let types = types_of(description);
    move |variable| match &variable.kind {
        VariableKind::Real(real) => {
            real_range(real, declared(&types, real.declared_type.as_deref()))
        }
        VariableKind::Integer {
            integer,
            declared_type,
            attributes,
            ..
        } => {
            let all = integer.range();
            let limits = limits(attributes, declared(&types, declared_type.as_deref()));
            within([*all.start(), *all.end()].map(|limit| limit as f64), limits)
        }
        VariableKind::Enumeration {
            declared_type,
            attributes,
            ..
        } => {
            let kind = declared(&types, Some(declared_type));
            within(items_range(kind), limits(attributes, kind))
        }
        _ => [f64::NEG_INFINITY, f64::INFINITY],
    }
}

/// The declared types by name; the first if several have the same name.
pub(super) fn types_of(description: &ModelDescription) -> HashMap<&str, &TypeKind> {
    let types = description.types.iter().rev();
    types.map(|t| (t.name.as_str(), &t.kind)).collect()
}

fn declared<'a>(types: &HashMap<&str, &'a TypeKind>, name: Option<&str>) -> Option<&'a TypeKind> {
    types.get(name?).copied()
}

/// The items of an enumeration; empty for other variables and where the type lists none.
pub(super) fn items_of<'a>(
    types: &HashMap<&str, &'a TypeKind>,
    variable: &ScalarVariable,
) -> &'a [EnumerationItem] {
    match &variable.kind {
        VariableKind::Enumeration { declared_type, .. } => {
            items(declared(types, Some(declared_type)))
        }
        _ => &[],
    }
}

/// The items of a type.
fn items(kind: Option<&TypeKind>) -> &[EnumerationItem] {
    match kind {
        Some(TypeKind::Enumeration { items, .. }) => items,
        _ => &[],
    }
}

fn items_range(kind: Option<&TypeKind>) -> [f64; 2] {
    let values = || items(kind).iter().map(|item| item.value as f64);
    let (min, max) = (values().reduce(f64::min), values().reduce(f64::max));
    [
        min.unwrap_or(f64::NEG_INFINITY),
        max.unwrap_or(f64::INFINITY),
    ]
}

fn real_range(real: &RealVariable, kind: Option<&TypeKind>) -> [f64; 2] {
    let largest = match real.precision {
        Precision::Single => f64::from(f32::MAX),
        Precision::Double => f64::INFINITY,
    };
    let inherited = |limit: fn(&RealAttributes) -> Option<f64>| match kind {
        Some(TypeKind::Real { attributes, .. }) => limit(attributes),
        _ => None,
    };
    let own = &real.attributes;
    let limits = [
        own.min.or(inherited(|a| a.min)),
        own.max.or(inherited(|a| a.max)),
    ];
    within([-largest, largest], limits)
}

fn limits(own: &IntegerAttributes, kind: Option<&TypeKind>) -> [Option<f64>; 2] {
    let inherited = match kind {
        Some(TypeKind::Integer { attributes, .. } | TypeKind::Enumeration { attributes, .. }) => {
            [attributes.min, attributes.max]
        }
        _ => [None, None],
    };
    let all = [own.min.or(inherited[0]), own.max.or(inherited[1])];
    all.map(|limit| limit.map(|limit| limit as f64))
}

fn within(range: [f64; 2], limits: [Option<f64>; 2]) -> [f64; 2] {
    [
        range[0].max(limits[0].unwrap_or(f64::NEG_INFINITY)),
        range[1].min(limits[1].unwrap_or(f64::INFINITY)),
    ]
}
