//! Outcomes and failures of a command.

use super::terminal::line;
use crate::document::Place;
use crate::error_chain::error_chain;
use std::error::Error;
use std::fmt;
use std::io;
use std::path::Path;

/// Outcome of a command that could run.
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

/// Invalid usage or input (exit code 2), or an FMU that ended by itself before there was a result (exit code 1).
/// Displayed as `error: ...`, followed by `hint: ...` if there is a hint, each on one line, and by [more lines](Self::below).
#[derive(Debug, Clone)]
pub struct Failure {
    message: String,
    hint: Option<String>,
    below: String,
    code: u8,
}

impl Failure {
    /// A failure with a message that says what is wrong, and where.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: line(&message.into()),
            hint: None,
            below: String::new(),
            code: 2,
        }
    }

    /// Marks the failure of an FMU that ran: exit code 1.
    pub fn ran(mut self) -> Self {
        self.code = 1;
        self
    }

    /// The exit code.
    pub fn code(&self) -> u8 {
        self.code
    }

    /// The failure for a file that cannot be written.
    pub fn cannot_write(path: &Path, error: &io::Error) -> Self {
        Self::new(format!("cannot write {}: {error}", path.display()))
    }

    /// The message without the hint.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Prefixes the place in the file, if known.
    pub fn at(mut self, place: Option<&Place>) -> Self {
        if let Some(place) = place {
            self.message = line(&format!("{place}: {}", self.message));
        }
        self
    }

    /// Adds a hint on what to do next.
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(line(&hint.into()));
        self
    }

    /// Adds lines below: a list, or the words of another tool. Names of others are to be on one line in them.
    pub fn below(mut self, lines: &str) -> Self {
        self.below = format!("\n{}", lines.trim_end());
        self
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error: {}", self.message)?;
        if let Some(hint) = &self.hint {
            write!(f, "\nhint: {hint}")?;
        }
        f.write_str(&self.below)
    }
}

impl<E: Error> From<E> for Failure {
    /// Joins the error chain into one message: `what: why: why`.
    fn from(error: E) -> Self {
        Self::new(error_chain(&error))
    }
}
