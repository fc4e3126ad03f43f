//! Pilot files, as `fit` writes them.
//!
//! | module | content |
//! | --- | --- |
//! | `file` | the file: the pilot, how sure it is, what the fit said against it |
//! | `uncertainty` | the covariance of θ |

mod file;
mod uncertainty;

pub use file::{PilotDiagnostic, PilotFile};

use crate::vehicle::VehicleError;
use pilotage_language::file::with_starts;
use pilotage_models::{Model, Pilot, library};
use pilotage_text::document::{DocumentError, TomlTable};

/// A mistake in a pilot file.
#[derive(Debug, thiserror::Error)]
pub enum PilotError {
    /// Unknown fields, a missing field, or one of the wrong type.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Of the vehicle of its closed loop.
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
    /// The table `[uncertainty]` is invalid.
    #[error("{file}:{line}: [uncertainty] {fault}")]
    Uncertainty {
        /// The file.
        file: String,
        /// Line of the field.
        line: usize,
        /// The field and its fault.
        fault: String,
    },
    /// The number of parameters is not that of a pilot.
    #[error(
        "{file}:{line}: [theta] has {found} parameters; a pilot of order n has 2n: theta1 to theta2n"
    )]
    Count {
        /// The file.
        file: String,
        /// Line of the table `[theta]`.
        line: usize,
        /// Number of parameters.
        found: usize,
    },
    /// A parameter is not finite.
    #[error("{file}:{line}: {field} = {value}; expected a finite number")]
    NotFinite {
        /// The file.
        file: String,
        /// Line of the value.
        line: usize,
        /// The parameter.
        field: String,
        /// Its value.
        value: f64,
    },
    /// The stick limit is not positive.
    #[error("{file}:{line}: stick_limit = {value}; expected a finite number above 0")]
    StickLimit {
        /// The file.
        file: String,
        /// Line of the value.
        line: usize,
        /// The value.
        value: f64,
    },
    /// The order is higher than that of any model.
    #[error(
        "{file}: a pilot of order {order} cannot run; the highest order is {}",
        Model::MAX_ORDER
    )]
    Order {
        /// The file.
        file: String,
        /// The order.
        order: usize,
    },
}

/// Fields at the file's top level. Those that only document where θ comes from are optional.
const FIELDS: [&str; 12] = [
    "tool",
    "status",
    "converged",
    "stick_limit",
    "theta",
    "uncertainty",
    "pole",
    "closed_loop",
    // The diagnostics; existing pilot files use this name for them.
    "doubt",
    "fit",
    "vehicle",
    "data",
];

/// A linear pilot with numbers for its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedPilot {
    /// θ, in the units of [`pilotage_models::pilot`].
    pub theta: Vec<f64>,
    /// Limit on |y_p|.
    pub stick_limit: f64,
}

impl FittedPilot {
    /// Reads the pilot of a pilot file. If `stick_limit` is missing, as in a file written by hand, it is 1.
    ///
    /// # Errors
    /// If a field is unknown, or θ or the stick limit is not that of a pilot.
    pub fn of_table(root: TomlTable<'_>) -> Result<Self, PilotError> {
        root.only(&FIELDS)?;
        let stick_limit = root.number("stick_limit")?.unwrap_or(1.0);
        if !(stick_limit.is_finite() && stick_limit > 0.0) {
            return Err(PilotError::StickLimit {
                file: root.file().into(),
                line: root.line("stick_limit"),
                value: stick_limit,
            });
        }
        let theta = theta(&root.required("theta", root.table("theta")?)?)?;
        Ok(Self { theta, stick_limit })
    }

    /// Its structure.
    pub fn structure(&self) -> Pilot {
        Pilot {
            order: self.theta.len() / 2,
        }
    }

    /// The pilot as a model that runs; `file` is its name in the message.
    ///
    /// # Errors
    /// If its order is too high.
    pub fn model(&self, file: &str) -> Result<Model, PilotError> {
        self.check_order(file)?;
        Ok(Model::pilot(&self.theta, self.stick_limit))
    }

    /// The text of the built-in model `linear` with these parameters.
    ///
    /// # Errors
    /// If its order is too high.
    pub fn text(&self, file: &str) -> Result<String, PilotError> {
        self.check_order(file)?;
        let theta = self.theta.iter().enumerate();
        let mut values: Vec<(String, f64)> = theta
            .map(|(i, value)| (format!("theta{}", i + 1), *value))
            .collect();
        values.push(("stick_limit".to_owned(), self.stick_limit));
        Ok(with_starts(
            &library::linear(self.structure().order),
            &values,
        ))
    }

    fn check_order(&self, file: &str) -> Result<(), PilotError> {
        let order = self.structure().order;
        match order <= Model::MAX_ORDER {
            true => Ok(()),
            false => Err(PilotError::Order {
                file: file.to_owned(),
                order,
            }),
        }
    }
}

/// Reads θ from its table.
fn theta(table: &TomlTable) -> Result<Vec<f64>, PilotError> {
    let (file, found) = (table.file().to_owned(), table.count());
    if found == 0 || found % 2 == 1 {
        let line = table.line("");
        return Err(PilotError::Count { file, line, found });
    }
    let names: Vec<String> = (1..=found).map(|i| format!("theta{i}")).collect();
    table.only(&names.iter().map(String::as_str).collect::<Vec<_>>())?;
    let value = |name: &String| {
        let value = table.required(name, table.number(name)?)?;
        match value.is_finite() {
            true => Ok(value),
            false => Err(PilotError::NotFinite {
                file: file.clone(),
                line: table.line(name),
                field: name.clone(),
                value,
            }),
        }
    };
    names.iter().map(value).collect()
}
