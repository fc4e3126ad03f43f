//! Reads a modelDescription.xml.
//!
//! Reading collects findings instead of stopping at the first; use [`Reading::into_usable`] to run the FMU rather than
//! check the file.

mod build;
mod element;
mod interface;
mod lexical;
pub(super) mod limits;
mod references;
mod structure;
mod terminals;
mod types;
mod variable2;
mod variable3;

pub use build::build;
pub use terminals::terminals;

use super::text::decode;
use super::*;
use element::{Context, Element};
use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeSet;

/// The text of an XML file, within limits that keep the time to parse it in proportion to its size.
///
/// # Errors
/// If it is in no known encoding, or beyond the limits. The words of the error begin with the name of a
/// modelDescription.xml.
pub fn text_of(bytes: &[u8]) -> Result<Cow<'_, str>, ReadError> {
    let (text, _) = decode(bytes)?;
    limits::check(&text)?;
    Ok(text)
}

/// Reads the bytes of a modelDescription.xml.
///
/// # Errors
/// If it is not XML, or not FMI 2.0 or 3.0. All other problems are in [`Reading::findings`].
pub fn read(bytes: &[u8]) -> Result<Reading, ReadError> {
    let (text, foreign_encoding) = decode(bytes)?;
    limits::check(&text)?;
    let document = roxmltree::Document::parse(&text)?;
    let root = document.root_element();
    let (version, is_exact) = version(root)?;
    let namespace = root.tag_name().namespace().map(str::to_owned);
    let context = Context::new(&text, version, namespace.clone());
    let root = context.element(root);
    if root.name() != "fmiModelDescription" {
        return Err(ReadError::WrongRoot {
            place: root.place(),
            found: root.name().to_owned(),
        });
    }
    if let Some(encoding) = foreign_encoding {
        root.report(Rule::NotUtf8 { encoding });
    }
    if let Some(namespace) = namespace {
        root.report(Rule::Namespace { namespace });
    }
    let mut places = Places::new(root.place());
    let mut description = read_root(&root, is_exact, &mut places);
    drop(root);
    let mut findings = context.findings.into_inner();
    if version == FmiVersion::V3 {
        references::resolve(&mut description, &places, &mut findings);
    }
    Ok(Reading {
        description,
        places,
        findings,
    })
}

/// The version of the standard, and whether `fmiVersion` is written correctly. If the attribute is missing, which is
/// reported later, the name of the token determines the version.
fn version(root: roxmltree::Node) -> Result<(FmiVersion, bool), ReadError> {
    let Some(text) = root.attribute("fmiVersion") else {
        let version = match root.has_attribute("instantiationToken") {
            true => FmiVersion::V3,
            false => FmiVersion::V2,
        };
        return Ok((version, true));
    };
    if root.tag_name().name() != "fmiModelDescription" {
        // Reported as the wrong root.
        return Ok((FmiVersion::V2, true));
    }
    match text.split('.').next() {
        _ if text == "2.0" => Ok((FmiVersion::V2, true)),
        Some("2") => Ok((FmiVersion::V2, false)),
        Some("3") => Ok((FmiVersion::V3, is_release_of_3(text))),
        Some("1") => Err(ReadError::Fmi1),
        _ => Err(ReadError::WrongVersion {
            found: text.to_owned(),
        }),
    }
}

/// Whether a text is `3.N`, `3.N.N` or one of these with `-anything`, with numbers without leading zeros.
fn is_release_of_3(text: &str) -> bool {
    let (numbers, suffix) = match text.split_once('-') {
        Some((numbers, suffix)) => (numbers, Some(suffix)),
        None => (text, None),
    };
    let is_number = |part: &str| {
        !part.is_empty()
            && part.bytes().all(|b| b.is_ascii_digit())
            && (part == "0" || !part.starts_with('0'))
    };
    let parts: Vec<&str> = numbers.split('.').collect();
    (2..=3).contains(&parts.len())
        && parts.iter().all(|part| is_number(part))
        && suffix.is_none_or(|suffix| !suffix.is_empty())
}

/// Children of the root in the schema's order.
fn root_children(version: FmiVersion) -> &'static [&'static [&'static str]] {
    match version {
        FmiVersion::V2 => &[
            // The schema allows either order of these two.
            &["ModelExchange", "CoSimulation"],
            &["UnitDefinitions"],
            &["TypeDefinitions"],
            &["LogCategories"],
            &["DefaultExperiment"],
            &["VendorAnnotations"],
            &["ModelVariables"],
            &["ModelStructure"],
        ],
        FmiVersion::V3 => &[
            &["ModelExchange"],
            &["CoSimulation"],
            &["ScheduledExecution"],
            &["UnitDefinitions"],
            &["TypeDefinitions"],
            &["LogCategories"],
            &["DefaultExperiment"],
            &["ModelVariables"],
            &["ModelStructure"],
            &["Annotations"],
        ],
    }
}

fn read_root(root: &Element, is_exact: bool, places: &mut Places) -> ModelDescription {
    let mut description = read_root_attributes(root, is_exact);
    let children = root.children_in_order(root_children(root.version()));
    let children = Element::first_of_each(children);
    for child in &children {
        read_root_child(child, &mut description, places);
    }
    for required in ["ModelVariables", "ModelStructure"] {
        if !children.iter().any(|child| child.name() == required) {
            root.report(Rule::MissingElement {
                parent: root.name().to_owned(),
                element: required,
            });
        }
    }
    description
}

