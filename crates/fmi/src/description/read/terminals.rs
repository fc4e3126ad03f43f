//! Checks of terminalsAndIcons.xml (FMI 3.0, section 2.4.9; adopted by FMI 2.0.4, section 2.3).

use super::element::{Context, Element};
use super::*;
use crate::description::Finding;
use std::collections::BTreeSet;

/// All findings about a terminalsAndIcons.xml. `document` is the parsed `text`.
pub fn terminals(
    text: &str,
    document: &roxmltree::Document,
    description: &ModelDescription,
) -> Vec<Finding> {
    let expected = "fmiTerminalsAndIcons";
    judged(text, document, description, expected, |root| {
        let variables = description.variables.iter();
        let names: BTreeSet<&str> = variables
            .flat_map(|v| {
                let aliases = v.aliases.iter().map(|alias| alias.name.as_str());
                std::iter::once(v.name.as_str()).chain(aliases)
            })
            .collect();
        let groups: &[&[&str]] = &[
            &["GraphicalRepresentation"],
            &["Terminals"],
            &["Annotations"],
        ];
        for child in Element::first_of_each(root.children_in_order(groups)) {
            match child.name() {
                "GraphicalRepresentation" => representation(&child),
                "Terminals" => {
                    child.finish();
                    siblings(&child, child.children_named("Terminal"), &names);
                }
                _ => drop(read_annotations(&child)),
            }
        }
    })
}

/// Reads an additional file of FMI 3.0 with `judge` and returns the findings.
pub(super) fn judged(
    text: &str,
    document: &roxmltree::Document,
    description: &ModelDescription,
    expected: &'static str,
    judge: impl FnOnce(&Element),
) -> Vec<Finding> {
    let context = Context::new(text, FmiVersion::V3, None);
    let root = context.element(document.root_element());
    if root.name() == expected {
        let found = root.required_text("fmiVersion");
        let release = description.fmi_release.clone();
        let of_description = release.unwrap_or_else(|| description.fmi_version.to_string());
        // FMI 2.0 adopts the file from FMI 3.0, whose schema allows only its own version.
        let is_taken_over = description.fmi_version == FmiVersion::V2 && found.starts_with("3.");
        if root.has("fmiVersion") && found != of_description && !is_taken_over {
            root.report(Rule::PartVersion {
                found,
                expected: of_description,
            });
        }
        judge(&root);
        root.finish();
    } else {
        root.report(Rule::WrongRoot {
            found: root.name().to_owned(),
            expected,
        });
    }
    drop(root);
    let mut findings = context.findings.into_inner();
    for finding in &mut findings {
        finding.version = description.fmi_version;
    }
    findings
}

fn representation(e: &Element) {
    e.finish();
    let groups: &[&[&str]] = &[&["CoordinateSystem"], &["Icon"], &["Annotations"]];
    for child in Element::first_of_each(e.children_in_order(groups)) {
        match child.name() {
            "CoordinateSystem" => {
                let corners = corners(&child);
                positive(&child, "suggestedScalingFactorTo_mm", true);
                // Icons may be flipped, but the coordinate system is the reference for that.
                if corners.is_some_and(|[x1, y1, x2, y2]| x1 >= x2 || y1 >= y2) {
                    child.report(Rule::CoordinateOrder);
                }
                child.children_in_order(&[]);
                child.finish();
            }
            "Icon" => {
                area(&child);
                child.children_in_order(&[]);
                child.finish();
            }
            _ => drop(read_annotations(&child)),
        }
    }
}

/// Sibling terminals, whose names must differ.
fn siblings(parent: &Element, terminals: Vec<Element>, variables: &BTreeSet<&str>) {
    if terminals.is_empty() && parent.name() == "Terminals" {
        parent.report(Rule::EmptyElement {
            element: parent.name().to_owned(),
        });
    }
    let mut seen = BTreeSet::new();
    for terminal in terminals {
        let name = terminal.required_text("name");
        if !seen.insert(name.clone()) {
            terminal.report(Rule::DuplicateTerminal { name });
        }
        terminal.required_text("matchingRule");
        terminal.text("terminalKind");
        terminal.text("description");
        members(&terminal, variables);
        terminal.finish();
    }
}

fn members(terminal: &Element, variables: &BTreeSet<&str>) {
    let groups: &[&[&str]] = &[
        &["TerminalMemberVariable"],
        &["TerminalStreamMemberVariable"],
        &["Terminal"],
        &["TerminalGraphicalRepresentation"],
        &["Annotations"],
    ];
    let mut inner = Vec::new();
    let mut seen = BTreeSet::new();
    let known = |e: &Element, attribute: &'static str| {
        let name = e.required_text(attribute);
        if e.has(attribute) && !variables.contains(name.as_str()) {
            let element = e.name().to_owned();
            e.report(Rule::UnknownMember {
                element,
                name: name.clone(),
            });
        }
        name
    };
    for child in terminal.children_in_order(groups) {
        match child.name() {
            "TerminalMemberVariable" => {
                let member = child.text("memberName");
                child.required_text("variableKind");
                let variable = known(&child, "variableName");
                if !seen.insert((variable.clone(), member)) {
                    child.report(Rule::DuplicateMember { name: variable });
                }
                skip_annotations(&child);
                child.finish();
            }
            "TerminalStreamMemberVariable" => {
                child.required_text("inStreamMemberName");
                child.required_text("outStreamMemberName");
                known(&child, "inStreamVariableName");
                known(&child, "outStreamVariableName");
                skip_annotations(&child);
                child.finish();
            }
            "Terminal" => inner.push(child),
            "TerminalGraphicalRepresentation" => {
                area(&child);
                child.list("defaultConnectionColor", "0 to 255", |word| {
                    word.parse::<u8>().ok()
                });
                positive(&child, "defaultConnectionStrokeSize", false);
                child.required_text("iconBaseName");
                skip_annotations(&child);
                child.finish();
            }
            _ => drop(read_annotations(&child)),
        }
    }
    siblings(terminal, inner, variables);
}

/// `x1`, `y1`, `x2`, `y2`, if all exist.
fn corners(e: &Element) -> Option<[f64; 4]> {
    let [x1, y1, x2, y2] = ["x1", "y1", "x2", "y2"].map(|name| e.required(name, e.real(name)));
    Some([x1?, y1?, x2?, y2?])
}

fn area(e: &Element) {
    if corners(e).is_some_and(|[x1, y1, x2, y2]| x1 == x2 || y1 == y2) {
        e.report(Rule::EmptyArea {
            element: e.name().to_owned(),
        });
    }
}

fn positive(e: &Element, attribute: &'static str, is_required: bool) {
    let value = e.real(attribute);
    if is_required {
        e.required(attribute, value);
    }
    if let Some(found) = value.filter(|value| *value <= 0.0 || value.is_nan()) {
        let found = found.to_string();
        e.report(Rule::NotPositive { attribute, found });
    }
}
