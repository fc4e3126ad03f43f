//! Parameter bindings: values (section 6), prefixes and mappings (section 7).

use crate::error::SspError;
use crate::package::{Package, file_of};
use crate::read::Reader;
use crate::tree::Entry;
use crate::units::Units;
use crate::wiring::mapped_value;
use crate::xml::{Node, Xml, plain_value, text_of};
use pilotage_cosim::description::Transformation;
use pilotage_fmi::archive::{Archive, Limits};
use pilotage_text::printable::excerpt;
use std::collections::HashSet;
use std::path::Path;

/// Types of values; other children of a parameter are none (section 6.2).
const TYPES: [&str; 17] = [
    "Real",
    "Float64",
    "Float32",
    "Integer",
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
    "Enumeration",
    "Binary",
    "Clock",
];

/// The values that an element's bindings give, in order; `fmu` is the element's FMU, in which sources may lie.
pub(crate) fn bindings(
    reader: &mut Reader,
    package: &Package,
    element: Node<'_, '_>,
    fmu: Option<&Path>,
) -> Result<Vec<Entry>, SspError> {
    let mut all = Vec::new();
    for binding in element.listed("ParameterBindings", "ParameterBinding") {
        all.extend(values(reader, package, binding, fmu)?);
    }
    Ok(all)
}

/// The values of one binding.
fn values(
    reader: &mut Reader,
    package: &Package,
    binding: Node<'_, '_>,
    fmu: Option<&Path>,
) -> Result<Vec<Entry>, SspError> {
    expect_type(binding, "application/x-ssp-parameter-set")?;
    let mut entries = match binding.attribute("source") {
        Some(uri) => {
            let (text, shown) = source(package, binding, uri, fmu)?;
            let xml = Xml::parse(&text, &shown)?;
            set(reader, xml.root("ParameterSet")?)?
        }
        None => {
            let inline = binding.listed("ParameterValues", "ParameterSet").next();
            let inline = inline.ok_or_else(|| {
                binding.fault("neither `source` nor <ParameterValues> with a <ParameterSet>")
            })?;
            set(reader, inline)?
        }
    };
    if let Some(prefix) = binding.attribute("prefix") {
        entries
            .iter_mut()
            .for_each(|entry| entry.name.insert_str(0, prefix));
    }
    match binding.child("ParameterMapping") {
        Some(mapping) => mapped(reader, package, mapping, fmu, &entries),
        None => Ok(entries),
    }
}

/// Refuses content of other types than those of SSP.
fn expect_type(node: Node<'_, '_>, known: &str) -> Result<(), SspError> {
    match node.attribute("type") {
        Some(other) if other != known => Err(node.fault(format!(
            "the type `{}` is not known; expected `{known}`",
            excerpt(other)
        ))),
        _ => Ok(()),
    }
}

/// The text of a source, and its name in messages (section 5.2.3, `source` and `sourceBase`).
fn source(
    package: &Package,
    node: Node<'_, '_>,
    uri: &str,
    fmu: Option<&Path>,
) -> Result<(String, String), SspError> {
    let (file, _) = file_of(uri).map_err(|fault| node.fault(fault))?;
    match node.attribute("sourceBase") {
        None | Some("SSD") => match package.path(&file).is_file() {
            true => package.text(&file),
            false => Err(node.fault(format!("there is no file `{}`", excerpt(&file)))),
        },
        Some("component") => {
            let fmu = fmu.ok_or_else(|| node.fault("only a component can be a `sourceBase`"))?;
            let inside = || Archive::open(fmu, Limits::default())?.read(&file);
            let bytes = inside().map_err(|error| node.fault(error.to_string()))?;
            let name = fmu.file_name().unwrap_or_default().to_string_lossy();
            let shown = package.shown(&format!("{name}/{file}"));
            Ok((text_of(&bytes, &shown)?, shown))
        }
        Some(other) => {
            let other = excerpt(other);
            Err(node.fault(format!(
                "`sourceBase` is `{other}`; expected SSD or component"
            )))
        }
    }
}

/// The parameters of a set (section 6.1).
fn set(reader: &mut Reader, set: Node<'_, '_>) -> Result<Vec<Entry>, SspError> {
    reader.expect_version(set)?;
    reader.note_others(set);
    let units = Units::read(set)?;
    let mut entries = Vec::new();
    for parameter in set.listed("Parameters", "Parameter") {
        let mut types = parameter
            .children()
            .filter(|own| TYPES.contains(&own.name()));
        let kind = types.next();
        let kind =
            kind.ok_or_else(|| parameter.fault("it has no value, such as <Real value=\"1\"/>"))?;
        let name = parameter.named()?.to_owned();
        if kind.name() == "Binary" {
            reader.note(format!(
                "{}: `{name}` is binary, and is left out",
                parameter.place()
            ));
            continue;
        }
        entries.push(Entry {
            at: parameter.at("Parameter"),
            name,
            values: checked(parameter, kind, texts(parameter, kind)?)?,
            unit: reader.unit(&units, kind),
            step: Transformation::default(),
        });
    }
    Ok(entries)
}