fn read_root_attributes(root: &Element, is_exact: bool) -> ModelDescription {
    let version = root.version();
    let release = root.required_text("fmiVersion");
    if !is_exact {
        root.report(Rule::FmiVersion {
            found: release.clone(),
            expected: version,
        });
    }
    let is_usual = release.is_empty() || release == version.to_string();
    let description = ModelDescription {
        fmi_version: version,
        fmi_release: (!is_usual).then_some(release),
        model_name: root.required_text("modelName"),
        guid: root.required_text(match version {
            FmiVersion::V2 => "guid",
            FmiVersion::V3 => "instantiationToken",
        }),
        description: root.text("description"),
        author: root.text("author"),
        version: root.text("version"),
        copyright: root.text("copyright"),
        license: root.text("license"),
        generation_tool: root.text("generationTool"),
        generation_date_and_time: root.text("generationDateAndTime"),
        naming_convention: root
            .parsed(
                "variableNamingConvention",
                "flat or structured",
                NamingConvention::parse,
            )
            .unwrap_or_default(),
        number_of_event_indicators: match version {
            FmiVersion::V2 => root.unsigned("numberOfEventIndicators"),
            FmiVersion::V3 => None,
        },
        ..ModelDescription::default()
    };
    root.finish();
    description
}

fn read_root_child(child: &Element, into: &mut ModelDescription, places: &mut Places) {
    let version = child.version();
    match child.name() {
        "ModelExchange" => {
            places.model_exchange = child.place();
            into.model_exchange = Some(interface::model_exchange(child));
        }
        "CoSimulation" => {
            places.co_simulation = child.place();
            into.co_simulation = Some(interface::co_simulation(child));
        }
        "ScheduledExecution" => {
            places.scheduled_execution = child.place();
            into.scheduled_execution = Some(interface::scheduled_execution(child));
        }
        "UnitDefinitions" => {
            into.units = read_list(child, &["Unit"], &mut places.units, types::unit);
        }
        "TypeDefinitions" => {
            let places = &mut places.types;
            into.types = match version {
                FmiVersion::V2 => read_list(child, &["SimpleType"], places, types::simple_type),
                FmiVersion::V3 => read_list(child, types::ELEMENTS3, places, types::definition),
            };
        }
        "LogCategories" => {
            let places = &mut places.log_categories;
            into.log_categories = read_list(child, &["Category"], places, |e| {
                skip_annotations(e);
                LogCategory {
                    name: e.required_text("name"),
                    description: e.text("description"),
                }
            });
        }
        "DefaultExperiment" => {
            places.default_experiment = child.place();
            into.default_experiment = Some(read_experiment(child));
        }
        "VendorAnnotations" | "Annotations" => into.vendor_annotations = read_annotations(child),
        "ModelVariables" => {
            let places = &mut places.variables;
            into.variables = match version {
                FmiVersion::V2 => {
                    read_list(child, &["ScalarVariable"], places, variable2::variable)
                }
                FmiVersion::V3 => {
                    read_list(child, variable3::ELEMENTS, places, variable3::variable)
                }
            };
        }
        _ => {
            places.structure = child.place();
            into.structure = match version {
                FmiVersion::V2 => structure::structure2(child, places),
                FmiVersion::V3 => structure::structure3(child, places),
            };
        }
    }
}

fn read_experiment(e: &Element) -> DefaultExperiment {
    skip_annotations(e);
    let experiment = DefaultExperiment {
        start_time: e.real("startTime"),
        stop_time: e.real("stopTime"),
        tolerance: e.real("tolerance"),
        step_size: e.real("stepSize"),
    };
    e.finish();
    experiment
}

/// The items of a list element, which must not be empty.
fn read_list<T>(
    list: &Element,
    names: &[&'static str],
    places: &mut Vec<Place>,
    read: impl Fn(&Element) -> T,
) -> Vec<T> {
    list.finish();
    let elements = list.children_in_order(&[names]);
    if elements.is_empty() {
        list.report(Rule::EmptyElement {
            element: list.name().to_owned(),
        });
    }
    places.extend(elements.iter().map(Element::place));
    let read_one = |element: &Element| {
        let value = read(element);
        element.finish();
        value
    };
    elements.iter().map(read_one).collect()
}

/// Reads annotations; their content is not checked.
fn read_annotations(list: &Element) -> Vec<Tool> {
    let (item, name) = match list.version() {
        FmiVersion::V2 => ("Tool", "name"),
        FmiVersion::V3 => ("Annotation", "type"),
    };
    let seen = RefCell::new(BTreeSet::new());
    read_list(list, &[item], &mut Vec::new(), |e| {
        let tool = Tool {
            name: e.required_text(name),
            content: e.inner_xml().to_owned(),
        };
        if e.version() == FmiVersion::V2 {
            // The schema allows one element here, of any name.
            e.no_text();
            e.children().skip(1).for_each(|child| child.unexpected());
            if !seen.borrow_mut().insert(tool.name.clone()) {
                e.report(Rule::DuplicateTool {
                    name: tool.name.clone(),
                });
            }
        }
        tool
    })
}

/// Checks the children of an element that may have only annotations, and only in FMI 3.0. They are not kept.
fn skip_annotations(e: &Element) {
    let names: &[&[&str]] = match e.version() {
        FmiVersion::V2 => &[],
        FmiVersion::V3 => &[&["Annotations"]],
    };
    for annotations in Element::first_of_each(e.children_in_order(names)) {
        read_annotations(&annotations);
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
