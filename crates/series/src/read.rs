//! Reading of CSV files.

use super::lines::Lines;
use super::{Column, Series, SeriesError, TextColumn};
use pilotage_text::file;
use pilotage_units::Unit;
use std::cell::LazyCell;
use std::collections::HashMap;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Name of the first column, case-insensitive.
const TIME: &str = "time";

/// What a file may contain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// Finite or missing samples.
    Recording,
    /// Also results of simulations: infinite numbers.
    Table,
}

impl Series {
    /// Reads a CSV file in the form described in the [module](super).
    ///
    /// # Errors
    /// If the file cannot be read or is not of that form; the message names file, line and column.
    pub fn read(path: &Path) -> Result<Self, SeriesError> {
        Self::read_as(path, Form::Recording, TIME)
    }

    /// Reads a CSV file written by a simulation, in which a sample may be infinite (`inf`, `-inf`).
    ///
    /// # Errors
    /// As [`Series::read`], except for infinite samples.
    pub fn read_table(path: &Path) -> Result<Self, SeriesError> {
        Self::read_as(path, Form::Table, TIME)
    }

    /// As [`Series::read_table`], with another name for the time column.
    ///
    /// # Errors
    /// As [`Series::read_table`].
    pub fn read_table_with_time(path: &Path, time: &str) -> Result<Self, SeriesError> {
        Self::read_as(path, Form::Table, time)
    }

    /// Parses a CSV file's bytes; `file` is the name used in messages.
    ///
    /// # Errors
    /// As [`Series::read`].
    pub fn parse(bytes: &[u8], file: &str) -> Result<Self, SeriesError> {
        Self::parse_as(bytes, file, Form::Recording, TIME)
    }

    /// As [`Series::parse`], with another name for the time column.
    ///
    /// # Errors
    /// As [`Series::read`].
    pub fn parse_with_time(bytes: &[u8], file: &str, time: &str) -> Result<Self, SeriesError> {
        Self::parse_as(bytes, file, Form::Recording, time)
    }

    fn read_as(path: &Path, form: Form, time: &str) -> Result<Self, SeriesError> {
        let opened = file::open(path).map_err(|source| SeriesError::Read {
            file: path.to_owned(),
            source,
        })?;
        let from = BufReader::with_capacity(1 << 16, opened);
        Self::parse_as(from, &path.display().to_string(), form, time)
    }

    /// Parses from a source that can be read only once: a file of any length, or a pipe.
    fn parse_as(
        from: impl BufRead,
        file: &str,
        form: Form,
        time: &str,
    ) -> Result<Self, SeriesError> {
        let mut rows = Rows::new(from, file);
        let header = rows.header(time)?;
        let columns = (header.cells.iter().skip(1))
            .map(|(name, unit)| Column {
                name: name.clone(),
                unit: unit.clone(),
                values: Vec::new(),
            })
            .collect();
        let mut series = Self {
            time_unit: header.cells[0].1.clone(),
            columns,
            ..Self::default()
        };
        let mut texts = vec![None; series.columns.len()];
        while rows.next()? {
            series.push_row(&rows, &header, form, &mut texts)?;
        }
        let mut is_text = texts.iter().map(Option::is_some);
        series.columns.retain(|_| is_text.next() != Some(true));
        series.texts = texts.into_iter().flatten().collect();
        series.comments = std::mem::take(&mut rows.reader.get_mut().comments);
        match series.time.is_empty() {
            true => Err(SeriesError::NoSamples { file: file.into() }),
            false => Ok(series),
        }
    }

    /// Appends the current row of `rows`; `texts` has the first word of each column of words.
    fn push_row<R: BufRead>(
        &mut self,
        rows: &Rows<R>,
        header: &Header,
        form: Form,
        texts: &mut [Option<TextColumn>],
    ) -> Result<(), SeriesError> {
        let (row, file) = (&rows.row, || rows.file.to_owned());
        let line = LazyCell::new(|| rows.line());
        if row.len() != header.cells.len() {
            return Err(SeriesError::Ragged {
                file: file(),
                line: rows.line(),
                found: row.len(),
                expected: header.cells.len(),
            });
        }
        let wrong = |column: usize| TextColumn {
            name: header.cells[column].0.clone(),
            line: *line,
            found: row[column].trim().into(),
        };
        let number = |column: usize, form: Form| match row[column].trim() {
            "" => Ok(f64::NAN),
            cell => match cell.parse::<f64>() {
                Ok(value) if !value.is_infinite() || form == Form::Table => Ok(value),
                _ => Err(wrong(column).error(rows.file)),
            },
        };
        let time = number(0, Form::Recording)? * header.seconds;
        if time.is_nan() {
            let (file, line) = (file(), rows.line());
            return Err(SeriesError::MissingTime { file, line });
        }
        if let Some(&previous) = self.time.last().filter(|&&previous| time < previous) {
            return Err(SeriesError::TimeOrder {
                file: file(),
                line: rows.line(),
                time,
                previous,
            });
        }
        for (i, (column, text)) in self.columns.iter_mut().zip(texts).enumerate() {
            let cell = row[i + 1].trim();
            let is_word = || cell.parse::<f64>().is_err();
            let value = match text {
                Some(_) if cell.is_empty() || is_word() => f64::NAN,
                // Words among numbers are mistakes.
                Some(text) => return Err(text.error(rows.file)),
                None => match number(i + 1, form) {
                    Err(_) if is_word() && column.values.iter().all(|value| value.is_nan()) => {
                        *text = Some(wrong(i + 1));
                        f64::NAN
                    }
                    found => found?,
                },
            };
            column.values.push(value);
        }
        self.time.push(time);
        Ok(())
    }
}

