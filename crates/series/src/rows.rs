//! The rows of a CSV file, whatever stands between its cells.

use super::SeriesError;
use super::lines::Lines;
use pilotage_units::Base;
use std::io::{self, BufRead};

/// The rows of a CSV file with their line numbers, without comments and empty rows. Between the cells are commas, semicolons or
/// tabs: which, the first row tells.
pub struct Rows<'f, R> {
    reader: csv::Reader<Lines<R>>,
    row: csv::StringRecord,
    file: &'f str,
    separator: u8,
}

impl<'f, R: BufRead> Rows<'f, R> {
    /// Begins before the first row; `file` is the name in messages.
    ///
    /// # Errors
    /// If the first row cannot be read or is not UTF-8.
    pub fn new(from: R, file: &'f str) -> Result<Self, SeriesError> {
        let mut lines = Lines::new(from);
        let separator = lines.separator();
        let separator = separator.map_err(|source| failed(&lines, file, source))?;
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .comment(Some(b'#'))
            .delimiter(separator)
            .flexible(true)
            .from_reader(lines);
        let row = csv::StringRecord::new();
        Ok(Self {
            reader,
            row,
            file,
            separator,
        })
    }

    /// Advances to the next row with something in it, if any.
    ///
    /// # Errors
    /// If it cannot be read, is not UTF-8, or is too long.
    pub fn advance(&mut self) -> Result<bool, SeriesError> {
        loop {
            let more = self.reader.read_record(&mut self.row);
            let more = more.map_err(|source| match source.is_io_error() {
                true => failed(self.reader.get_ref(), self.file, source.into()),
                false => SeriesError::Csv {
                    file: self.file.to_owned(),
                    source,
                },
            })?;
            // Every line has an end: a last cell with one was not closed before the file ended, if a quote has no second.
            let is_open = (self.row.iter().next_back()).is_some_and(|own| own.ends_with('\n'));
            if is_open && self.reader.get_ref().quotes % 2 == 1 {
                return Err(SeriesError::Unclosed {
                    file: self.file.to_owned(),
                    // The end of the last line is none within the row.
                    line: self.line() + 1,
                    cell: self.count(),
                });
            }
            if !more || self.cells().any(|cell| !cell.is_empty()) {
                return Ok(more);
            }
        }
    }

    /// Number of cells of the row.
    pub fn count(&self) -> usize {
        self.row.len()
    }

    /// A cell of the row without space around it.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn cell(&self, column: usize) -> &str {
        self.row[column].trim()
    }

    /// All of them.
    pub fn cells(&self) -> impl Iterator<Item = &str> {
        self.row.iter().map(str::trim)
    }

    /// The line on which the row begins. The reader's own count refers to where it started searching, before the
    /// skipped comments and blank lines.
    pub fn line(&self) -> usize {
        let within: usize = self.row.iter().map(|cell| cell.matches('\n').count()).sum();
        self.reader.get_ref().number - within
    }

    /// What stands between the cells.
    pub fn separator(&self) -> u8 {
        self.separator
    }

    /// Name of the file in messages.
    pub fn file(&self) -> &'f str {
        self.file
    }

    /// The comments so far, which are given once.
    pub fn comments(&mut self) -> Vec<String> {
        std::mem::take(&mut self.reader.get_mut().comments)
    }

    /// The units in the row if it is a line of them, as below some headers: the first cell is a unit or a form of time
    /// (`hh:mm:ss`), and no other is a number, but 1.
    pub fn units(&self) -> Option<Vec<String>> {
        let bare = |cell: &str| {
            let inner = |begin, end| cell.strip_prefix(begin)?.strip_suffix(end);
            let inner = inner('[', ']').or_else(|| inner('(', ')'));
            inner.unwrap_or(cell).trim().to_owned()
        };
        let units: Vec<String> = self.cells().map(bare).collect();
        let is_number = |unit: &str| unit.parse::<f64>().is_ok();
        let first = units.first().filter(|own| !own.is_empty())?;
        let is_unit = !is_number(first) && (Base::of(first).is_some() || is_form_of_time(first));
        let mut rest = units.iter().skip(1);
        let is_line = is_unit && rest.all(|unit| unit == "1" || !is_number(unit));
        is_line.then_some(units)
    }

    /// The error of a row with another number of cells than the header.
    pub fn ragged(&self, expected: usize) -> SeriesError {
        SeriesError::Ragged {
            file: self.file.to_owned(),
            line: self.line(),
            found: self.count(),
            expected,
            separator: self.separator,
        }
    }

    /// The note for the user on how the file was taken, of its separator and what else was not plain; `None` if all was.
    pub fn note(&self, others: impl IntoIterator<Item = String>) -> Option<String> {
        let separator = match self.separator {
            b';' => Some("semicolons between cells".to_owned()),
            b'\t' => Some("tabs between cells".to_owned()),
            _ => None,
        };
        let all: Vec<String> = separator.into_iter().chain(others).collect();
        (!all.is_empty()).then(|| format!("read with {}", all.join("; ")))
    }
}

fn is_form_of_time(text: &str) -> bool {
    let text = text.to_ascii_lowercase();
    text.contains("h:m") || text.contains("hh:mm")
}

fn failed<R>(lines: &Lines<R>, file: &str, source: io::Error) -> SeriesError {
    let (file, line) = (file.to_owned(), lines.number);
    match lines.wrong {
        Some(byte) => SeriesError::NotUtf8 { file, line, byte },
        None if lines.is_endless => SeriesError::Endless { file, line },
        None => SeriesError::Read {
            file: file.into(),
            source,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quote_that_is_not_closed_is_told_with_its_line() {
        let rows = |text: &str| -> Result<usize, String> {
            let mut rows = Rows::new(text.as_bytes(), "a.csv").map_err(|own| own.to_string())?;
            let mut count = 0;
            while rows.advance().map_err(|own| own.to_string())? {
                count += 1;
            }
            Ok(count)
        };
        assert_eq!(rows("t,x\n0,\"a\nb\"\n1,2\n"), Ok(3));
        assert_eq!(rows("t,x\n0,5\"\n1,\"2\"\n"), Ok(3));
        let told = rows("t,x\n0,1\n1,\"2\n2,3\n").unwrap_err();
        assert!(
            told.starts_with("a.csv:3: the quote with which cell 2 begins"),
            "{told}"
        );
    }
}
