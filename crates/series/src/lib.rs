//! Named time series with units, for trials, results and tables.
//!
//! A series is stored as a CSV file with one header row; names carry their units in brackets:
//!
//! ```text
//! # pilot: A. Example
//! time [s],target [m],position [m]
//! 0,10,0
//! 0.05,10,0.0013
//! 0.1,10,
//! ```
//!
//! Lines that begin with `#` are comments, an empty cell or `NaN` is a missing sample, and the first column is time.
//! Several rows may have the same time: they are replicates, or the signals jump there, from the first of these rows to the last.
//!
//! | module | content |
//! | --- | --- |
//! | `read` | reading of CSV |
//! | `write` | writing of CSV |
//! | `lines` | text, line by line |
//! | [`flown`](mod@flown) | what flight recorders write at the top of a file |
//! | `error` | errors with their location |

mod error;
pub mod flown;
mod lines;
mod read;
mod write;

pub use error::SeriesError;
pub use lines::Lines;
pub use write::{cell, head};

/// One signal of a [`Series`].
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name, unique within the series.
    pub name: String,
    /// Unit as written in the header (`m`, `rad/s`); empty if there is none.
    pub unit: String,
    /// One value for each time; NaN where the sample is missing.
    pub values: Vec<f64>,
}

/// Signals over a common time axis \[s\].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Comment lines of the file, without the leading `#`.
    pub comments: Vec<String>,
    /// Times \[s\], increasing; equal successive ones are replicates, or jumps.
    pub time: Vec<f64>,
    /// Unit of time in the file's header, from which the times were converted; empty if there is none.
    pub time_unit: String,
    /// The signals, each with `time.len()` values.
    pub columns: Vec<Column>,
    /// Columns of words, such as the names of flight modes, which are no signals.
    pub texts: Vec<TextColumn>,
}

/// A column without numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TextColumn {
    /// Its name.
    pub name: String,
    /// Line of its first word.
    pub line: usize,
    /// The word.
    pub found: String,
}

impl TextColumn {
    /// The error of a file in which this column should have numbers.
    pub fn error(&self, file: &str) -> SeriesError {
        SeriesError::Number {
            file: file.to_owned(),
            line: self.line,
            column: self.name.clone(),
            found: self.found.clone(),
        }
    }
}

impl Series {
    /// The column of that name, else the one with that name in another case.
    pub fn column(&self, name: &str) -> Option<&Column> {
        named(&self.columns, name, |own| &own.name)
    }

    /// The same of the columns of words.
    pub fn text(&self, name: &str) -> Option<&TextColumn> {
        named(&self.texts, name, |own| &own.name)
    }
}

/// What has this name, else the only one that has it in another case.
fn named<'c, T>(all: &'c [T], name: &str, of: impl Fn(&T) -> &str) -> Option<&'c T> {
    let exact = all.iter().find(|own| of(own) == name);
    exact.or_else(|| {
        let mut alike = all.iter().filter(|own| of(own).eq_ignore_ascii_case(name));
        alike.next().filter(|_| alike.next().is_none())
    })
}