/// The header row: names and units of all columns, and the factor from the time unit to seconds.
struct Header {
    cells: Vec<(String, String)>,
    seconds: f64,
}

/// The rows of the file with their line numbers.
struct Rows<'a, R> {
    reader: csv::Reader<Lines<R>>,
    row: csv::StringRecord,
    file: &'a str,
}

impl<'a, R: BufRead> Rows<'a, R> {
    fn new(from: R, file: &'a str) -> Self {
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .comment(Some(b'#'))
            .flexible(true)
            .from_reader(Lines::new(from));
        let row = csv::StringRecord::new();
        Self { reader, row, file }
    }

    /// Advances to the next row, if any; skips blank lines and comments.
    fn next(&mut self) -> Result<bool, SeriesError> {
        let more = self.reader.read_record(&mut self.row);
        more.map_err(|source| {
            let (file, lines) = (self.file.to_owned(), self.reader.get_ref());
            match lines.wrong {
                Some(byte) => SeriesError::NotUtf8 {
                    file,
                    line: lines.number,
                    byte,
                },
                None if lines.is_endless => SeriesError::Endless {
                    file,
                    line: lines.number,
                },
                None if source.is_io_error() => SeriesError::Read {
                    file: file.into(),
                    source: source.into(),
                },
                None => SeriesError::Csv { file, source },
            }
        })
    }

    /// The line on which the row begins. The reader's own count refers to where it started searching, before the
    /// skipped comments and blank lines.
    fn line(&self) -> usize {
        let within: usize = self.row.iter().map(|cell| cell.matches('\n').count()).sum();
        self.reader.get_ref().number - within
    }

    fn header(&mut self, time: &str) -> Result<Header, SeriesError> {
        let file = || self.file.to_owned();
        if !self.next()? {
            return Err(SeriesError::Empty {
                file: self.file.into(),
            });
        }
        let (line, row) = (self.line(), &self.row);
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
        if row.iter().all(|cell| cell.trim().parse::<f64>().is_ok()) {
            return Err(SeriesError::NoHeader { file: file(), line });
        }
        let (mut cells, mut places) = (Vec::new(), HashMap::new());
        for (i, cell) in row.iter().enumerate() {
            let (name, unit) = name_and_unit(cell).ok_or_else(|| SeriesError::Header {
                file: self.file.into(),
                line,
                column: i + 1,
                found: cell.into(),
            })?;
            if let Some(first) = places.insert(name.clone(), i) {
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
        let seconds = self.time_factor(line, &cells[0], time)?;
        Ok(Header { cells, seconds })
    }

    /// Factor from the time column's unit to seconds; without a unit it is 1.
    fn time_factor(
        &self,
        line: usize,
        (name, unit): &(String, String),
        time: &str,
    ) -> Result<f64, SeriesError> {
        let file = self.file.to_owned();
        if !name.eq_ignore_ascii_case(time) {
            return Err(SeriesError::NoTime {
                file,
                line,
                found: name.clone(),
                expected: time.to_owned(),
            });
        }
        if unit.is_empty() {
            return Ok(1.0);
        }
        let seconds = Unit::named(unit).conversion(&Unit::named("s"));
        (seconds.map(|seconds| seconds.factor)).ok_or_else(|| SeriesError::TimeUnit {
            file,
            line,
            found: unit.clone(),
        })
    }
}

/// Splits `name [unit]` or `name (unit)`; the unit is empty if not given. `None` if there is no valid name.
pub(super) fn name_and_unit(cell: &str) -> Option<(String, String)> {
    let cell = cell.trim();
    let is_balanced = || cell.matches('[').count() == cell.matches(']').count();
    let within = |end: char, begin: &str| cell.strip_suffix(end)?.rsplit_once(begin);
    // `der(x)` is a name.
    let (name, unit) = match within(']', "[").or_else(|| within(')', " (")) {
        // `q[1]` is an array element (FMI 2.0, section 2.2.9), not a `q` with unit 1.
        Some((name, index)) if is_index(index) && !name.ends_with(' ') => (cell, ""),
        Some((name, unit)) => (name.trim(), unit.trim()),
        None => (cell, ""),
    };
    // Brackets in the name may be unbalanced only if a complete unit follows.
    let is_whole = name.len() < cell.len() || is_balanced();
    let good = is_whole && !name.is_empty() && !name.contains(['\n', '\r']);
    good.then(|| (name.to_owned(), unit.to_owned()))
}

/// Whether the text is an array index: digits and commas.
fn is_index(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit() || b == b',')
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

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
        assert_eq!(split("position (m)").as_deref(), Some("position|m"));
        assert_eq!(split("der(z) (m/s)").as_deref(), Some("der(z)|m/s"));
        assert_eq!(split("der(z)").as_deref(), Some("der(z)|"));
        assert_eq!(split("q (1) []").as_deref(), Some("q (1)|"));
        assert_eq!(split("q [1] []").as_deref(), Some("q [1]|"));
        assert_eq!(split("q[ [m]").as_deref(), Some("q[|m"));
        for wrong in ["", " ", "[m]", "position [m", "position m]"] {
            assert_eq!(name_and_unit(wrong), None, "{wrong:?}");
        }
    }

