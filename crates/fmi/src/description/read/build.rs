//! Checks of buildDescription.xml (FMI 3.0, section 2.5; adopted by FMI 2.0.4, section 2.3).

use super::element::Element;
use super::terminals::judged;
use super::*;
use crate::description::Finding;
use std::collections::BTreeSet;

/// All findings about a buildDescription.xml. `document` is the parsed `text`.
pub fn build(
    text: &str,
    document: &roxmltree::Document,
    description: &ModelDescription,
) -> Vec<Finding> {
    let expected = "fmiBuildDescription";
    judged(text, document, description, expected, |root| {
        let children = root.children_in_order(&[&["BuildConfiguration"], &["Annotations"]]);
        if !children.iter().any(|c| c.name() == "BuildConfiguration") {
            root.report(Rule::MissingElement {
                parent: root.name().to_owned(),
                element: "BuildConfiguration",
            });
        }
        for child in children {
            match child.name() {
                "BuildConfiguration" => configuration(&child, description),
                _ => drop(read_annotations(&child)),
            }
        }
    })
}

fn configuration(e: &Element, description: &ModelDescription) {
    let found = e.required_text("modelIdentifier");
    let identifiers = [
        (description.model_exchange.as_ref()).map(|i| i.model_identifier.as_str()),
        (description.co_simulation.as_ref()).map(|i| i.model_identifier.as_str()),
        (description.scheduled_execution.as_ref()).map(|i| i.model_identifier.as_str()),
    ];
    if e.has("modelIdentifier") && !identifiers.contains(&Some(found.as_str())) {
        e.report(Rule::UnknownIdentifier { found });
    }
    e.text("platform");
    e.text("description");
    for child in e.children_in_order(&[&["SourceFileSet"], &["Library"], &["Annotations"]]) {
        match child.name() {
            "SourceFileSet" => source_files(&child),
            "Library" => {
                child.required_text("name");
                child.text("version");
                child.flag("external");
                child.text("description");
                skip_annotations(&child);
                child.finish();
            }
            _ => drop(read_annotations(&child)),
        }
    }
    e.finish();
}

fn source_files(e: &Element) {
    for attribute in ["name", "language", "compiler", "compilerOptions"] {
        e.text(attribute);
    }
    if e.has("compilerOptions") && !e.has("compiler") {
        e.report(Rule::OptionsWithoutCompiler);
    }
    let groups: &[&[&str]] = &[
        &["SourceFile"],
        &["PreprocessorDefinition"],
        &["IncludeDirectory"],
        &["Annotations"],
    ];
    let children = e.children_in_order(groups);
    if !children.iter().any(|child| child.name() == "SourceFile") {
        e.report(Rule::MissingElement {
            parent: e.name().to_owned(),
            element: "SourceFile",
        });
    }
    let mut seen = BTreeSet::new();
    for child in children {
        if child.name() == "Annotations" {
            read_annotations(&child);
            continue;
        }
        let name = child.required_text("name");
        if !seen.insert((child.name(), name.clone())) {
            let element = child.name().to_owned();
            child.report(Rule::DuplicateInBuild { element, name });
        }
        if child.name() == "PreprocessorDefinition" {
            definition(&child);
        } else {
            skip_annotations(&child);
        }
        child.finish();
    }
    e.finish();
}

fn definition(e: &Element) {
    e.flag("optional");
    e.text("value");
    e.text("description");
    for child in e.children_in_order(&[&["Option"], &["Annotations"]]) {
        if child.name() == "Annotations" {
            read_annotations(&child);
            continue;
        }
        child.text("value");
        child.text("description");
        child.children_in_order(&[]);
        child.finish();
    }
}
