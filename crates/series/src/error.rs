//! Errors in CSV files, with their location.

use super::lines::LONGEST;
use pilotage_text::printable::excerpt;
use std::path::PathBuf;

/// Why a CSV file cannot be read as a [`Series`](super::Series). `file` is the name given by the user; lines count from
/// 1 and include comment lines.
#[derive(Debug, thiserror::Error)]
pub enum SeriesError {
    /// The file cannot be opened or read.
    #[error("cannot read {}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A Parquet file that is none, or no table over time.
    #[error("{file}: {words}")]
    Parquet {
        /// The file.
        file: String,
        /// Why.
        words: String,
    },
    /// A byte that is not UTF-8.
    #[error("{file}:{line}: not UTF-8 text (byte 0x{byte:02x}); save the file as CSV in UTF-8")]
    NotUtf8 {
        /// The file.
        file: String,
        /// Line of the first invalid byte.
        line: usize,
        /// The byte.
        byte: u8,
    },
    /// A line that is too long.
    #[error("{file}:{line}: a line longer than {} MiB; this is no CSV file", LONGEST >> 20)]
    Endless {
        /// The file.
        file: String,
        /// The line.
        line: usize,
    },
    /// Only comments and blank lines.
    #[error("{file}: empty: expected a header row such as `time [s],target [m],position [m]`")]
    Empty {
        /// The file.
        file: String,
    },
    /// A header without rows.
    #[error("{file}: a header but no samples below it")]
    NoSamples {
        /// The file.
        file: String,
    },
    /// A header cell that is not `name` or `name [unit]`.
    #[error(
        "{file}:{line}: column {column} is headed `{}`; expected `name` or `name [unit]`",
        excerpt(found)
    )]
    Header {
        /// The file.
        file: String,
        /// Line of the header.
        line: usize,
        /// Column, counted from 1.
        column: usize,
        /// The cell's text.
        found: String,
    },
    /// No header: the first row holds numbers.
    #[error(
        "{file}:{line}: the first row holds numbers; expected a header such as `time [s],target [m],position [m]`"
    )]
    NoHeader {
        /// The file.
        file: String,
        /// Line of the row.
        line: usize,
    },
    /// Two columns with the same name.
    #[error(
        "{file}:{line}: columns {first} and {second} are both named `{}`",
        excerpt(name)
    )]
    Duplicate {
        /// The file.
        file: String,
        /// Line of the header.
        line: usize,
        /// First column, counted from 1.
        first: usize,
        /// Second column, counted from 1.
        second: usize,
        /// Their name.
        name: String,
    },
    /// The first column is not time.
    #[error(
        "{file}:{line}: the first column is `{}`; expected `{expected} [s]`",
        excerpt(found)
    )]
    NoTime {
        /// The file.
        file: String,
        /// Line of the header.
        line: usize,
        /// Name of the first column.
        found: String,
        /// Expected name of the time column.
        expected: String,
    },
    /// The unit of time is unknown or not a unit of time.
    #[error(
        "{file}:{line}: `time` is in `{}`; expected a unit of time, such as s, ms or min",
        excerpt(found)
    )]
    TimeUnit {
        /// The file.
        file: String,
        /// Line of the header.
        line: usize,
        /// The unit found.
        found: String,
    },
    /// A quote is open where the file ends.
    #[error(
        "{file}:{line}: the quote with which cell {cell} begins is not closed before the file ends; close it, or double a \
         quote that belongs to the text"
    )]
    Unclosed {
        /// The file.
        file: String,
        /// Line on which the row begins.
        line: usize,
        /// Number of the cell, from 1.
        cell: usize,
    },
    /// The number of cells of a row differs from the header.
    #[error(
        "{file}:{line}: {found} cells; expected {expected}, as in the header{}",
        match separator {
            b';' => ", which has semicolons between cells",
            b'\t' => ", which has tabs between cells",
            _ if found > expected => ": commas stand between cells, and decimals have a point",
            _ => "",
        }
    )]
    Ragged {
        /// The file.
        file: String,
        /// Line of the row.
        line: usize,
        /// Cells in the row.
        found: usize,
        /// Cells in the header.
        expected: usize,
        /// What stands between cells.
        separator: u8,
    },
    /// A cell that is not a finite number.
    #[error(
        "{file}:{line}: column `{}`: `{}` is not a finite number; {}", excerpt(column), excerpt(found),
        if found.contains(',') { "decimals have a point" } else { "leave the cell empty where the sample is missing" }
    )]
    Number {
        /// The file.
        file: String,
        /// Line of the row.
        line: usize,
        /// Name of the column.
        column: String,
        /// The cell's text.
        found: String,
    },
    /// A cell that can be read in two ways, or not as those of other rows.
    #[error(
        "{file}:{line}: column `{}`: `{}` {reason}",
        excerpt(column),
        excerpt(found)
    )]
    Unclear {
        /// The file.
        file: String,
        /// Line of the row.
        line: usize,
        /// Name of the column.
        column: String,
        /// The cell's text.
        found: String,
        /// What is unclear, and what to do.
        reason: String,
    },
    /// A row without a time.
    #[error("{file}:{line}: no time; only signals may have missing samples")]
    MissingTime {
        /// The file.
        file: String,
        /// Line of the row.
        line: usize,
    },
    /// Time decreases.
    #[error("{file}:{line}: time {time} s does not come after {previous} s, the row before")]
    TimeOrder {
        /// The file.
        file: String,
        /// Line of the row.
        line: usize,
        /// Time of the row \[s\].
        time: f64,
        /// Time of the previous row \[s\].
        previous: f64,
    },
    /// Text that is not CSV, such as an unterminated quote.
    #[error("{file}: not CSV")]
    Csv {
        /// The file.
        file: String,
        /// The parser's reason.
        source: csv::Error,
    },
}
