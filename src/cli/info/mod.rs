//! `pilotage info`: attributes, variables and dependencies of an FMU; components of a system.
//!
//! | module | what it prints |
//! | --- | --- |
//! | `text` | text and tables for people |
//! | `json` | one JSON object for programs |
//! | `system` | text and JSON for systems |

mod json;
mod system;
mod text;

use super::model::{check, open};
use super::overwrite::Overwrite;
use super::recognise::{self, FileKind};
use super::{Failure, Outcome, terminal};
use crate::fmi::description::{
    Dimension, EnumerationItem, ModelDescription, ScalarVariable, TypeKind, Unknown, VariableKind,
};
use crate::fmi::{Fmu, InterfaceType};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Arguments of `pilotage info`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  pilotage info pilot.fmu\n  pilotage info pilot.fmu --json | jq '.variables[].name'\n  pilotage info pilot.fmu --json | jq '.structure.outputs'\n  pilotage info system.toml --figure system.svg"
)]
pub struct Args {
    /// The FMU: its file, or the folder that it was unpacked into. Or a system file (TOML, SSP, OSP, maestro), of which the instances,
    /// connections, free inputs and outputs are shown, or a model file, as of `pilotage model check`.
    fmu: PathBuf,
    /// Variant of an SSP with several .ssd, by its name or its file's.
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
    /// Draw a system into this file, .svg or .png.
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print one JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    recognise::expect(
        [&args.fmu],
        &[
            FileKind::Fmu,
            FileKind::Archive,
            FileKind::System,
            FileKind::Model,
        ],
        "an FMU, a system file or a model file",
    )?;
    if recognise::is_model(&args.fmu) && args.figure.is_none() {
        return check::run(open::read(&args.fmu)?, args.json);
    }
    if recognise::may_be_system(&args.fmu) {
        terminal::print(&system::of(&args)?)?;
        return Ok(Outcome::Done);
    }
    if args.figure.is_some() {
        return Err(Failure::new("--figure draws systems, and this is one FMU"));
    }
    let fmu = Fmu::open(&args.fmu)?;
    let text = match args.json {
        true => json::of(&fmu),
        false => text::of(&fmu),
    };
    terminal::print(&text)?;
    Ok(Outcome::Done)
}

/// The supported interface types, each with the names of its capabilities.
fn capabilities(d: &ModelDescription) -> Vec<(InterfaceType, Vec<&'static str>)> {
    let version = d.fmi_version;
    let cs = d.co_simulation.as_ref().map(|e| e.flags(version));
    let me = d.model_exchange.as_ref().map(|e| e.flags(version));
    let se = d.scheduled_execution.as_ref().map(|e| e.flags(version));
    let all = [
        (InterfaceType::CoSimulation, cs),
        (InterfaceType::ModelExchange, me),
        (InterfaceType::ScheduledExecution, se),
    ];
    let names = |flags: Vec<(&'static str, bool)>| {
        let on = flags.into_iter().filter(|(_, on)| *on);
        on.map(|(name, _)| name).collect()
    };
    (all.into_iter())
        .filter_map(|(kind, flags)| Some((kind, names(flags?))))
        .collect()
}

/// The start value as accepted by `--set`; a list for arrays.
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

/// The sizes of an array, each a number or the name of the structural parameter that has it; empty for a scalar.
fn dimensions(d: &ModelDescription, variable: &ScalarVariable) -> Vec<Value> {
    let size = |dimension: &Dimension| match dimension {
        Dimension::Fixed(size) => json!(size),
        Dimension::Variable(index) => json!(name_at(d, *index)),
    };
    variable.dimensions.iter().map(size).collect()
}

/// The enumerations with their items.
fn enumerations(d: &ModelDescription) -> impl Iterator<Item = (&str, &[EnumerationItem])> {
    d.types.iter().filter_map(|own| match &own.kind {
        TypeKind::Enumeration { items, .. } => Some((own.name.as_str(), items.as_slice())),
        _ => None,
    })
}

/// The non-empty lists of the model structure, named as their XML elements in FMI 2.0.
fn structure(d: &ModelDescription) -> Vec<(&'static str, &[Unknown])> {
    let s = &d.structure;
    let lists: [(&str, &[Unknown]); 5] = [
        ("outputs", &s.outputs),
        ("derivatives", &s.derivatives),
        ("clockedStates", &s.clocked_states),
        ("eventIndicators", &s.event_indicators),
        ("initialUnknowns", &s.initial_unknowns),
    ];
    lists
        .into_iter()
        .filter(|(_, list)| !list.is_empty())
        .collect()
}

/// Name of the variable with the given index (from 1).
fn name_at(d: &ModelDescription, index: u32) -> &str {
    let position = (index as usize).checked_sub(1);
    let variable = position.and_then(|position| d.variables.get(position));
    variable.map_or("?", |v| v.name.as_str())
}
