//! What a TOML file is, by its fields, and which of them stand for models. The one place that knows all kinds.

use crate::pilot::{FittedPilot, PilotError};
use crate::vehicle::{self, VehicleError};
use pilotage_cosim::description::{InstanceDescription, KEYS};
use pilotage_estimation::part::{self, Part};
use pilotage_estimation::{OWN_KEYS, ProblemError};
use pilotage_language::file::with_starts;
use pilotage_models::{COEFFICIENTS, Model, Quadcopter, library};
use pilotage_text::document::{self, Document, DocumentError, TomlTable};
use std::path::Path;

/// Kind of a TOML file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A result of a fit of flights.
    Pilot,
    /// The coefficients of a vehicle.
    Vehicle,
    /// A model file: equations.
    Model,
    /// A system file: instances and connections.
    System,
    /// A problem file: measurements and parameters to estimate.
    Problem,
    /// A list of trials.
    Manifest,
}

impl Kind {
    /// The kind of a file with this root; `None` if it is not recognised.
    pub fn of(root: TomlTable<'_>) -> Option<Self> {
        let names = root.names();
        let has = |keys: &[&str]| keys.iter().any(|key| names.contains(key));
        match () {
            () if has(&["theta"]) => Some(Self::Pilot),
            () if root.is_table("model") => Some(Self::Model),
            () if has(&OWN_KEYS) => Some(Self::Problem),
            () if has(&KEYS) => Some(Self::System),
            () if has(&["run"]) => Some(Self::Manifest),
            () if coefficients(root) >= 3 => Some(Self::Vehicle),
            () => None,
        }
    }
}

/// Number of a table's fields that are coefficients of a vehicle.
fn coefficients(root: TomlTable<'_>) -> usize {
    let is_one = |name: &&str| COEFFICIENTS.iter().any(|field| field.name == *name);
    root.names().iter().filter(|name| is_one(name)).count()
}

/// A file with numbers for the parameters of a built-in model.
#[derive(Debug, Clone, PartialEq)]
pub enum Numbers {
    /// A pilot file: the linear pilot.
    Pilot(FittedPilot),
    /// A vehicle file: the quadcopter.
    Vehicle(Quadcopter),
}

/// A mistake in such a file.
#[derive(Debug, thiserror::Error)]
pub enum NumbersError {
    /// Not readable, or not TOML.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Of a pilot file.
    #[error(transparent)]
    Pilot(#[from] PilotError),
    /// Of a vehicle file.
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
}

impl Numbers {
    /// Reads a pilot or vehicle file; `None` if the file is of another kind.
    ///
    /// # Errors
    /// If it cannot be read or contains a mistake.
    pub fn read(path: &Path) -> Result<Option<Self>, NumbersError> {
        let (text, name) = (document::read(path)?, path.display().to_string());
        let document = Document::parse(&text, &name)?;
        let root = document.root();
        match Kind::of(root) {
            Some(Kind::Pilot) => Ok(Some(Self::Pilot(FittedPilot::of_table(root)?))),
            // One coefficient is enough for a message that names what is missing.
            None | Some(Kind::Vehicle) if coefficients(root) > 0 => {
                Ok(Some(Self::Vehicle(vehicle::of_table(&root)?)))
            }
            _ => Ok(None),
        }
    }

    /// The model that runs; `file` is its name in the message.
    ///
    /// # Errors
    /// If a pilot's order is too high.
    pub fn model(&self, file: &str) -> Result<Model, NumbersError> {
        match self {
            Self::Pilot(pilot) => Ok(pilot.model(file)?),
            Self::Vehicle(vehicle) => Ok(Model::quadcopter(vehicle)),
        }
    }

    /// The same as the text of a model file: the built-in `linear` or `quadcopter` with these start values.
    ///
    /// # Errors
    /// As [`Self::model`].
    pub fn text(&self, file: &str) -> Result<String, NumbersError> {
        match self {
            Self::Pilot(pilot) => Ok(pilot.text(file)?),
            Self::Vehicle(vehicle) => {
                let all = COEFFICIENTS.iter();
                let values = all.map(|own| (own.name.to_owned(), (own.get)(vehicle)));
                let built_in = library::find("quadcopter").expect("a built-in model");
                Ok(with_starts(built_in.text, &values.collect::<Vec<_>>()))
            }
        }
    }
}

/// Opens an instance of a problem: a built-in model, a model, pilot or vehicle file, or an FMU.
///
/// # Foreign code
/// Of an FMU: [`Part::of_fmu`].
///
/// # Errors
/// When it does not exist or contains a mistake.
pub fn open(instance: &InstanceDescription) -> Result<Part, ProblemError> {
    part::open_with(instance, &|file: &Path| {
        // What cannot be read, or is no TOML, is reported as a model file.
        let numbers = match Numbers::read(file) {
            Err(NumbersError::Document(_)) => None,
            numbers => numbers.map_err(mistake)?,
        };
        let text = |own: Numbers| own.text(&file.display().to_string()).map_err(mistake);
        numbers.map(text).transpose()
    })
}

fn mistake(error: NumbersError) -> ProblemError {
    ProblemError::Part(error.to_string())
}
