//! Resolves `model = "..."`: a built-in model, an FMU, or a model, pilot or vehicle file.

use super::super::Failure;
use super::super::model::open;
use super::super::recognise::{self, FileKind};
use super::isolation::Isolation;
use crate::cosim::description::{InstanceDescription, InstanceSource, Interface};
use crate::cosim::{Component, fmu_component, native_component};
use crate::flights::kind::Numbers;
use crate::fmi;
use crate::models::model::Model;
use crate::models::{AnyModel, library};
use crate::suggestion::{did_you_mean, suggestion};
use std::path::{Path, PathBuf};

/// An opened instance.
pub enum Resolved {
    /// A model, ready to run.
    Model(Box<dyn Component>),
    /// Path of a table.
    Table(PathBuf),
}

/// What an instance is made of.
pub enum Source {
    /// A model of pilotage.
    Native(AnyModel),
    /// An FMU, with the interface to use.
    Fmu(PathBuf, Option<fmi::InterfaceType>),
    /// A table.
    Table(PathBuf),
}

/// Opens the source of an instance.
pub fn resolve(instance: &InstanceDescription, isolation: &Isolation) -> Result<Resolved, Failure> {
    let place = instance.source.place.as_ref();
    let component = match source(instance)? {
        Source::Table(file) => return Ok(Resolved::Table(file)),
        Source::Native(model) => return Ok(Resolved::Model(native_component::of_model(model))),
        Source::Fmu(file, kind) if isolation.is_of(&instance.name) => {
            isolation.open(&file, &instance.name, kind)
        }
        Source::Fmu(file, kind) => {
            fmu_component::open(&file, &instance.name, kind).map_err(Failure::from)
        }
    };
    component
        .map(Resolved::Model)
        .map_err(|failure| failure.at(place))
}

/// Reads what an instance is made of; of an FMU it says where it is.
pub fn source(instance: &InstanceDescription) -> Result<Source, Failure> {
    let place = instance.source.place.as_ref();
    let folder = place.and_then(|place| Path::new(&place.file).parent());
    if let (Some(order), Some(file)) = (&instance.order, instance.source.value.file()) {
        let message = format!(
            "`{}` has an order, and {} has none",
            instance.name,
            file.display()
        );
        return Err(Failure::new(message)
            .at(order.place.as_ref())
            .hint("leave `order` out"));
    }
    let source = match &instance.source.value {
        InstanceSource::BuiltIn(name) => built_in(name, instance, folder),
        InstanceSource::Model(file) => model(file, instance),
        InstanceSource::Table(file) => table(file),
    };
    source.map_err(|failure| failure.at(place))
}

/// Opens a built-in model.
fn built_in(
    name: &str,
    instance: &InstanceDescription,
    folder: Option<&Path>,
) -> Result<Source, Failure> {
    if library::find(name).is_none() {
        return Err(unknown(name, folder.unwrap_or(Path::new(""))));
    }
    let order = instance.order.as_ref();
    let model = open::named(name, order.map(|order| order.value as usize))?;
    Ok(Source::Native(AnyModel::Text(model)))
}

/// The failure for an unknown built-in model, with a suggestion of a similar model or file.
fn unknown(name: &str, folder: &Path) -> Failure {
    let built_in = library::all().iter().map(|model| model.name);
    let beside = beside(folder);
    let near = suggestion(name, beside.iter().map(String::as_str));
    let meant = match (suggestion(name, built_in), near) {
        (Some(near), _) => format!("did you mean `{near}`?"),
        (None, Some(near)) => format!("did you mean the file `{near}`?"),
        (None, None) => {
            "`pilotage models` lists them, and a file is named with its ending, or with ./".into()
        }
    };
    Failure::new(format!("there is no built-in model `{name}`; {meant}"))
}

/// Names of the files in a folder, sorted.
fn beside(folder: &Path) -> Vec<String> {
    let folder = match folder.as_os_str().is_empty() {
        true => Path::new("."),
        false => folder,
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

/// Refuses a missing file, with a suggestion of a similar one in its folder.
fn expect_there(file: &Path) -> Result<(), Failure> {
    if file.exists() {
        return Ok(());
    }
    let folder = file.parent().unwrap_or(Path::new(""));
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let beside = beside(folder);
    let near = suggestion(&name, beside.iter().map(String::as_str));
    let near = near.map(|near| folder.join(near).display().to_string());
    let words = did_you_mean(near.as_deref());
    let failure = Failure::new(format!("there is no file {}{words}", file.display()));
    Err(match near {
        Some(_) => failure,
        None => failure.hint("a system file names files from its folder, arguments from this one"),
    })
}

fn table(file: &Path) -> Result<Source, Failure> {
    let kinds = [FileKind::Trial, FileKind::Table];
    recognise::expect([&file.to_owned()], &kinds, "a table over time (CSV)")?;
    expect_there(file)?;
    Ok(Source::Table(file.to_owned()))
}

fn model(file: &Path, instance: &InstanceDescription) -> Result<Source, Failure> {
    let kinds = [
        FileKind::Fmu,
        FileKind::Archive,
        FileKind::Pilot,
        FileKind::Vehicle,
        FileKind::Model,
    ];
    let words = "an FMU, a model file, a pilot file or a vehicle file";
    recognise::expect([&file.to_owned()], &kinds, words)?;
    expect_there(file)?;
    // A file that `fit -o` has written may have any ending.
    let texts = [FileKind::Pilot, FileKind::Vehicle, FileKind::Model];
    let is_text = recognise::of(file).is_some_and(|kind| texts.contains(&kind));
    Ok(match is_text || recognise::is_toml(file) {
        true if recognise::is_model(file) => Source::Native(AnyModel::Text(open::read(file)?)),
        true => Source::Native(AnyModel::BuiltIn(native(file)?)),
        false => Source::Fmu(file.to_owned(), instance.interface.map(kind)),
    })
}

fn kind(interface: Interface) -> fmi::InterfaceType {
    match interface {
        Interface::CoSimulation => fmi::InterfaceType::CoSimulation,
        Interface::ModelExchange => fmi::InterfaceType::ModelExchange,
    }
}

/// The model of a pilot or vehicle file.
fn native(file: &Path) -> Result<Model, Failure> {
    let name = file.display().to_string();
    match Numbers::read(file)? {
        Some(numbers) => Ok(numbers.model(&name)?),
        None => Err(Failure::new(format!(
            "{name} is neither a model file ([model]) nor a pilot file ([theta]) nor a vehicle file (mass = ...)"
        ))),
    }
}
