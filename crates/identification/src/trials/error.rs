//! What can be wrong with a trial, with the place where it is wrong.

use pilotage_series::SeriesError;
use pilotage_text::document::DocumentError;
use pilotage_text::suggestion::did_you_mean;
use std::path::PathBuf;

/// Why a file is not a trial, or a list of files not a set of trials.
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
    /// The manifest is not one.
    #[error(transparent)]
    Manifest(#[from] DocumentError),
    /// A column that a trial must have.
    #[error("{file}: no column `{column}`{}; the columns are {}", did_you_mean(suggestion.as_deref()), found.join(", "))]
    NoColumn {
        /// The file.
        file: String,
        /// The column.
        column: String,
        /// The column that is probably meant to be it.
        suggestion: Option<String>,
        /// The columns that are there.
        found: Vec<String>,
    },
    /// A name for a column of something that no trial has.
    #[error("`{found}` is nothing that a trial has{}; known are time, target, position, stick", did_you_mean(suggestion.as_deref()))]
    Quantity {
        /// What stands there.
        found: String,
        /// What is probably meant.
        suggestion: Option<String>,
    },
    /// Two names for the column of one quantity.
    #[error("the column of `{quantity}` is named twice")]
    TwoColumns {
        /// The quantity.
        quantity: &'static str,
    },
    /// A unit that is not convertible to the one in which the project computes.
    #[error("{file}: `{column}` is in `{found}`; expected {expected}")]
    Unit {
        /// The file.
        file: String,
        /// The column.
        column: &'static str,
        /// The unit found.
        found: String,
        /// What is understood.
        expected: &'static str,
    },
    /// A stick beyond its stops.
    #[error("{file}: stick = {value} at {time} s; expected -1 to 1 (or give the column in %)")]
    Stick {
        /// The file.
        file: String,
        /// Time of the sample \[s\].
        time: f64,
        /// The value.
        value: f64,
    },
    /// A target that is not known at every sample.
    #[error("{file}: no target at {time} s; the target must be known at every sample")]
    NoTarget {
        /// The file.
        file: String,
        /// Time of the sample \[s\].
        time: f64,
    },
    /// Fewer recorded positions than a fit can use.
    #[error("{file}: {found} recorded positions; expected at least {expected}")]
    TooFew {
        /// The file.
        file: String,
        /// Samples of the position that are not missing.
        found: usize,
        /// Least number.
        expected: usize,
    },
    /// A weight that is not a positive number.
    #[error("{file}:{line}: weight = {value}; expected a finite number above 0")]
    Weight {
        /// The manifest.
        file: String,
        /// Line of the value.
        line: usize,
        /// The value.
        value: f64,
    },
    /// Neither `fit` nor `validation`.
    #[error("{file}:{line}: use = \"{found}\"; expected \"fit\" or \"validation\"")]
    Use {
        /// The manifest.
        file: String,
        /// Line of the value.
        line: usize,
        /// The value.
        found: String,
    },
    /// A manifest that lists no run.
    #[error("{file}: lists no run; expected tables `[[run]]` with a `file`")]
    NoRuns {
        /// The manifest.
        file: String,
    },
    /// Two trials of one name.
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
