//! An FMU as one JSON object.

use super::{capabilities, name_at, start, structure};
use crate::fmi::Fmu;
use crate::fmi::description::{ModelDescription, ScalarVariable, Unknown, VariableKind};
use serde_json::{Map, Value, json};

pub(super) fn of(fmu: &Fmu) -> Value {
    let d = fmu.description();
    let capabilities = capabilities(d);
    let kinds: Vec<String> = capabilities
        .iter()
        .map(|(kind, _)| kind.to_string())
        .collect();
    let flags: Map<String, Value> = (capabilities.iter())
        .map(|(kind, names)| (kind.to_string(), json!(names)))
        .collect();
    let experiment = d.default_experiment.unwrap_or_default();
    json!({
        "file": fmu.path().display().to_string(),
        "fmiVersion": d.fmi_version.to_string(),
        "modelName": d.model_name,
        "guid": d.guid,
        "description": d.description,
        "author": d.author,
        "version": d.version,
        "license": d.license,
        "generationTool": d.generation_tool,
        "generationDateAndTime": d.generation_date_and_time,
        "interfaces": kinds,
        "capabilities": flags,
        "platforms": fmu.platforms(),
        "defaultExperiment": {
            "startTime": experiment.start_time,
            "stopTime": experiment.stop_time,
            "tolerance": experiment.tolerance,
            "stepSize": experiment.step_size,
        },
        "logCategories": d.log_categories.iter().map(|c| &c.name).collect::<Vec<_>>(),
        "numberOfEventIndicators": d.number_of_event_indicators,
        "variables": variables(d),
        "structure": structure(d)
            .into_iter()
            .map(|(name, list)| (name.to_owned(), unknowns(d, list)))
            .collect::<Map<String, Value>>(),
        "files": fmu.files().collect::<Vec<_>>(),
    })
}

fn variables(d: &ModelDescription) -> Vec<Value> {
    let units = d.units_of_variables();
    let all = d.variables.iter();
    all.map(|v| variable(d, v, units(v))).collect()
}

fn variable(d: &ModelDescription, v: &ScalarVariable, unit: Option<&str>) -> Value {
    let derivative_of = match &v.kind {
        VariableKind::Real(real) => real.derivative.map(|index| name_at(d, index)),
        _ => None,
    };
    json!({
        "name": v.name,
        "aliases": v.aliases.iter().map(|alias| &alias.name).collect::<Vec<_>>(),
        "valueReference": v.value_reference,
        "type": v.kind.base_type().name(d.fmi_version),
        "causality": v.causality.as_str(),
        "variability": v.variability.as_str(),
        "initial": v.effective_initial().map(|initial| initial.to_string()),
        "size": d.size(v),
        "unit": unit,
        "start": start(v),
        "derivativeOf": derivative_of,
        "description": v.description,
    })
}

/// Each unknown with the names of what it depends on; null where that is not declared.
fn unknowns(d: &ModelDescription, list: &[Unknown]) -> Value {
    let names = |indices: &Vec<u32>| -> Vec<&str> {
        indices.iter().map(|index| name_at(d, *index)).collect()
    };
    let entry = |unknown: &Unknown| {
        json!({
            "name": name_at(d, unknown.index),
            "dependencies": unknown.dependencies.as_ref().map(names),
        })
    };
    list.iter().map(entry).collect()
}
