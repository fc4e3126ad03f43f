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
//! What other programs and people write is read as meant: semicolons or tabs between cells, decimal commas, words such as `NA`
//! for a missing sample, units on the line below the header, times of the clock and time stamps, which become seconds since the
//! first row. [`Series::note`] says so; what has two meanings, such as `1,234`, is refused.
//! Several rows may have the same time: they are replicates, or the signals jump there, from the first of these rows to the last.
//!
//! | module | content |
//! | --- | --- |
//! | `read` | reading of CSV over time |
//! | `rows` | the rows of any CSV file |
//! | `numbers` | numbers as people write them |
//! | `stamp` | time stamps |
//! | `write` | writing of CSV |
//! | `parquet` | Parquet in and out (feature `parquet`) |
//! | `lines` | text, line by line |
//! | [`flown`](mod@flown) | what flight recorders write at the top of a file |
//! | `error` | errors with their location |

mod error;
pub mod flown;
mod lines;
mod numbers;
#[cfg(feature = "parquet")]
pub mod parquet;
mod read;
mod rows;
mod stamp;
mod write;

pub use error::SeriesError;
pub use numbers::{Cell, Numbers};
pub use rows::Rows;
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
    /// How the file was taken, for the user: `read with semicolons between cells; decimal commas`. `None` if it was of the
    /// plain form, or is no file.
    pub note: Option<String>,
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
    /// Why it is no number, if it looks like one.
    pub unclear: Option<String>,
}

impl TextColumn {
    /// The error of a file in which this column should have numbers.
    pub fn error(&self, file: &str) -> SeriesError {
        let (file, line) = (file.to_owned(), self.line);
        let (column, found) = (self.name.clone(), self.found.clone());
        match self.unclear.clone() {
            Some(reason) => SeriesError::Unclear {
                file,
                line,
                column,
                found,
                reason,
            },
            None => SeriesError::Number {
                file,
                line,
                column,
                found,
            },
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
