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
//! Lines that begin with `#` are comments, an empty cell is a missing sample (NaN), and the first column is time.
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
    /// Times \[s\], strictly increasing; only [`Series::read_table`] allows equal successive times.
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
    /// The column of that name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|c| c.name == name)
    }

    /// The column of that name if it has words.
    pub fn text(&self, name: &str) -> Option<&TextColumn> {
        self.texts.iter().find(|own| own.name == name)
    }
}
