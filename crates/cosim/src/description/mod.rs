//! Description of a [`System`] from a file or a command line: instances, wires, start values. No model is opened here.
//!
//! ```
//! use pilotage_cosim::SystemDescription;
//!
//! let text = r#"
//! [system.pilot]
//! model = "pilot.toml"
//! set = { target = 10 }
//! [system.vehicle]
//! model = "quadcopter.fmu"
//! [connect]
//! "pilot.stick" = "vehicle.stick"
//! "vehicle.z" = ["pilot.position"]
//! "#;
//! let system = SystemDescription::parse(text, "flight.toml".as_ref())?;
//! assert_eq!(system.instances[1].name, "vehicle");
//! assert_eq!(system.connections[1].to.value, "pilot.position");
//! assert_eq!(system.settings[0].name.value, "pilot.target");
//! # Ok::<(), pilotage_cosim::DescriptionError>(())
//! ```
//!
//! | module | content |
//! | --- | --- |
//! | `kept` | temporary files that last as long as a description |
//! | `read` | reads a system file |
//! | `write` | writes a system file |

mod kept;
mod read;
mod write;

pub use crate::system::Transformation;
pub use kept::Kept;
pub use read::{DescriptionError, KEYS};
pub use write::{HEADER, SaveError};

use super::system::{System, SystemError};
use pilotage_text::document::Place;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A value with its place in a file; values from the command line have no place.
#[derive(Debug, Clone, PartialEq)]
pub struct Spanned<T> {
    /// The value.
    pub value: T,
    /// Its place, if from a file.
    pub place: Option<Place>,
}

impl<T> From<T> for Spanned<T> {
    /// A value from the command line.
    fn from(value: T) -> Self {
        Self { value, place: None }
    }
}

/// Instances, wires and start values, each in the order given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SystemDescription {
    /// Simulated instances, and tables that feed them.
    pub instances: Vec<InstanceDescription>,
    /// Wires.
    pub connections: Vec<Wire>,
    /// Start values of parameters and inputs.
    pub settings: Vec<Setting>,
    /// Times of a run that says none itself.
    pub experiment: Experiment,
    /// Unpacked files in which models lie.
    pub kept: Kept,
}

/// When a simulation begins and ends by default, and its communication step \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Experiment {
    /// Start time.
    pub start: Option<f64>,
    /// Stop time.
    pub stop: Option<f64>,
    /// Communication step.
    pub step: Option<f64>,
}

/// One instance.
#[derive(Debug, Clone, PartialEq)]
pub struct InstanceDescription {
    /// Its name.
    pub name: String,
    /// Where its model comes from.
    pub source: Spanned<InstanceSource>,
    /// Order, for built-in models that have one.
    pub order: Option<Spanned<u32>>,
    /// Interface to use for an FMU that supports both.
    pub interface: Option<Interface>,
    /// Whether its outputs follow its inputs at once: see [`System::set_at_once`].
    pub at_once: bool,
}

/// Source of an instance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum InstanceSource {
    /// A built-in model, by name. Its name is an [identifier](pilotage_text::is_identifier).
    BuiltIn(String),
    /// A model file.
    Model(PathBuf),
    /// A file with signals over time; its columns are outputs.
    Table(PathBuf),
}

impl InstanceSource {
    /// The file, if any, relative to the working directory.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::BuiltIn(_) => None,
            Self::Model(file) | Self::Table(file) => Some(file),
        }
    }
}

/// FMI interface type used for an FMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interface {
    /// Co-simulation: the FMU contains its solver.
    CoSimulation,
    /// Model exchange: pilotage solves the FMU's equations.
    ModelExchange,
}

impl Interface {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::CoSimulation, Self::ModelExchange];

    /// Its name in files and flags.
    pub fn name(self) -> &'static str {
        match self {
            Self::CoSimulation => "cs",
            Self::ModelExchange => "me",
        }
    }
}

/// A wire from an output to an input, both as `instance.variable`.
#[derive(Debug, Clone, PartialEq)]
pub struct Wire {
    /// The output.
    pub from: Spanned<String>,
    /// The input.
    pub to: Spanned<String>,
    /// What happens to values on the way.
    pub transformation: Transformation,
}

