//! CSV in.

use super::{Column, Series, SeriesError};
use std::path::Path;

impl Series {
    /// Reads a CSV file: see the [module](super) for its form.
    ///
    /// # Errors
    /// When the file cannot be read or is not of that form; the message names file, line and column.
    pub fn read(path: &Path) -> Result<Self, SeriesError> {
        Self::parse(&content(path)?, &path.display().to_string())
    }

    /// Reads a CSV file in which a time may stand in several rows: the signals jump there, from the
    /// first of these rows to the last.
    ///
    /// # Errors
    /// As [`Series::read`], but that a time may repeat.
    pub fn read_with_jumps(path: &Path) -> Result<Self, SeriesError> {
        let after = |time: f64, previous: f64| time >= previous;
        Self::parse_ordered(&content(path)?, &path.display().to_string(), after)
    }

    /// Parses a CSV file's bytes; `file` is its name in messages.
    ///
    /// # Errors
    /// As [`Series::read`].
    pub fn parse(bytes: &[u8], file: &str) -> Result<Self, SeriesError> {
        Self::parse_ordered(bytes, file, |time, previous| time > previous)
    }

    /// Parses rows of which each time has to come `after` that of the row before.
    fn parse_ordered(
        bytes: &[u8],
        file: &str,
        after: fn(f64, f64) -> bool,
    ) -> Result<Self, SeriesError> {
        let text = utf8(bytes, file)?;
        let mut rows = Rows::new(text, file);
        let header = rows.header()?;
        let columns = (header.cells.iter().skip(1))
            .map(|(name, unit)| Column {
                name: name.clone(),
                unit: unit.clone(),
                values: Vec::new(),
            })
            .collect();
        let mut series = Self {
            comments: comments(text),
            time: Vec::new(),
            columns,
        };
        while let Some((line, row)) = rows.next()? {
            series.push_row(&row, line, &header, file, after)?;
        }
        match series.time.is_empty() {
            true => Err(SeriesError::NoSamples { file: file.into() }),
            false => Ok(series),
        }
    }

    /// Appends one row of cells.
    fn push_row(
        &mut self,
        row: &csv::StringRecord,
        line: usize,
        header: &Header,
        file: &str,
        after: fn(f64, f64) -> bool,
    ) -> Result<(), SeriesError> {
        if row.len() != header.cells.len() {
            return Err(SeriesError::Ragged {
                file: file.into(),
                line,
                found: row.len(),
                expected: header.cells.len(),
            });
        }
        let number = |column: usize| match row[column].trim() {
            "" => Ok(f64::NAN),
            cell => match cell.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => Err(SeriesError::Number {
                    file: file.into(),
                    line,
                    column: header.cells[column].0.clone(),
                    found: cell.into(),
                }),
            },
        };
        let time = number(0)? * header.seconds;
        if time.is_nan() {
            let file = file.into();
            return Err(SeriesError::MissingTime { file, line });
        }
        if let Some(&previous) = self.time.last().filter(|&&previous| !after(time, previous)) {
            return Err(SeriesError::TimeOrder {
                file: file.into(),
                line,
                time,
                previous,
            });
        }
        for (i, column) in self.columns.iter_mut().enumerate() {
            column.values.push(number(i + 1)?);
        }
        self.time.push(time);
        Ok(())
    }
}

fn content(path: &Path) -> Result<Vec<u8>, SeriesError> {
    std::fs::read(path).map_err(|source| SeriesError::Read {
        file: path.to_owned(),
        source,
    })
}

/// The file as text, without the byte-order mark that spreadsheets put in front.
fn utf8<'a>(bytes: &'a [u8], file: &str) -> Result<&'a str, SeriesError> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.strip_prefix('\u{feff}').unwrap_or(text)),
        Err(error) => {
            let at = error.valid_up_to();
            Err(SeriesError::NotUtf8 {
                file: file.into(),
                line: 1 + bytes[..at].iter().filter(|&&b| b == b'\n').count(),
                byte: bytes[at],
            })
        }
    }
}

/// The comment lines, without `#` and the space after it.
fn comments(text: &str) -> Vec<String> {
    (text.lines())
        .filter_map(|line| line.strip_prefix('#'))
        .map(|line| line.trim().to_owned())
        .collect()
}

/// The header row: names and units of all columns, and the time's factor to seconds.
struct Header {
    cells: Vec<(String, String)>,
    seconds: f64,
}

/// The rows of the file with their line numbers.
struct Rows<'a> {
    reader: csv::Reader<&'a [u8]>,
    text: &'a str,
    file: &'a str,
}

impl<'a> Rows<'a> {
    fn new(text: &'a str, file: &'a str) -> Self {
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .comment(Some(b'#'))
            .flexible(true)
            .from_reader(text.as_bytes());
        Self { reader, text, file }
    }

    /// The next row and its line; blank lines and comments are passed over.
    fn next(&mut self) -> Result<Option<(usize, csv::StringRecord)>, SeriesError> {
        let mut row = csv::StringRecord::new();
        let more = self.reader.read_record(&mut row);
        let more = more.map_err(|source| SeriesError::Csv {
            file: self.file.into(),
            source,
        })?;
        Ok(more.then(|| (self.line_of(&row), row)))
    }

