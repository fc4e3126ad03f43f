//! Errors of systems of other tools.

use pilotage_fmi::archive::ArchiveError;
use pilotage_text::document::Place;
use std::io;
use thiserror::Error;

/// Why a file is no system.
#[derive(Debug, Error)]
pub enum SspError {
    /// A file cannot be read.
    #[error("cannot read {file}")]
    Read {
        /// The file.
        file: String,
        /// The system's reason.
        source: io::Error,
    },
    /// An archive that is damaged, too large, or would leave its folder.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// Not XML or JSON, or beyond the limits of a description.
    #[error("{file}{}: {fault}", position.map_or(String::new(), |(line, column)| format!(":{line}:{column}")))]
    Malformed {
        /// The file.
        file: String,
        /// Line and column, if known.
        position: Option<(u32, u32)>,
        /// The parser's reason.
        fault: String,
    },
    /// No variant of that name.
    #[error("{file} has no variant `{name}`; there are {}", known.join(", "))]
    NoVariant {
        /// The archive or folder.
        file: String,
        /// The name.
        name: String,
        /// Names of its variants.
        known: Vec<String>,
    },
    /// An element that says something wrong, or what cannot be done.
    #[error("{place}: <{element}>: {fault}")]
    Element {
        /// Its place.
        place: Place,
        /// Its name.
        element: String,
        /// What is wrong.
        fault: String,
    },
}

/// An element's name and place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct At {
    pub(crate) place: Place,
    pub(crate) element: &'static str,
}

impl At {
    pub(crate) fn fault(&self, fault: impl Into<String>) -> SspError {
        SspError::Element {
            place: self.place.clone(),
            element: self.element.to_owned(),
            fault: fault.into(),
        }
    }
}