    /// A file of comments alone must not fill the memory.
    #[test]
    fn the_first_comments_are_kept() {
        use crate::lines::COMMENTS;
        let comments: String = (0..COMMENTS + 5).map(|k| format!("# {k}\n")).collect();
        let text = comments + "time [s],x\n0,1\n1,2\n";
        let read = Series::parse(text.as_bytes(), "run.csv").unwrap();
        assert_eq!(read.comments.len(), COMMENTS);
        assert_eq!(read.comments[COMMENTS - 1], (COMMENTS - 1).to_string());
        assert_eq!(read.time, [0.0, 1.0]);
    }

    /// A column of words is none of numbers, whatever is empty in it; one of both has a mistake, on the line of the first word.
    #[test]
    fn columns_of_words_are_kept_apart() {
        let parse = |text: &str| Series::parse(text.as_bytes(), "f.csv");
        let found = parse("time,mode,a\n0,,1\n1,AUTO,2\n2,LAND,\n").unwrap();
        assert_eq!(found.columns.len(), 1);
        assert_eq!(found.column("a").unwrap().values[..2], [1.0, 2.0]);
        let text = found.text("mode").unwrap();
        assert_eq!((text.line, text.found.as_str()), (3, "AUTO"));
        for wrong in [
            "time,mode,a\n0,,1\n1,AUTO,2\n2,3,4\n",
            "time,mode,a\n0,1,1\n1,AUTO,2\n",
        ] {
            let error = parse(wrong).unwrap_err().to_string();
            assert!(
                error.starts_with("f.csv:3: column `mode`: `AUTO`"),
                "{error}"
            );
        }
        let error = parse("time,a\n0,inf\n").unwrap_err().to_string();
        assert!(error.contains("`inf` is not a finite number"), "{error}");
        assert!(parse("time,a\nx,1\n").is_err());
    }

    /// As many columns as a line may have are read in a time that grows with their number, of numbers and of words.
    #[test]
    fn a_table_may_be_wide() {
        const N: usize = 100_000;
        let row = |cell: &dyn Fn(usize) -> String| (0..N).map(cell).collect::<Vec<_>>().join(",");
        let text = format!(
            "time,{}\n0,{}\n1,{}\n",
            row(&|k| format!("c{k}")),
            row(&|k| if k % 2 == 0 {
                "1".into()
            } else {
                "word".into()
            }),
            row(&|k| if k % 2 == 0 {
                k.to_string()
            } else {
                String::new()
            }),
        );
        let found = Series::parse(text.as_bytes(), "f.csv").unwrap();
        assert_eq!((found.columns.len(), found.texts.len()), (N / 2, N / 2));
        assert_eq!(found.columns[N / 2 - 1].values, [1.0, (N - 2) as f64]);
        assert_eq!(found.texts[N / 2 - 1].name, format!("c{}", N - 1));
        let twice = text.replacen(&format!("c{}", N - 1), "c0", 1);
        let error = Series::parse(twice.as_bytes(), "f.csv").unwrap_err();
        assert!(matches!(
            error,
            SeriesError::Duplicate { first: 2, second, .. } if second == N + 1
        ));
    }

