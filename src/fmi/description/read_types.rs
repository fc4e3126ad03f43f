//! Reads units and type definitions.

use super::element::Element;
use super::*;

pub(super) fn unit(e: &Element) -> Unit {
    let mut unit = Unit {
        name: e.required_text("name"),
        ..Unit::default()
    };
    for child in e.children() {
        match child.name() {
            "BaseUnit" => unit.base = Some(base_unit(&child)),
            "DisplayUnit" => unit.display_units.push(DisplayUnit {
                name: child.required_text("name"),
                factor: child.real("factor").unwrap_or(1.0),
                offset: child.real("offset").unwrap_or(0.0),
            }),
            _ => {
                child.unexpected();
                continue;
            }
        }
        child.finish();
    }
    unit
}

fn base_unit(e: &Element) -> BaseUnit {
    let exponent = |name| e.int(name).unwrap_or(0);
    BaseUnit {
        kg: exponent("kg"),
        m: exponent("m"),
        s: exponent("s"),
        ampere: exponent("A"),
        kelvin: exponent("K"),
        mol: exponent("mol"),
        cd: exponent("cd"),
        rad: exponent("rad"),
        factor: e.real("factor").unwrap_or(1.0),
        offset: e.real("offset").unwrap_or(0.0),
    }
}

pub(super) fn simple_type(e: &Element) -> SimpleType {
    let mut kind = None;
    for child in e.children() {
        match type_kind(&child) {
            Some(read) if kind.is_none() => kind = Some(read),
            _ => child.unexpected(),
        }
        child.finish();
    }
    if kind.is_none() {
        e.report(Rule::MissingElement {
            parent: e.name().to_owned(),
            element: "Real|Integer|Boolean|String|Enumeration",
        });
    }
    SimpleType {
        name: e.required_text("name"),
        description: e.text("description"),
        kind: kind.unwrap_or(TypeKind::String),
    }
}

fn type_kind(e: &Element) -> Option<TypeKind> {
    Some(match e.name() {
        "Real" => TypeKind::Real(real_attributes(e)),
        "Integer" => TypeKind::Integer(integer_attributes(e)),
        "Boolean" => TypeKind::Boolean,
        "String" => TypeKind::String,
        "Enumeration" => TypeKind::Enumeration {
            quantity: e.text("quantity"),
            items: e.children_named("Item").iter().map(item).collect(),
        },
        _ => return None,
    })
}

fn item(e: &Element) -> EnumerationItem {
    let item = EnumerationItem {
        name: e.required_text("name"),
        value: e.required("value", e.int("value")).unwrap_or(0),
        description: e.text("description"),
    };
    e.finish();
    item
}

pub(super) fn real_attributes(e: &Element) -> RealAttributes {
    RealAttributes {
        quantity: e.text("quantity"),
        unit: e.text("unit"),
        display_unit: e.text("displayUnit"),
        relative_quantity: e.boolean("relativeQuantity"),
        min: e.real("min"),
        max: e.real("max"),
        nominal: e.real("nominal"),
        unbounded: e.boolean("unbounded"),
    }
}

pub(super) fn integer_attributes(e: &Element) -> IntegerAttributes {
    IntegerAttributes {
        quantity: e.text("quantity"),
        min: e.int("min"),
        max: e.int("max"),
    }
}
