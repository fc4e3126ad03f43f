//! What can be wrong with a problem.

use pilotage_cosim::DescriptionError;
use pilotage_language::ModelFileError;
use pilotage_series::SeriesError;
use pilotage_text::document::{DocumentError, Place};
use pilotage_text::error_chain::error_chain;
use pilotage_text::suggestion::{did_you_mean, suggestion};
use std::fs::DirEntry;
use std::path::Path;

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

    /// A file that is named at a place and cannot be read: with the nearest name beside it, where it is not there.
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

    /// A mistake at a place, where there is one.
    pub fn maybe_at(place: Option<&Place>, fault: impl Into<String>) -> Self {
        match place {
            Some(place) => Self::at(place, fault),
            None => Self::Part(fault.into()),
        }
    }
}
