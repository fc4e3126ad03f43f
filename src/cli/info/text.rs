//! An FMU as text and tables.

use super::super::format::aligned;
use super::{capabilities, dimensions, name_at, start, structure};
use crate::cli::terminal;
use crate::fmi::description::{
    Alias, DefaultExperiment, ModelDescription, ScalarVariable, Unknown, VariableKind,
};
use crate::fmi::{Fmu, platform};
use serde_json::Value;

pub(super) fn of(fmu: &Fmu) -> String {
    let d = fmu.description();
    let text = |value: &Option<String>| value.clone().unwrap_or_default();
    let capabilities = capabilities(d);
    let kinds: Vec<String> = capabilities
        .iter()
        .map(|(kind, _)| kind.to_string())
        .collect();
    let mut lines = vec![
        ("model", d.model_name.clone()),
        ("about", text(&d.description)),
        (
            "interfaces",
            format!("FMI {}, {}", d.fmi_version, kinds.join(" and ")),
        ),
        ("author", text(&d.author)),
        ("version", text(&d.version)),
        ("license", text(&d.license)),
        ("made by", text(&d.generation_tool)),
        ("made on", text(&d.generation_date_and_time)),
        ("guid", d.guid.clone()),
        ("platforms", platforms(fmu)),
        (
            "experiment",
            d.default_experiment.map(experiment).unwrap_or_default(),
        ),
        ("contains", contents(d)),
    ];
    for (kind, names) in &capabilities {
        if !names.is_empty() {
            lines.push(("capabilities", format!("{kind}: {}", names.join(" "))));
        }
    }
    let mut text = format!("{}\n", terminal::shown(fmu.path()));
    for (name, value) in lines.iter().filter(|(_, value)| !value.is_empty()) {
        text += &format!("  {name:<13} {}\n", terminal::line(value));
    }
    text + "\n" + &variables(d) + &enumerations(d) + &dependencies(d)
}

/// The platforms for which it has binaries, whether this machine is none of them, and whether there are sources.
fn platforms(fmu: &Fmu) -> String {
    let own = platform::folders();
    let has = fmu.platforms();
    let is_here = has.iter().any(|folder| own.contains(folder));
    let machine = || format!("none for this machine, which is {}", own.join(" or "));
    let sources = match (is_here, fmu.has_sources()) {
        (true, true) => "sources",
        (false, true) => "sources, of which `pilotage compile` makes one",
        (_, false) => "",
    };
    let binaries = (!has.is_empty()).then(|| has.join(", "));
    let note = (!is_here && (binaries.is_some() || fmu.has_sources())).then(machine);
    let parts = binaries.into_iter().chain(note).chain([sources.to_owned()]);
    let parts: Vec<String> = parts.filter(|part| !part.is_empty()).collect();
    parts.join("; ")
}

/// Number of variables, outputs, states and event indicators.
fn contents(d: &ModelDescription) -> String {
    let indicators = match d.structure.event_indicators.len() {
        0 => d.number_of_event_indicators.unwrap_or(0) as usize,
        listed => listed,
    };
    let counts = [
        (d.variables.len(), "variable"),
        (d.structure.outputs.len(), "output"),
        (d.structure.derivatives.len(), "continuous state"),
        (indicators, "event indicator"),
    ];
    let shown = counts.iter().filter(|(count, _)| *count > 0);
    let words: Vec<String> = shown
        .map(|(count, what)| format!("{count} {what}{}", if *count == 1 { "" } else { "s" }))
        .collect();
    words.join(", ")
}

fn experiment(experiment: DefaultExperiment) -> String {
    let part = |name: &str, value: Option<f64>, unit: &str| {
        // `{:?}` uses exponents, where `{}` prints many zeros.
        value.map(|value| {
            format!(
                "{name} {}{unit}",
                format!("{value:?}").trim_end_matches(".0")
            )
        })
    };
    let parts = [
        part("start", experiment.start_time, " s"),
        part("stop", experiment.stop_time, " s"),
        part("step", experiment.step_size, " s"),
        part("tolerance", experiment.tolerance, ""),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    parts.join(", ")
}

/// The variables and their aliases as an aligned table.
fn variables(d: &ModelDescription) -> String {
    let header = [
        "variable",
        "causality",
        "variability",
        "type",
        "unit",
        "start",
        "description",
    ];
    let mut rows = vec![header.map(str::to_owned)];
    let units = d.units_of_variables();
    for v in &d.variables {
        rows.push(row(d, v, units(v).unwrap_or("")));
        rows.extend(v.aliases.iter().map(|alias| alias_row(v, alias)));
    }
    aligned(&rows)
}

fn row(d: &ModelDescription, v: &ScalarVariable, unit: &str) -> [String; 7] {
    let start = match start(v) {
        Value::Null => String::new(),
        Value::String(text) => text,
        other => other.to_string(),
    };
    [
        v.name.clone(),
        v.causality.to_string(),
        v.variability.to_string(),
        kind(d, v),
        unit.to_owned(),
        start,
        v.description.clone().unwrap_or_default(),
    ]
}

/// The type with the dimensions of an array, by name where a structural parameter has the size, or with the name of the
/// enumeration.
fn kind(d: &ModelDescription, v: &ScalarVariable) -> String {
    let sizes = dimensions(d, v).into_iter().map(|size| match size {
        Value::String(name) => name,
        number => number.to_string(),
    });
    let sizes: Vec<String> = sizes.collect();
    let mut kind = v.kind.base_type().name(d.fmi_version).to_owned();
    if !sizes.is_empty() {
        kind += &format!("[{}]", sizes.join(", "));
    }
    match v.kind.declared_type() {
        Some(name) if matches!(v.kind, VariableKind::Enumeration { .. }) => {
            format!("{kind} {name}")
        }
        _ => kind,
    }
}

/// The items of the enumerations as an aligned table.
fn enumerations(d: &ModelDescription) -> String {
    let mut rows = vec![["enumeration", "value", "name", "description"].map(str::to_owned)];
    for (name, items) in super::enumerations(d) {
        rows.extend(items.iter().map(|item| {
            [
                name.to_owned(),
                item.value.to_string(),
                item.name.clone(),
                item.description.clone().unwrap_or_default(),
            ]
        }));
    }
    match rows.len() {
        1 => String::new(),
        _ => format!("\n{}", aligned(&rows)),
    }
}

fn alias_row(v: &ScalarVariable, alias: &Alias) -> [String; 7] {
    let mut row: [String; 7] = Default::default();
    row[0].clone_from(&alias.name);
    row[1] = "alias".to_owned();
    row[6] = match &alias.description {
        Some(description) => format!("another name of {}; {description}", v.name),
        None => format!("another name of {}", v.name),
    };
    row
}

/// Declared dependencies of outputs and derivatives.
fn dependencies(d: &ModelDescription) -> String {
    let row = |unknown: &Unknown| {
        let names = unknown.dependencies.as_ref()?;
        let names: Vec<&str> = names.iter().map(|index| name_at(d, *index)).collect();
        let names = match names.is_empty() {
            true => "nothing".to_owned(),
            false => names.join(", "),
        };
        Some([name_at(d, unknown.index).to_owned(), names])
    };
    let lists = structure(d).into_iter();
    let shown = lists.filter(|(name, _)| ["outputs", "derivatives"].contains(name));
    let rows: Vec<[String; 2]> = shown
        .flat_map(|(_, list)| list.iter().filter_map(row))
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    let header = ["unknown", "depends on"].map(str::to_owned);
    let rows: Vec<_> = std::iter::once(header).chain(rows).collect();
    format!("\n{}", aligned(&rows))
}