/// A start value.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// `instance.variable`.
    pub name: Spanned<String>,
    /// The value as text, in the variable's unit.
    pub value: String,
}

/// An error in one entry of a description.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{}{error}", place.as_ref().map_or(String::new(), |place| format!("{place}: ")))]
pub struct EntryError {
    /// Place of the entry, if from a file.
    pub place: Option<Place>,
    /// The error.
    pub error: Box<SystemError>,
}

impl SystemDescription {
    /// Adds instances. An instance whose name already exists replaces the existing one and keeps its position.
    ///
    /// # Errors
    /// If two added instances have the same name.
    pub fn override_instances(
        &mut self,
        instances: Vec<InstanceDescription>,
    ) -> Result<(), SystemError> {
        let known = self.instances.len();
        for instance in instances {
            let at = self.instances.iter().position(|i| i.name == instance.name);
            match at {
                Some(at) if at < known => self.instances[at] = instance,
                Some(_) => {
                    let name = instance.name;
                    return Err(SystemError::DuplicateInstance { name });
                }
                None => self.instances.push(instance),
            }
        }
        Ok(())
    }

    /// Adds wires and values. They replace everything given before for the same inputs and parameters.
    pub fn override_wiring(&mut self, connections: Vec<Wire>, settings: Vec<Setting>) {
        let fed = connections.iter().map(|wire| &wire.to.value);
        let set = settings.iter().map(|setting| &setting.name.value);
        let targets: Vec<&String> = fed.chain(set).collect();
        self.connections
            .retain(|wire| !targets.contains(&&wire.to.value));
        self.settings
            .retain(|setting| !targets.contains(&&setting.name.value));
        self.connections.extend(connections);
        self.settings.extend(settings);
    }

    /// Connects instances that have been added, and sets their start values.
    ///
    /// # Errors
    /// For the first invalid entry.
    pub fn wire(&self, system: &mut System) -> Result<(), EntryError> {
        for wire in &self.connections {
            let Wire { from, to, .. } = wire;
            let connected = system.connect_by(&from.value, &to.value, wire.transformation.clone());
            connected.map_err(|error| EntryError {
                place: match is_about_output(&error, &from.value) {
                    true => from.place.clone(),
                    false => to.place.clone(),
                },
                error: Box::new(error),
            })?;
        }
        for own in self.instances.iter().filter(|own| own.at_once) {
            system.set_at_once(&own.name);
        }
        for Setting { name, value } in &self.settings {
            let set = system.set(&name.value, value);
            set.map_err(|error| EntryError {
                place: name.place.clone(),
                error: Box::new(error),
            })?;
        }
        Ok(())
    }

    /// Names and values of the variables set for one instance.
    pub fn settings_of<'a>(
        &'a self,
        instance: &'a str,
    ) -> impl Iterator<Item = (&'a str, &'a str)> {
        self.settings.iter().filter_map(move |setting| {
            let (own, variable) = self.split(&setting.name.value)?;
            (own == instance).then_some((variable, setting.value.as_str()))
        })
    }

    /// The instance and the variable of `instance.variable`. Both may contain dots; the longest instance name wins.
    pub fn split<'a>(&self, name: &'a str) -> Option<(&'a str, &'a str)> {
        let parts = self.instances.iter().filter_map(|own| {
            let rest = name.strip_prefix(own.name.as_str())?.strip_prefix('.')?;
            Some((&name[..own.name.len()], rest))
        });
        parts.max_by_key(|(instance, _)| instance.len())
    }

    /// Place where a variable is first wired or set.
    pub fn place_of(&self, variable: &str) -> Option<&Place> {
        let wires = self.connections.iter();
        let wired = wires.flat_map(|wire| [&wire.from, &wire.to]);
        let set = self.settings.iter().map(|setting| &setting.name);
        let name = wired.chain(set).find(|name| name.value == variable)?;
        name.place.as_ref()
    }
}

/// Whether an error of a wire concerns its output.
fn is_about_output(error: &SystemError, from: &str) -> bool {
    match error {
        SystemError::NotAnOutput { .. } => true,
        SystemError::NoVariable { text, .. }
        | SystemError::UnknownInstance { text, .. }
        | SystemError::UnknownVariable { text, .. } => text == from,
        _ => false,
    }
}
