//! What a [`System`] is made of, as a file or a command line says it: instances, wires, start values. Nothing is
//! opened here.
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
//! | module | what it holds |
//! | --- | --- |
//! | `read` | from a system file |
//! | `write` | to a system file |

mod read;
mod write;

pub use read::{DescriptionError, KEYS};
pub use write::{HEADER, SaveError};

use super::system::{System, SystemError};
use pilotage_text::document::Place;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Something that was said, and where; on a command line there is no place.
#[derive(Debug, Clone, PartialEq)]
pub struct Said<T> {
    /// What.
    pub value: T,
    /// Where, if in a file.
    pub place: Option<Place>,
}

impl<T> From<T> for Said<T> {
    /// Said on the command line.
    fn from(value: T) -> Self {
        Self { value, place: None }
    }
}

/// Instances, wires and start values, each in the order in which they were said.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SystemDescription {
    /// What is simulated, and tables that feed it.
    pub instances: Vec<InstanceDescription>,
    /// Wires.
    pub connections: Vec<Wire>,
    /// Start values of parameters and inputs.
    pub settings: Vec<Setting>,
}

/// One instance.
#[derive(Debug, Clone, PartialEq)]
pub struct InstanceDescription {
    /// Its name.
    pub name: String,
    /// What it is made of.
    pub source: Said<InstanceSource>,
    /// Order of a built-in model that has one.
    pub order: Option<Said<u32>>,
    /// What an FMU is used for that can be both.
    pub interface: Option<Interface>,
}

/// What an instance is made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum InstanceSource {
    /// A model that is built in, by its name. What is no [identifier](pilotage_text::is_identifier) names none.
    BuiltIn(String),
    /// The file of a model.
    Model(PathBuf),
    /// A file with signals over time, whose columns are outputs.
    Table(PathBuf),
}

impl InstanceSource {
    /// The file, if it is one; from the folder in which the command runs.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::BuiltIn(_) => None,
            Self::Model(file) | Self::Table(file) => Some(file),
        }
    }
}

/// What an FMU is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interface {
    /// Co-simulation: it brings its own solver.
    CoSimulation,
    /// Model exchange: its equations are solved here.
    ModelExchange,
}

impl Interface {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::CoSimulation, Self::ModelExchange];

    /// As a file or a flag names it.
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
    pub from: Said<String>,
    /// The input.
    pub to: Said<String>,
}

/// A start value.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// `instance.variable`.
    pub name: Said<String>,
    /// The value as text, in the variable's unit.
    pub value: String,
}

/// What is wrong with one entry of a description.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{}{error}", place.as_ref().map_or(String::new(), |place| format!("{place}: ")))]
pub struct EntryError {
    /// Where it stands, if in a file.
    pub place: Option<Place>,
    /// What is wrong.
    pub error: Box<SystemError>,
}

impl SystemDescription {
    /// Adds instances. One of a name that is known keeps its position and takes the place of the one that was there.
    ///
    /// # Errors
    /// If two of those that are added have one name.
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

    /// Adds wires and values. What they say of an input or a parameter takes the place of all that was said of it.
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

    /// Wires instances that have been added, and gives them their start values.
    ///
    /// # Errors
    /// For the first entry that does not fit.
    pub fn wire(&self, system: &mut System) -> Result<(), EntryError> {
        for Wire { from, to } in &self.connections {
            let connected = system.connect(&from.value, &to.value);
            connected.map_err(|error| EntryError {
                place: match is_about_output(&error, &from.value) {
                    true => from.place.clone(),
                    false => to.place.clone(),
                },
                error: Box::new(error),
            })?;
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

    /// Variables and values of one instance.
    pub fn settings_of<'a>(
        &'a self,
        instance: &'a str,
    ) -> impl Iterator<Item = (&'a str, &'a str)> {
        self.settings.iter().filter_map(move |setting| {
            let rest = setting.name.value.strip_prefix(instance)?;
            Some((rest.strip_prefix('.')?, setting.value.as_str()))
        })
    }

    /// Where a variable is first wired or set.
    pub fn place_of(&self, variable: &str) -> Option<&Place> {
        let wires = self.connections.iter();
        let wired = wires.flat_map(|wire| [&wire.from, &wire.to]);
        let set = self.settings.iter().map(|setting| &setting.name);
        let said = wired.chain(set).find(|said| said.value == variable)?;
        said.place.as_ref()
    }
}

/// Whether an error of a wire is about where it begins.
fn is_about_output(error: &SystemError, from: &str) -> bool {
    match error {
        SystemError::NotAnOutput { .. } => true,
        SystemError::NoVariable { text, .. }
        | SystemError::UnknownInstance { text, .. }
        | SystemError::UnknownVariable { text, .. } => text == from,
        _ => false,
    }
}
