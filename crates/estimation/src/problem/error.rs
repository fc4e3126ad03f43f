//! Errors in a problem.

use pilotage_cosim::DescriptionError;
use pilotage_language::ModelFileError;
use pilotage_series::SeriesError;
use pilotage_text::document::{DocumentError, Place};
use pilotage_text::error_chain::error_chain;
use pilotage_text::suggestion::{did_you_mean, suggestion};
use std::fs::DirEntry;
use std::path::Path;

/// Why a problem cannot be posed.
#[derive(Debug, thiserror::Error)]
pub enum ProblemError {
    /// Not TOML, or an unknown field, a missing field or a field of the wrong type.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A mistake in an expression, or in a model file.
    #[error(transparent)]
    Expression(#[from] ModelFileError),
    /// A mistake in the description of the system.
    #[error(transparent)]
    System(#[from] DescriptionError),
    /// A run that cannot be read.
    #[error(transparent)]
    Series(#[from] SeriesError),
    /// A mistake at a place in a file.
    #[error("{place}: {fault}")]
    At {
        /// The place.
        place: Place,
        /// What is wrong, and how to correct it.
        fault: String,
    },
    /// A model that cannot be part of a problem, or a mistake without a place.
    #[error("{0}")]
    Part(String),
}

impl ProblemError {
    /// A mistake at a place in a file.
    pub fn at(place: &Place, fault: impl Into<String>) -> Self {
        Self::At {
            place: place.clone(),
            fault: fault.into(),
        }
    }

    /// A file, named at a place, that cannot be read. If it does not exist, the most similar file name is suggested.
    pub fn unread(place: Option<&Place>, file: &Path, error: &dyn std::error::Error) -> Self {
        let folder = file.parent().filter(|_| !file.exists());
        let entries = folder.and_then(|folder| match folder.as_os_str().is_empty() {
            true => std::fs::read_dir(".").ok(),
            false => std::fs::read_dir(folder).ok(),
        });
        let name = |entry: std::io::Result<DirEntry>| entry.ok()?.file_name().into_string().ok();
        let mut names: Vec<String> = entries.into_iter().flatten().filter_map(name).collect();
        names.sort();
        let own = file.file_name().unwrap_or_default().to_string_lossy();
        let near = did_you_mean(suggestion(&own, names.iter().map(String::as_str)));
        Self::maybe_at(place, error_chain(error) + &near)
    }

    /// A mistake at a place, if the place is known.
    pub fn maybe_at(place: Option<&Place>, fault: impl Into<String>) -> Self {
        match place {
            Some(place) => Self::at(place, fault),
            None => Self::Part(fault.into()),
        }
    }
}
