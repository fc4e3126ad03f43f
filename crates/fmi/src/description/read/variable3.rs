//! Reads the variables of FMI 3.0. Fields that refer to other variables hold value references until [`references`]
//! converts them to indices.

use super::element::Element;
use super::lexical::{
    BOOLEAN, integer_name, parse_boolean, parse_hex, parse_integer, parse_real, parse_unsigned,
    real_name,
};
use super::types::{binary_attributes, clock_attributes, integer_attributes, real_attributes};
use super::*;

/// The elements of variables.
pub(super) const ELEMENTS: &[&str] = &[
    "Float32",
    "Float64",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
    "String",
    "Binary",
    "Enumeration",
    "Clock",
];

/// One of [`ELEMENTS`].
pub(super) fn variable(e: &Element) -> ScalarVariable {
    let children = Children::read(e);
    let reference = e.unsigned("valueReference");
    let causality = e.parsed("causality", &one_of(Causality::ALL), Causality::parse);
    let causality = causality.unwrap_or(Causality::Local);
    let variability = e.parsed("variability", &one_of(Variability::ALL), Variability::parse);
    let kind = kind(e, children.starts);
    let variability = variability.unwrap_or(match causality {
        Causality::Parameter | Causality::CalculatedParameter | Causality::StructuralParameter => {
            Variability::Fixed
        }
        _ if kind.base_type().is_real() => Variability::Continuous,
        _ => Variability::Discrete,
    });
    let mut variable = ScalarVariable {
        description: e.text("description"),
        can_handle_multiple_set_per_time_instant: e.boolean("canHandleMultipleSetPerTimeInstant"),
        clocks: e
            .list("clocks", "a value reference", parse_unsigned)
            .unwrap_or_default(),
        dimensions: children.dimensions,
        aliases: children.aliases,
        annotations: children.annotations,
        ..ScalarVariable::new(
            e.required_text("name"),
            e.required("valueReference", reference).unwrap_or(u32::MAX),
            causality,
            variability,
            kind,
        )
    };
    if e.name() != "Clock" {
        variable.initial = e.parsed("initial", &one_of(Initial::ALL), Initial::parse);
        variable.intermediate_update = e.flag("intermediateUpdate");
        variable.previous = e.unsigned("previous");
    }
    variable
}

/// Child elements of a variable.
#[derive(Default)]
struct Children {
    annotations: Vec<Tool>,
    dimensions: Vec<Dimension>,
    starts: Vec<String>,
    aliases: Vec<Alias>,
}

impl Children {
    fn read(e: &Element) -> Self {
        let groups: &[&[&str]] = match e.name() {
            "Clock" => &[&["Annotations"], &["Alias"]],
            "String" | "Binary" => &[&["Annotations"], &["Dimension"], &["Start"], &["Alias"]],
            _ => &[&["Annotations"], &["Dimension"], &["Alias"]],
        };
        let is_real = Precision::parse(e.name()).is_some();
        let mut children = Self::default();
        let mut has_annotations = false;
        for child in e.children_in_order(groups) {
            match child.name() {
                "Annotations" if std::mem::replace(&mut has_annotations, true) => {
                    child.unexpected();
                }
                "Annotations" => children.annotations = read_annotations(&child),
                "Dimension" => children.dimensions.extend(dimension(&child)),
                "Start" => {
                    children.starts.push(child.required_text("value"));
                    child.children_in_order(&[]);
                    child.finish();
                }
                _ => children.aliases.push(alias(&child, is_real)),
            }
        }
        children
    }
}

fn dimension(e: &Element) -> Option<Dimension> {
    let (size, reference) = (e.unsigned_long("start"), e.unsigned("valueReference"));
    e.children_in_order(&[]);
    e.finish();
    if e.has("start") == e.has("valueReference") {
        e.report(Rule::DimensionSize);
    }
    match (size, reference) {
        (_, Some(reference)) => Some(Dimension::Variable(reference)),
        (Some(size), None) => Some(Dimension::Fixed(size)),
        (None, None) => None,
    }
}

fn alias(e: &Element, is_real: bool) -> Alias {
    let alias = Alias {
        name: e.required_text("name"),
        description: e.text("description"),
        display_unit: if is_real { e.text("displayUnit") } else { None },
    };
    e.children_in_order(&[]);
    e.finish();
    alias
}

fn kind(e: &Element, starts: Vec<String>) -> VariableKind {
    let declared_type = e.text("declaredType");
    if let Some(precision) = Precision::parse(e.name()) {
        return real(e, precision, declared_type);
    }
    if let Some(integer) = IntegerType::parse(e.name()) {
        return VariableKind::Integer {
            integer,
            declared_type,
            attributes: integer_attributes(e, integer),
            start: integers(e, integer),
        };
    }
    match e.name() {
        "Boolean" => VariableKind::Boolean {
            declared_type,
            start: e.list("start", BOOLEAN, parse_boolean).unwrap_or_default(),
        },
        "Binary" => VariableKind::Binary {
            declared_type,
            attributes: binary_attributes(e),
            start: starts.iter().map(|text| hex(e, text)).collect(),
        },
        "Enumeration" => VariableKind::Enumeration {
            declared_type: e.required_text("declaredType"),
            attributes: integer_attributes(e, IntegerType::Int64),
            start: integers(e, IntegerType::Int64),
        },
        "Clock" => VariableKind::Clock {
            declared_type,
            attributes: clock_attributes(e),
        },
        _ => VariableKind::String {
            declared_type,
            start: starts,
        },
    }
}

fn real(e: &Element, precision: Precision, declared_type: Option<String>) -> VariableKind {
    let start = e.list("start", real_name(precision), |word| {
        parse_real(word, precision)
    });
    VariableKind::Real(RealVariable {
        precision,
        declared_type,
        attributes: real_attributes(e, precision),
        start: start.unwrap_or_default(),
        derivative: e.unsigned("derivative"),
        reinit: e.flag("reinit"),
    })
}

fn integers(e: &Element, integer: IntegerType) -> Vec<i128> {
    let start = e.list("start", &integer_name(integer), |word| {
        parse_integer(word, integer)
    });
    start.unwrap_or_default()
}

fn hex(e: &Element, text: &str) -> Vec<u8> {
    parse_hex(text).unwrap_or_else(|| {
        e.report(Rule::BadValue {
            element: "Start".to_owned(),
            attribute: "value".to_owned(),
            found: text.to_owned(),
            expected: "two hexadecimal digits for each byte (xs:hexBinary)".to_owned(),
        });
        Vec::new()
    })
}
