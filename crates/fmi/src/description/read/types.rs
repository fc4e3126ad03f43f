//! Reads units and type definitions.

use super::element::Element;
use super::*;
use pilotage_units::BASE_UNITS;

pub(super) fn unit(e: &Element) -> Unit {
    let mut unit = Unit {
        name: e.required_text("name"),
        ..Unit::default()
    };
    let groups: &[&[&str]] = match e.version() {
        FmiVersion::V2 => &[&["BaseUnit"], &["DisplayUnit"]],
        FmiVersion::V3 => &[&["BaseUnit"], &["DisplayUnit"], &["Annotations"]],
    };
    for child in e.children_in_order(groups) {
        match child.name() {
            "BaseUnit" if unit.base.is_some() => child.unexpected(),
            "BaseUnit" => unit.base = Some(base_unit(&child)),
            "DisplayUnit" => unit.display_units.push(display_unit(&child)),
            _ => drop(read_annotations(&child)),
        }
    }
    unit
}

fn base_unit(e: &Element) -> BaseUnit {
    let unit = BaseUnit {
        exponents: BASE_UNITS.map(|name| e.int(name).unwrap_or(0)),
        factor: e.real("factor").unwrap_or(1.0),
        offset: e.real("offset").unwrap_or(0.0),
    };
    e.children_in_order(&[]);
    e.finish();
    unit
}

fn display_unit(e: &Element) -> DisplayUnit {
    let unit = DisplayUnit {
        name: e.required_text("name"),
        factor: e.real("factor").unwrap_or(1.0),
        offset: e.real("offset").unwrap_or(0.0),
        inverse: e.version() == FmiVersion::V3 && e.flag("inverse"),
    };
    skip_annotations(e);
    e.finish();
    unit
}

/// `<SimpleType>` of FMI 2.0.
pub(super) fn simple_type(e: &Element) -> SimpleType {
    const KINDS: &[&str] = &["Real", "Integer", "Boolean", "String", "Enumeration"];
    let mut kind = None;
    for child in e.children_in_order(&[KINDS]) {
        if kind.is_some() {
            child.unexpected();
            continue;
        }
        kind = Some(kind2(&child));
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

fn kind2(e: &Element) -> TypeKind {
    if e.name() != "Enumeration" {
        e.children_in_order(&[]);
    }
    match e.name() {
        "Real" => TypeKind::Real {
            precision: Precision::Double,
            attributes: real_attributes(e, Precision::Double),
        },
        "Integer" => TypeKind::Integer {
            integer: IntegerType::Int32,
            attributes: integer_attributes(e, IntegerType::Int32),
        },
        "Boolean" => TypeKind::Boolean,
        "Enumeration" => TypeKind::Enumeration {
            attributes: IntegerAttributes {
                quantity: e.text("quantity"),
                ..IntegerAttributes::default()
            },
            items: items(e, &e.children_named("Item")),
        },
        _ => TypeKind::String,
    }
}

/// The type definitions of FMI 3.0.
pub(super) const ELEMENTS3: &[&str] = &[
    "Float32Type",
    "Float64Type",
    "Int8Type",
    "UInt8Type",
    "Int16Type",
    "UInt16Type",
    "Int32Type",
    "UInt32Type",
    "Int64Type",
    "UInt64Type",
    "BooleanType",
    "StringType",
    "BinaryType",
    "EnumerationType",
    "ClockType",
];

/// One of [`ELEMENTS3`].
pub(super) fn definition(e: &Element) -> SimpleType {
    SimpleType {
        name: e.required_text("name"),
        description: e.text("description"),
        kind: kind3(e),
    }
}

fn kind3(e: &Element) -> TypeKind {
    let base = e.name().strip_suffix("Type").unwrap_or_default();
    if base != "Enumeration" {
        skip_annotations(e);
    }
    if let Some(precision) = Precision::parse(base) {
        return TypeKind::Real {
            precision,
            attributes: real_attributes(e, precision),
        };
    }
    if let Some(integer) = IntegerType::parse(base) {
        return TypeKind::Integer {
            integer,
            attributes: integer_attributes(e, integer),
        };
    }
    match base {
        "Boolean" => TypeKind::Boolean,
        "Binary" => TypeKind::Binary(binary_attributes(e)),
        "Enumeration" => {
            let children = e.children_in_order(&[&["Annotations"], &["Item"]]);
            let is_item = |child: &Element| child.name() == "Item";
            let (elements, annotations): (Vec<_>, Vec<_>) = children.into_iter().partition(is_item);
            for list in Element::first_of_each(annotations) {
                read_annotations(&list);
            }
            TypeKind::Enumeration {
                attributes: integer_attributes(e, IntegerType::Int64),
                items: items(e, &elements),
            }
        }
        "Clock" => TypeKind::Clock(clock_attributes(e)),
        _ => TypeKind::String,
    }
}

fn items(parent: &Element, elements: &[Element]) -> Vec<EnumerationItem> {
    if elements.is_empty() {
        parent.report(Rule::MissingElement {
            parent: parent.name().to_owned(),
            element: "Item",
        });
    }
    elements.iter().map(item).collect()
}

fn item(e: &Element) -> EnumerationItem {
    skip_annotations(e);
    let integer = match e.version() {
        FmiVersion::V2 => IntegerType::Int32,
        FmiVersion::V3 => IntegerType::Int64,
    };
    let value = e.required("value", e.integer("value", integer));
    let item = EnumerationItem {
        name: e.required_text("name"),
        value: value.and_then(|v| i64::try_from(v).ok()).unwrap_or(0),
        description: e.text("description"),
    };
    e.finish();
    item
}

pub(super) fn real_attributes(e: &Element, precision: Precision) -> RealAttributes {
    RealAttributes {
        quantity: e.text("quantity"),
        unit: e.text("unit"),
        display_unit: e.text("displayUnit"),
        relative_quantity: e.boolean("relativeQuantity"),
        min: e.real_of("min", precision),
        max: e.real_of("max", precision),
        nominal: e.real_of("nominal", precision),
        unbounded: e.boolean("unbounded"),
    }
}

pub(super) fn integer_attributes(e: &Element, integer: IntegerType) -> IntegerAttributes {
    IntegerAttributes {
        quantity: e.text("quantity"),
        min: e.integer("min", integer),
        max: e.integer("max", integer),
    }
}

pub(super) fn binary_attributes(e: &Element) -> BinaryAttributes {
    BinaryAttributes {
        mime_type: e.text("mimeType"),
        max_size: e.unsigned_long("maxSize"),
    }
}

pub(super) fn clock_attributes(e: &Element) -> ClockAttributes {
    let float = |name| Some(e.real_of(name, Precision::Single)? as f32);
    let variability = e.parsed(
        "intervalVariability",
        &one_of(IntervalVariability::ALL),
        IntervalVariability::parse,
    );
    let variability = e.required("intervalVariability", variability);
    ClockAttributes {
        can_be_deactivated: e.flag("canBeDeactivated"),
        priority: e.unsigned("priority"),
        interval_variability: variability.unwrap_or(IntervalVariability::Triggered),
        interval_decimal: float("intervalDecimal"),
        shift_decimal: float("shiftDecimal").unwrap_or(0.0),
        supports_fraction: e.flag("supportsFraction"),
        resolution: e.unsigned_long("resolution"),
        interval_counter: e.unsigned_long("intervalCounter"),
        shift_counter: e.unsigned_long("shiftCounter").unwrap_or(0),
    }
}