/// The value of a parameter, or the values of an array: a list, or one child for each (section 6.2).
fn texts(parameter: Node<'_, '_>, kind: Node<'_, '_>) -> Result<Vec<String>, SspError> {
    let listed: Vec<String> = (kind.all("Value"))
        .map(|value| value.attribute("value").unwrap_or(value.text()).to_owned())
        .collect();
    if !listed.is_empty() {
        return Ok(listed);
    }
    let value = kind.required("value")?;
    let is_array = parameter.child("Dimension").is_some();
    match is_array && !["String", "Enumeration"].contains(&kind.name()) {
        true => Ok(value.split_whitespace().map(str::to_owned).collect()),
        false => Ok(vec![value.to_owned()]),
    }
}

/// Refuses values that are none of their type (section 6.2).
fn checked(
    parameter: Node<'_, '_>,
    kind: Node<'_, '_>,
    values: Vec<String>,
) -> Result<Vec<String>, SspError> {
    let is_one: fn(&str) -> bool = match kind.name() {
        "Boolean" => |text| matches!(text, "true" | "false" | "0" | "1"),
        "Real" | "Float64" | "Float32" => |text| text.parse::<f64>().is_ok(),
        "String" | "Enumeration" | "Clock" => return Ok(values),
        // Some tools write 3.0 for an integer.
        _ => |text| {
            let is_whole = |number: &f64| number.fract() == 0.0;
            text.parse::<i128>().is_ok() || text.parse().ok().as_ref().is_some_and(is_whole)
        },
    };
    match values.iter().find(|text| !is_one(text.trim())) {
        None if kind.name() == "Boolean" => {
            Ok(values.iter().map(|text| plain_value(text, true)).collect())
        }
        None => Ok(values),
        Some(text) => {
            let (text, name) = (excerpt(text), kind.name());
            Err(parameter.fault(format!("`{text}` is no value of <{name}>")))
        }
    }
}

/// The values under the names to which they are mapped; those that are not mapped are not applied (section 7.1).
fn mapped(
    reader: &mut Reader,
    package: &Package,
    mapping: Node<'_, '_>,
    fmu: Option<&Path>,
    entries: &[Entry],
) -> Result<Vec<Entry>, SspError> {
    expect_type(mapping, "application/x-ssp-parameter-mapping")?;
    let Some(uri) = mapping.attribute("source") else {
        return match mapping.child("ParameterMapping") {
            Some(inline) => apply(reader, inline, entries),
            None => {
                reader.note(format!(
                    "{}: the mapping is empty; the values keep their names",
                    mapping.place()
                ));
                Ok(entries.to_vec())
            }
        };
    };
    let (text, shown) = source(package, mapping, uri, fmu)?;
    if text.trim().is_empty() {
        reader.note(format!("{shown} is empty: none of the values are applied"));
        return Ok(Vec::new());
    }
    let xml = Xml::parse(&text, &shown)?;
    apply(reader, xml.root("ParameterMapping")?, entries)
}

fn apply(
    reader: &mut Reader,
    mapping: Node<'_, '_>,
    entries: &[Entry],
) -> Result<Vec<Entry>, SspError> {
    reader.expect_version(mapping)?;
    reader.note_others(mapping);
    let mut found = Vec::new();
    let mut targets = HashSet::new();
    for own in mapping.all("MappingEntry") {
        let (source, target) = (own.required("source")?, own.required("target")?);
        if !targets.insert(target) {
            return Err(own.fault(format!("two values are mapped to `{}`", excerpt(target))));
        }
        let Some(entry) = entries.iter().rev().find(|entry| entry.name == source) else {
            reader.unmatched(&own.at("MappingEntry"), source);
            continue;
        };
        let step = own.transformation()?;
        let values = entry
            .values
            .iter()
            .map(|value| mapped_value(&step.map, value))
            .collect();
        found.push(Entry {
            at: own.at("MappingEntry"),
            name: target.to_owned(),
            values,
            unit: entry.unit.clone(),
            step: Transformation {
                map: Vec::new(),
                ..step
            },
        });
    }
    // Of what a mapping leaves out nothing else would speak.
    let sources: HashSet<&str> = mapping
        .all("MappingEntry")
        .filter_map(|own| own.attribute("source"))
        .collect();
    let left_out = entries
        .iter()
        .filter(|entry| !sources.contains(entry.name.as_str()));
    for entry in left_out {
        reader.note(format!(
            "{}: the mapping does not name `{}`; left out",
            entry.at.place,
            excerpt(&entry.name)
        ));
    }
    Ok(found)
}
