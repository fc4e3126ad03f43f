//! `pilotage info`: what an FMU is and which variables it has.

use super::{Failure, Outcome, terminal};
use crate::fmi::Fmu;
use crate::fmi::description::{
    CoSimulation, DefaultExperiment, FmiVersion, ModelDescription, ScalarVariable, VariableKind,
};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Arguments of `pilotage info`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  pilotage info pilot.fmu\n  pilotage info pilot.fmu --json | jq .variables"
)]
pub struct Args {
    /// The FMU.
    fmu: PathBuf,
    /// Print one JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let fmu = Fmu::open(&args.fmu)?;
    let text = match args.json {
        true => format!("{:#}\n", to_json(&fmu)),
        false => to_text(&fmu),
    };
    terminal::print(&text)?;
    Ok(Outcome::Done)
}

/// Names of the capability flags that are true.
fn capabilities(cs: &CoSimulation, version: FmiVersion) -> Vec<&'static str> {
    let flags = cs.flags(version).into_iter();
    flags.filter(|(_, on)| *on).map(|(name, _)| name).collect()
}

/// Co-simulation, model exchange or both.
fn interfaces(description: &ModelDescription) -> Vec<&'static str> {
    let co_simulation = description
        .co_simulation
        .is_some()
        .then_some("co-simulation");
    let model_exchange = description
        .model_exchange
        .is_some()
        .then_some("model exchange");
    co_simulation.into_iter().chain(model_exchange).collect()
}

/// The start value as it would be given to `--set`; a list for an array.
fn start(variable: &ScalarVariable) -> Value {
    let mut values: Vec<Value> = match &variable.kind {
        VariableKind::Real(real) => real.start.iter().map(|v| json!(v)).collect(),
        VariableKind::Integer { start, .. } | VariableKind::Enumeration { start, .. } => {
            start.iter().map(|v| json!(v)).collect()
        }
        VariableKind::Boolean { start, .. } => start.iter().map(|v| json!(v)).collect(),
        VariableKind::String { start, .. } => start.iter().map(|v| json!(v)).collect(),
        VariableKind::Binary { start, .. } => start.iter().map(|v| json!(v)).collect(),
        VariableKind::Clock { .. } => Vec::new(),
    };
    match variable.dimensions.is_empty() {
        true => values.pop().unwrap_or_default(),
        false => Value::Array(values),
    }
}

fn to_json(fmu: &Fmu) -> Value {
    let d = fmu.description();
    let variables: Vec<Value> = (d.variables.iter())
        .map(|v| {
            json!({
                "name": v.name,
                "valueReference": v.value_reference,
                "type": v.kind.base_type().name(d.fmi_version),
                "causality": v.causality.as_str(),
                "variability": v.variability.as_str(),
                "unit": d.unit_of(v),
                "start": start(v),
                "description": v.description,
            })
        })
        .collect();
    let experiment = d.default_experiment.unwrap_or_default();
    json!({
        "file": fmu.path().display().to_string(),
        "modelName": d.model_name,
        "guid": d.guid,
        "description": d.description,
        "generationTool": d.generation_tool,
        "generationDateAndTime": d.generation_date_and_time,
        "interfaces": interfaces(d),
        "capabilities": d.co_simulation.as_ref().map(|cs| capabilities(cs, d.fmi_version)),
        "platforms": fmu.platforms(),
        "defaultExperiment": {
            "startTime": experiment.start_time,
            "stopTime": experiment.stop_time,
            "tolerance": experiment.tolerance,
            "stepSize": experiment.step_size,
        },
        "variables": variables,
    })
}

fn to_text(fmu: &Fmu) -> String {
    let d = fmu.description();
    let mut lines = vec![
        ("model", d.model_name.clone()),
        ("about", d.description.clone().unwrap_or_default()),
        (
            "interfaces",
            format!("FMI {}, {}", d.fmi_version, interfaces(d).join(" and ")),
        ),
        ("made by", d.generation_tool.clone().unwrap_or_default()),
        (
            "made on",
            d.generation_date_and_time.clone().unwrap_or_default(),
        ),
        ("guid", d.guid.clone()),
        ("platforms", fmu.platforms().join(", ")),
        (
            "experiment",
            d.default_experiment.map(experiment).unwrap_or_default(),
        ),
    ];
    if let Some(cs) = &d.co_simulation {
        lines.push(("capabilities", capabilities(cs, d.fmi_version).join(" ")));
    }
    let mut text = format!("{}\n", fmu.path().display());
    for (name, value) in lines.iter().filter(|(_, value)| !value.is_empty()) {
        text += &format!("  {name:<13} {value}\n");
    }
    text + "\n" + &table(d)
}

fn experiment(experiment: DefaultExperiment) -> String {
    let part = |name: &str, value: Option<f64>, unit: &str| {
        // `{:?}` has an exponent where `{}` has many zeros.
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

/// The variables, one a line, columns aligned.
fn table(d: &ModelDescription) -> String {
    let row = |v: &ScalarVariable| {
        let start = match start(v) {
            Value::Null => String::new(),
            Value::String(text) => text,
            other => other.to_string(),
        };
        [
            v.name.clone(),
            v.causality.to_string(),
            v.variability.to_string(),
            v.kind.base_type().name(d.fmi_version).to_owned(),
            d.unit_of(v).unwrap_or("").to_owned(),
            start,
            v.description.clone().unwrap_or_default(),
        ]
    };
    let header = [
        "variable",
        "causality",
        "variability",
        "type",
        "unit",
        "start",
        "description",
    ];
    let rows: Vec<[String; 7]> = std::iter::once(header.map(str::to_owned))
        .chain(d.variables.iter().map(row))
        .collect();
    let width = |column: usize| {
        let widths = rows.iter().map(|row| row[column].chars().count());
        widths.max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let mut text = String::new();
    for row in &rows {
        let cells = row.iter().zip(&widths);
        let line: String = cells
            .map(|(cell, &width)| format!("{cell:<width$}  "))
            .collect();
        text += line.trim_end();
        text += "\n";
    }
    text
}