    /// Part of an endless device is read.
    #[test]
    fn a_line_without_end_is_given_up() {
        let endless = BufReader::new(std::io::repeat(0));
        let head: &[u8] = b"time,a\n0,1\n";
        let error = Series::parse_as(head.chain(endless), "f.csv", Form::Table, TIME).unwrap_err();
        assert_eq!(
            error.to_string(),
            "f.csv:3: a line longer than 16 MiB; this is no CSV file"
        );
    }

    #[test]
    fn lines_are_counted_through_comments_and_blank_lines() {
        let text = "# one\n\ntime,a\n0,1\n# two\n\n# three\n1,2\n0.5,3\n";
        let error = Series::parse(text.as_bytes(), "f.csv").unwrap_err();
        assert!(
            error.to_string().starts_with("f.csv:9: time 0.5 s "),
            "{error}"
        );
        let text = text.replace('\n', "\r\n");
        let error = Series::parse(text.as_bytes(), "f.csv").unwrap_err();
        assert!(
            error.to_string().starts_with("f.csv:9: time 0.5 s "),
            "{error}"
        );
    }

    /// A source that can be read only once; records the largest read size.
    struct Once<'a> {
        rest: &'a [u8],
        most: &'a mut usize,
    }

    impl Read for Once<'_> {
        fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
            *self.most = (*self.most).max(to.len());
            self.rest.read(to)
        }
    }

    /// Work and memory: each byte is read once, in small portions; an error far down still has its line number.
    #[test]
    fn a_file_is_read_once_in_portions() {
        let rows: String = (0..20_000).map(|k| format!("{k},{}\r\n", 2 * k)).collect();
        let text = format!("# one\r\ntime [ms],a [m]\r\n\r\n{rows}# end\r\n20000,x\r\n1,1\r\n");
        let mut most = 0;
        let once = Once {
            rest: text.as_bytes(),
            most: &mut most,
        };
        let from = BufReader::with_capacity(512, once);
        let error = Series::parse_as(from, "f.csv", Form::Recording, TIME).unwrap_err();
        assert_eq!(
            error.to_string(),
            "f.csv:20005: column `a`: `x` is not a finite number; leave the cell empty where the sample is missing"
        );
        assert_eq!(most, 512);
        let good = text.replace("20000,x\r\n1,1", "20000,40000");
        let series = Series::parse(good.as_bytes(), "f.csv").unwrap();
        assert_eq!(series.comments, ["one", "end"]);
        assert_eq!(series.time.len(), 20_001);
        assert_eq!(series.time[20_000], 20.0);
        assert_eq!(series.columns[0].values[19_999], 39_998.0);
    }

    #[test]
    fn a_row_of_several_lines_is_named_by_its_first() {
        let text = "time,a\n0,1\n1,\"2\n3\"\n";
        let error = Series::parse(text.as_bytes(), "f.csv").unwrap_err();
        assert!(error.to_string().starts_with("f.csv:3: "), "{error}");
    }

    #[test]
    fn times_may_be_repeated_and_tables_hold_what_is_infinite() {
        let text = "time,a\n0,1\n0,inf\n1,-inf\n1,NaN\n";
        let read = |form| Series::parse_as(text.as_bytes(), "f.csv", form, TIME);
        let table = read(Form::Table).unwrap();
        assert_eq!(table.time, [0.0, 0.0, 1.0, 1.0]);
        let a = &table.columns[0].values;
        assert_eq!(a[..3], [1.0, f64::INFINITY, f64::NEG_INFINITY]);
        assert!(a[3].is_nan());
        let error = read(Form::Recording).unwrap_err().to_string();
        assert!(error.starts_with("f.csv:3: column `a`: `inf`"), "{error}");
        let finite = Series::parse(&b"time,a,A,b\n0,nan,1,2\n0,3,4,5\n"[..], "f.csv").unwrap();
        let values = |name: &str| finite.column(name).map(|own| own.values[1]);
        // In another case only where that is the only one.
        assert_eq!(["a", "A", "B"].map(values), [3.0, 4.0, 5.0].map(Some));
        assert!(finite.columns[0].values[0].is_nan() && finite.column("c").is_none());
        let error = Series::parse_as(&b"time,a\n0,1\ninf,1\n"[..], "f.csv", Form::Table, TIME);
        let error = error.unwrap_err().to_string();
        assert!(
            error.starts_with("f.csv:3: column `time`: `inf`"),
            "{error}"
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
