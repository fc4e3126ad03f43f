//! Errors of trials, with their location.

use pilotage_series::SeriesError;
use pilotage_text::document::DocumentError;
use pilotage_text::suggestion::did_you_mean;
use std::path::PathBuf;

/// The columns of a file, in words.
fn columns(found: &[String]) -> String {
    match found.is_empty() {
        true => "it has no column beside its times".to_owned(),
        false => format!("the columns are {}", found.join(", ")),
    }
}

/// Why a file is not a trial, or a list of files is not a set of trials.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The file cannot be opened or read.
    #[error("cannot read {}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file that a manifest lists cannot be read.
    #[error("{manifest}:{line}: `file` names {}, which cannot be read", file.display())]
    Listed {
        /// The manifest.
        manifest: String,
        /// Line of the name.
        line: usize,
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is not a time series.
    #[error(transparent)]
    Series(#[from] SeriesError),
    /// The manifest is invalid.
    #[error(transparent)]
    Manifest(#[from] DocumentError),
    /// A required column is missing.
    #[error("{file}: no column `{column}`{}; {}", did_you_mean(suggestion.as_deref()), columns(found))]
    NoColumn {
        /// The file.
        file: String,
        /// The missing column.
        column: String,
        /// Suggestion: a column with a similar name.
        suggestion: Option<String>,
        /// The existing columns.
        found: Vec<String>,
    },
    /// A column name is given for an unknown quantity.
    #[error("`{found}` is nothing that a trial has{}; known are time, target, position, stick", did_you_mean(suggestion.as_deref()))]
    Quantity {
        /// The quantity found.
        found: String,
        /// Suggestion: a quantity with a similar name.
        suggestion: Option<String>,
    },
    /// Two names are given for the column of one quantity.
    #[error("the column of `{quantity}` is named twice")]
    TwoColumns {
        /// The quantity.
        quantity: &'static str,
    },
    /// A unit cannot be converted to the required one.
    #[error("{file}: `{column}` is in `{found}`; expected {expected}")]
    Unit {
        /// The file.
        file: String,
        /// The column.
        column: &'static str,
        /// The unit found.
        found: String,
        /// Allowed units.
        expected: &'static str,
    },
    /// The stick is beyond its stops.
    #[error("{file}: stick = {value} at {time} s; expected -1 to 1 (or give the column in %)")]
    Stick {
        /// The file.
        file: String,
        /// Time of the sample \[s\].
        time: f64,
        /// The value.
        value: f64,
    },
    /// The times are implausibly far apart.
    #[error(
        "{file}: the run lasts {duration:e} s; expected at most {limit:e} s: give the times their unit, as in `time [ms]` or \
         `time [us]`"
    )]
    Long {
        /// The file.
        file: String,
        /// Its duration \[s\].
        duration: f64,
        /// The limit \[s\].
        limit: f64,
    },
    /// A position or target is implausibly large.
    #[error(
        "{file}: {column} = {value:e} m at {time} s; expected less than {limit:e} m in magnitude: empty the cell if it is an \
         error, or give the column its unit, as in `position [mm]`"
    )]
    Far {
        /// The file.
        file: String,
        /// `position` or `target`.
        column: &'static str,
        /// Time of the sample \[s\].
        time: f64,
        /// The value \[m\].
        value: f64,
        /// The limit \[m\].
        limit: f64,
    },
    /// The target is missing for long.
    #[error(
        "{file}: no target from {from} to {to} s, and it is needed all the time; fill it, end the run before or begin it after"
    )]
    NoTarget {
        /// The file.
        file: String,
        /// Time of the last sample before \[s\], or of the first row.
        from: f64,
        /// Time of the next one \[s\], or of the last row.
        to: f64,
    },
    /// There are fewer recorded positions than a fit requires.
    #[error("{file}: recorded positions at {found} different times; expected at least {expected}")]
    TooFew {
        /// The file.
        file: String,
        /// Number of recorded positions.
        found: usize,
        /// Minimum number.
        expected: usize,
    },
    /// The weight is not a positive number.
    #[error("{file}:{line}: weight = {value}; expected a finite number above 0")]
    Weight {
        /// The manifest.
        file: String,
        /// Line of the value.
        line: usize,
        /// The value.
        value: f64,
    },
    /// `use` is neither `fit` nor `validation`.
    #[error("{file}:{line}: use = \"{found}\"; expected \"fit\" or \"validation\"")]
    Use {
        /// The manifest.
        file: String,
        /// Line of the value.
        line: usize,
        /// The value.
        found: String,
    },
    /// The manifest lists no run.
    #[error("{file}: lists no run; expected tables `[[run]]` with a `file`")]
    NoRuns {
        /// The manifest.
        file: String,
    },
    /// Two trials have the same name.
    #[error("two trials are named `{name}`: {first} and {second}; a trial is named after its file")]
    Duplicate {
        /// Their name.
        name: String,
        /// File of the first.
        first: String,
        /// File of the second.
        second: String,
    },
}
