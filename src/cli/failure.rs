//! How a command ends.

use crate::document::Place;
use crate::error_chain::error_chain;
use std::error::Error;
use std::fmt;
use std::io;
use std::path::Path;

/// How a command that could run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Exit code 0.
    Done,
    /// It ran, but the answer is no (not converged, invalid): exit code 1.
    No,
}

impl Outcome {
    /// The exit code.
    pub fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::No => 1,
        }
    }
}

/// Bad use or bad input, exit code 2; or an FMU ended by itself before there was any result, exit code 1. Shown as `error: ...` and, where there is one, `hint: ...`.
#[derive(Debug, Clone)]
pub struct Failure {
    message: String,
    hint: Option<String>,
    code: u8,
}

impl Failure {
    /// What is wrong, and where.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            hint: None,
            code: 2,
        }
    }

    /// Of an FMU that ran: exit code 1.
    pub fn ran(mut self) -> Self {
        self.code = 1;
        self
    }

    /// The exit code.
    pub fn code(&self) -> u8 {
        self.code
    }

    /// A file that cannot be written.
    pub fn cannot_write(path: &Path, error: &io::Error) -> Self {
        Self::new(format!("cannot write {}: {error}", path.display()))
    }

    /// What is wrong, without the hint.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Says where it is, if that is in a file.
    pub fn at(mut self, place: Option<&Place>) -> Self {
        if let Some(place) = place {
            self.message = format!("{place}: {}", self.message);
        }
        self
    }

    /// Adds what to do next.
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error: {}", self.message)?;
        match &self.hint {
            Some(hint) => write!(f, "\nhint: {hint}"),
            None => Ok(()),
        }
    }
}

impl<E: Error> From<E> for Failure {
    /// Joins the chain of sources into one message: `what: why: why`.
    fn from(error: E) -> Self {
        Self::new(error_chain(&error))
    }
}
