//! What can be wrong with a problem.

use pilotage_cosim::DescriptionError;
use pilotage_language::ModelFileError;
use pilotage_series::SeriesError;
use pilotage_text::document::{DocumentError, Place};

/// Why there is no problem to solve.
#[derive(Debug, thiserror::Error)]
pub enum ProblemError {
    /// Not TOML, an unknown field, a missing one, or one of another kind.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A mistake in an expression, or in a model file.
    #[error(transparent)]
    Expression(#[from] ModelFileError),
    /// A mistake in what is said of the system.
    #[error(transparent)]
    System(#[from] DescriptionError),
    /// A run that cannot be read.
    #[error(transparent)]
    Series(#[from] SeriesError),
    /// A mistake at a place.
    #[error("{place}: {fault}")]
    At {
        /// Where.
        place: Place,
        /// What is wrong, and what to do.
        fault: String,
    },
    /// A model that cannot be a part of a problem.
    #[error("{0}")]
    Part(String),
}

impl ProblemError {
    /// A mistake at a place.
    pub fn at(place: &Place, fault: impl Into<String>) -> Self {
        Self::At {
            place: place.clone(),
            fault: fault.into(),
        }
    }

    /// A mistake at a place, where there is one.
    pub fn maybe_at(place: Option<&Place>, fault: impl Into<String>) -> Self {
        match place {
            Some(place) => Self::at(place, fault),
            None => Self::Part(fault.into()),
        }
    }
}
