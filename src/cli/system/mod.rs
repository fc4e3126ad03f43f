//! Systems: opens and connects the instances given by arguments or a system file.
//!
//! | module | what it does |
//! | --- | --- |
//! | `file` | reads system files |
//! | `flags` | arguments that describe the system |
//! | `isolation` | FMUs in separate processes |
//! | `opened` | a system that is opened once and simulated often |
//! | `resolve` | resolves `model = "..."` |
//! | `tables` | tables that feed inputs |
//! | `parameters` | start values from a file |
//! | `sum` | by what a system is told from others |
//! | `save` | saves systems as files |
//! | `advice` | hints for connections and values that do not fit |

mod advice;
pub mod file;
pub mod flags;
pub mod isolation;
#[cfg(feature = "fly")]
mod one;
pub mod opened;
mod parameters;
pub mod resolve;
mod save;
pub mod sum;
pub mod tables;

use self::isolation::Isolation;
#[cfg(feature = "fly")]
pub use self::one::open_one;
use self::resolve::{Resolved, resolve};
use self::tables::InputTable;
use super::{Failure, recognise};
use crate::cosim::master::Stage;
use crate::cosim::{MasterError, System, SystemDescription};
use std::path::{Path, PathBuf};

/// A connected system, its sources, and the tables that feed it.
#[derive(Default)]
pub struct Built {
    /// The system, ready to run.
    pub system: System,
    /// The tables that feed inputs.
    pub tables: Vec<InputTable>,
    /// The complete description.
    pub description: SystemDescription,
    /// The input files.
    pub files: Vec<PathBuf>,
    /// How files of values were taken where they are not plain.
    pub notes: Vec<String>,
}

/// Opens all instances of a description and connects them.
pub fn open(description: SystemDescription) -> Result<Built, Failure> {
    build(description, &Isolation::default(), |_, _| Ok(()))
}

/// Opens all instances and connects them; `finish` may change connections and values once the instances exist.
fn build(
    mut description: SystemDescription,
    isolation: &Isolation,
    finish: impl FnOnce(&System, &mut SystemDescription) -> Result<(), Failure>,
) -> Result<Built, Failure> {
    isolation.check(&description.instances)?;
    let mut system = System::new();
    let mut files = Vec::new();
    for instance in &description.instances {
        let place = &instance.source.place;
        match resolve(instance, isolation)? {
            Resolved::Model(component) => system
                .add(&instance.name, component)
                .map_err(|error| Failure::from(error).at(place.as_ref()))?,
            Resolved::Table(file) => files.push((instance.name.clone(), file, place.clone())),
        }
    }
    let only = only(&system).map(str::to_owned);
    finish(&system, &mut description)?;
    let wires = &description.connections;
    let tables = (files.into_iter())
        .map(|(name, file, place)| {
            let added = tables::add(&mut system, &name, &file, wires, only.as_deref());
            added.map_err(|failure| failure.at(place.as_ref()))
        })
        .collect::<Result<_, Failure>>()?;
    description.wire(&mut system).map_err(advice::explain)?;
    let files = (description.instances.iter()).filter_map(|i| i.source.value.file());
    Ok(Built {
        files: files.map(Path::to_owned).collect(),
        system,
        tables,
        description,
        notes: Vec::new(),
    })
}

/// The instance of a system that has no other.
pub fn only(system: &System) -> Option<&str> {
    let mut names = system.instance_names();
    names.next().filter(|_| names.next().is_none())
}

/// The name, prefixed with the only instance's if that gives one of its variables.
pub fn full_name(system: &System, name: &str, only: Option<&str>) -> String {
    let full = only.map(|instance| format!("{instance}.{name}"));
    full.filter(|name| system.find(name).is_ok())
        .unwrap_or_else(|| name.to_owned())
}

/// The failure of a run that cannot begin, with the place of the variable concerned.
pub fn explain(error: MasterError, description: &SystemDescription) -> Failure {
    let names = match &error {
        MasterError::AlgebraicLoop { names, .. } | MasterError::Unsettled { names, .. } => {
            names.clone()
        }
        MasterError::Initialization {
            instance,
            stage: Stage::Set(variable) | Stage::Propagate(variable),
            ..
        } => vec![format!("{instance}.{variable}")],
        _ => Vec::new(),
    };
    let place = names.iter().find_map(|name| description.place_of(name));
    let has_run = isolation::is_gone(&error);
    let failure = Failure::from(error).at(place);
    match has_run {
        true => failure.ran(),
        false => failure,
    }
}
