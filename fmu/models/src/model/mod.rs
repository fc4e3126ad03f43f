//! A model as it is exported: its kind and its variables with their start values.

mod file;
mod guid;
mod pilot;
mod quadcopter;

pub use file::ModelFileError;
pub(crate) use quadcopter::nominals as quadcopter_nominals;

use crate::{Pilot, Quadcopter, Variable};
use std::ops::Range;

/// What the exported binaries log: category and meaning.
pub const LOG_CATEGORIES: [(&str, &str); 4] = [
    ("logStatusWarning", "Calls that had no effect"),
    (
        "logStatusDiscard",
        "Steps that could not be done, and information that is not available",
    ),
    (
        "logStatusError",
        "Calls that were refused, and what to do about them",
    ),
    ("logStatusFatal", "Faults of the FMU itself"),
];

/// Which equations a model has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The linear pilot of that structure.
    Pilot(Pilot),
    /// The quadcopter's pitch axis.
    Quadcopter,
}

impl Kind {
    /// Its name: a C identifier, used for files and as FMI's `modelIdentifier`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pilot(_) => "pilot",
            Self::Quadcopter => "quadcopter",
        }
    }
}

/// Kind and variables of a model. In the table come inputs first, then outputs, parameters, and last
/// one start value for each state.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    kind: Kind,
    variables: Vec<Variable>,
}

impl Model {
    /// Highest order of a pilot: far beyond what data can tell apart.
    pub const MAX_ORDER: usize = 12;

    /// A pilot at rest with that θ (its length is twice the order) and stick limit.
    ///
    /// # Panics
    /// When θ has an odd number of entries, none, or more than twice [`Model::MAX_ORDER`].
    pub fn pilot(theta: &[f64], stick_limit: f64) -> Self {
        let order = theta.len() / 2;
        assert!(
            theta.len() == 2 * order && (1..=Self::MAX_ORDER).contains(&order),
            "θ of a pilot of order 1 to {} has twice as many entries, not {}",
            Self::MAX_ORDER,
            theta.len()
        );
        Self {
            kind: Kind::Pilot(Pilot { order }),
            variables: pilot::variables(theta, stick_limit),
        }
    }

    /// A quadcopter at hover at the origin.
    pub fn quadcopter(vehicle: &Quadcopter) -> Self {
        Self {
            kind: Kind::Quadcopter,
            variables: quadcopter::variables(vehicle),
        }
    }

    /// Which equations it has.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The variables; a variable's index is its value reference.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Index of the variable of that name.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.variables.iter().position(|v| v.name == name)
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        match self.kind {
            Kind::Pilot(pilot) => pilot.order,
            Kind::Quadcopter => crate::quadcopter::N_STATES,
        }
    }

    /// Indices of the inputs.
    pub fn inputs(&self) -> Range<usize> {
        match self.kind {
            Kind::Pilot(_) => 0..2,
            Kind::Quadcopter => 0..1,
        }
    }

    /// Indices of the outputs.
    pub fn outputs(&self) -> Range<usize> {
        match self.kind {
            Kind::Pilot(_) => 2..4,
            Kind::Quadcopter => 1..1 + crate::quadcopter::N_STATES,
        }
    }

    /// Indices of the parameters proper: θ and the stick limit, or the vehicle's coefficients.
    pub fn coefficients(&self) -> Range<usize> {
        self.outputs().end..self.starts().start
    }

    /// Indices of the states' start values.
    pub fn starts(&self) -> Range<usize> {
        self.variables.len() - self.n_states()..self.variables.len()
    }

    /// Refuses start values that the variables cannot have.
    ///
    /// # Errors
    /// Names the first variable whose start value is not finite or out of range.
    pub fn check(&self) -> Result<(), crate::ValueError> {
        self.variables
            .iter()
            .try_for_each(|v| v.start.map_or(Ok(()), |start| v.check(start)))
    }
}