    /// The line on which a row stands. The reader's own count is of the place where it began to look,
    /// before the comments and blank lines that it then passed over.
    fn line_of(&self, row: &csv::StringRecord) -> usize {
        let start = row.position().map_or(0, |p| p.byte() as usize);
        let before = self.text[..start].matches('\n').count();
        let passed = (self.text[start..].lines())
            .take_while(|line| line.is_empty() || line.starts_with('#'))
            .count();
        1 + before + passed
    }

    fn header(&mut self) -> Result<Header, SeriesError> {
        let file = || self.file.to_owned();
        let Some((line, row)) = self.next()? else {
            return Err(SeriesError::Empty {
                file: self.file.into(),
            });
        };
        let separator = |c: char| row.len() == 1 && row[0].contains(c);
        for (c, separator_name) in [(';', "semicolons"), ('\t', "tabs")] {
            if separator(c) {
                return Err(SeriesError::Separator {
                    file: file(),
                    line,
                    separator: separator_name,
                });
            }
        }
        let mut cells: Vec<(String, String)> = Vec::new();
        for (i, cell) in row.iter().enumerate() {
            let (name, unit) = name_and_unit(cell).ok_or_else(|| SeriesError::Header {
                file: self.file.into(),
                line,
                column: i + 1,
                found: cell.into(),
            })?;
            if let Some(first) = cells.iter().position(|(other, _)| *other == name) {
                return Err(SeriesError::Duplicate {
                    file: self.file.into(),
                    line,
                    first: first + 1,
                    second: i + 1,
                    name,
                });
            }
            cells.push((name, unit));
        }
        let seconds = self.time_factor(line, &cells[0])?;
        Ok(Header { cells, seconds })
    }

    /// Factor from the time column's unit to seconds; no unit means seconds.
    fn time_factor(
        &self,
        line: usize,
        (name, unit): &(String, String),
    ) -> Result<f64, SeriesError> {
        let file = self.file.to_owned();
        match (name.as_str(), unit.as_str()) {
            ("time", "s" | "") => Ok(1.0),
            ("time", "ms") => Ok(1e-3),
            ("time", "min") => Ok(60.0),
            ("time", unit) => Err(SeriesError::TimeUnit {
                file,
                line,
                found: unit.into(),
            }),
            (found, _) => Err(SeriesError::NoTime {
                file,
                line,
                found: found.into(),
            }),
        }
    }
}

/// Splits `name [unit]`; the unit is empty where none is written. None: not a name.
fn name_and_unit(cell: &str) -> Option<(String, String)> {
    let cell = cell.trim();
    let balanced = cell.matches('[').count() == cell.matches(']').count();
    let (name, unit) = match cell
        .strip_suffix(']')
        .and_then(|rest| rest.rsplit_once('['))
    {
        // `q[1]` is an element of an array (FMI 2.0, section 2.2.9), not a `q` in units of 1.
        Some((name, index)) if is_index(index) && !name.ends_with(' ') => (cell, ""),
        Some((name, unit)) => (name.trim(), unit.trim()),
        None => (cell, ""),
    };
    let good = balanced && !name.is_empty() && !name.contains(['\n', '\r']);
    good.then(|| (name.to_owned(), unit.to_owned()))
}

/// Digits and commas: the inside of an array element's brackets.
fn is_index(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit() || b == b',')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_units() {
        let split = |cell| name_and_unit(cell).map(|(name, unit)| name + "|" + &unit);
        assert_eq!(split("position [m]").as_deref(), Some("position|m"));
        assert_eq!(split(" position[m] ").as_deref(), Some("position|m"));
        assert_eq!(split("stick [1]").as_deref(), Some("stick|1"));
        assert_eq!(split("stick").as_deref(), Some("stick|"));
        assert_eq!(split("body.q[1]").as_deref(), Some("body.q[1]|"));
        assert_eq!(
            split("der(body.q[1,2])").as_deref(),
            Some("der(body.q[1,2])|")
        );
        for wrong in ["", " ", "[m]", "position [m", "position m]"] {
            assert_eq!(name_and_unit(wrong), None, "{wrong:?}");
        }
    }

    #[test]
    fn lines_are_counted_through_comments_and_blank_lines() {
        let text = "# one\n\ntime,a\n0,1\n# two\n\n# three\n1,2\n1,3\n";
        let error = Series::parse(text.as_bytes(), "f.csv").unwrap_err();
        assert_eq!(
            error.to_string(),
            "f.csv:9: time 1 s does not come after 1 s, the row before"
        );
        let text = text.replace('\n', "\r\n");
        let error = Series::parse(text.as_bytes(), "f.csv").unwrap_err();
        assert_eq!(
            error.to_string(),
            "f.csv:9: time 1 s does not come after 1 s, the row before"
        );
    }

    #[test]
    fn a_file_of_a_spreadsheet_is_read() {
        let text = "\u{feff}# pilot: A\r\ntime [ms],position [m]\r\n0,\r\n50, 1.5 \r\n";
        let series = Series::parse(text.as_bytes(), "f.csv").unwrap();
        assert_eq!(series.comments, ["pilot: A"]);
        assert_eq!(series.time, [0.0, 0.05]);
        assert!(series.columns[0].values[0].is_nan());
        assert_eq!(series.columns[0].values[1], 1.5);
    }
}
