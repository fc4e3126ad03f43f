//! Named time series with units: what trials, results and tables are made of.
//!
//! On disk a series is a CSV file with one header row; a name carries its unit in brackets:
//!
//! ```text
//! # pilot: A. Example
//! time [s],target [m],position [m]
//! 0,10,0
//! 0.05,10,0.0013
//! 0.1,10,
//! ```
//!
//! Lines that begin with `#` are comments, an empty cell is a missing sample (NaN), and the time column
//! comes first.

mod error;
pub mod flown;
mod lines;
mod read;
mod write;

pub use error::SeriesError;
pub use lines::Lines;
pub use write::head;

/// One signal of a [`Series`].
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name, unique within the series.
    pub name: String,
    /// Unit as written in the header (`m`, `rad/s`); empty for none.
    pub unit: String,
    /// One value for each time; NaN where the sample is missing.
    pub values: Vec<f64>,
}

/// Signals over a common time axis \[s\].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Comment lines of the file, without the leading `#`.
    pub comments: Vec<String>,
    /// Times \[s\], strictly increasing; equal ones may follow each other after
    /// [`Series::read_table`].
    pub time: Vec<f64>,
    /// Unit of the times in the file's header, from which they were converted; empty where it names none.
    pub time_unit: String,
    /// The signals, each of `time.len()` values.
    pub columns: Vec<Column>,
}

impl Series {
    /// The column of that name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|c| c.name == name)
    }
}
