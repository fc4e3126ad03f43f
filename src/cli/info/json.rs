//! An FMU as one JSON object. Variables and unknowns are serialised one at a time, since an FMU may have 100,000 of
//! them.

use super::{capabilities, dimensions, enumerations, name_at, start, structure};
use crate::fmi::Fmu;
use crate::fmi::description::{
    EnumerationItem, ModelDescription, ScalarVariable, Unknown, VariableKind,
};
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::{Map, Value, json};

/// The object, pretty-printed.
pub(super) fn of(fmu: &Fmu) -> String {
    // Cannot fail: all keys are strings.
    serde_json::to_string_pretty(&Info(fmu)).unwrap_or_default() + "\n"
}

/// Serialises the FMU as an object with keys in alphabetical order.
struct Info<'a>(&'a Fmu);

impl Serialize for Info<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let d = self.0.description();
        let mut map = serializer.serialize_map(None)?;
        for (key, value) in &head(self.0) {
            match key.as_str() {
                "structure" => map.serialize_entry(key, &Structure(d))?,
                "variables" => map.serialize_entry(key, &Variables(d))?,
                _ => map.serialize_entry(key, value)?,
            }
        }
        map.end()
    }
}

struct Variables<'a>(&'a ModelDescription);

impl Serialize for Variables<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let units = self.0.units_of_variables();
        let all = self.0.variables.iter();
        serializer.collect_seq(all.map(|v| variable(self.0, v, units(v))))
    }
}

struct Structure<'a>(&'a ModelDescription);

impl Serialize for Structure<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut lists = structure(self.0);
        lists.sort_unstable_by_key(|(name, _)| *name);
        serializer.collect_map(
            lists
                .into_iter()
                .map(|(name, list)| (name, Unknowns(self.0, list))),
        )
    }
}

/// Each unknown with the names of its dependencies; null if they are not declared.
struct Unknowns<'a>(&'a ModelDescription, &'a [Unknown]);

impl Serialize for Unknowns<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.1.iter().map(|unknown| entry(self.0, unknown)))
    }
}

/// All entries; the long lists are placeholders.
fn head(fmu: &Fmu) -> Map<String, Value> {
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
    let head = json!({
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
        "sources": fmu.has_sources(),
        "defaultExperiment": {
            "startTime": experiment.start_time,
            "stopTime": experiment.stop_time,
            "tolerance": experiment.tolerance,
            "stepSize": experiment.step_size,
        },
        "logCategories": d.log_categories.iter().map(|c| &c.name).collect::<Vec<_>>(),
        "numberOfEventIndicators": d.number_of_event_indicators,
        "enumerations": enumerations(d).map(enumeration).collect::<Map<_, _>>(),
        "variables": null,
        "structure": null,
        "files": fmu.files().collect::<Vec<_>>(),
    });
    match head {
        Value::Object(head) => head,
        _ => unreachable!("it is written as an object"),
    }
}

/// An enumeration by name, with its items.
fn enumeration((name, items): (&str, &[EnumerationItem])) -> (String, Value) {
    let item = |item: &EnumerationItem| json!({ "name": item.name, "value": item.value, "description": item.description });
    (name.to_owned(), items.iter().map(item).collect())
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
        "declaredType": v.kind.declared_type(),
        "causality": v.causality.as_str(),
        "variability": v.variability.as_str(),
        "initial": v.effective_initial().map(|initial| initial.to_string()),
        "dimensions": dimensions(d, v),
        "size": d.size(v),
        "unit": unit,
        "start": start(v),
        "derivativeOf": derivative_of,
        "description": v.description,
    })
}

fn entry(d: &ModelDescription, unknown: &Unknown) -> Value {
    let names = |indices: &Vec<u32>| -> Vec<&str> {
        indices.iter().map(|index| name_at(d, *index)).collect()
    };
    json!({
        "name": name_at(d, unknown.index),
        "dependencies": unknown.dependencies.as_ref().map(names),
    })
}
