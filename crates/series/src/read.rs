//! Reading of CSV files.

use super::numbers::{Cell, Numbers};
#[cfg(feature = "parquet")]
use super::parquet;
use super::rows::Rows;
use super::stamp::{Stamp, Stamps};
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
        #[cfg_attr(not(feature = "parquet"), expect(unused_mut))] mut from: impl BufRead,
        file: &str,
        form: Form,
        time: &str,
    ) -> Result<Self, SeriesError> {
        #[cfg(feature = "parquet")]
        if from
            .fill_buf()
            .is_ok_and(|own| own.starts_with(parquet::MAGIC))
        {
            return parquet::read(from, file, form == Form::Table, time);
        }
        let mut rows = Rows::new(from, file)?;
        let mut header = Header::read(&mut rows, time)?;
        let mut more = rows.advance()?;
        let mut taken = Vec::new();
        if more && let Some(units) = rows.units() {
            header.add_units(units, &rows)?;
            taken.push("units from the line below the header".to_owned());
            more = rows.advance()?;
        }
        if !more {
            return Err(SeriesError::NoSamples { file: file.into() });
        }
        let columns = (header.cells.iter().skip(1))
            .map(|(name, unit)| Column {
                name: name.clone(),
                unit: unit.clone(),
                values: Vec::new(),
            })
            .collect();
        let mut cells = Cells {
            texts: vec![None; header.cells.len() - 1],
            form,
            numbers: Numbers::new(rows.separator()),
            times: match Stamp::parse(rows.cell(0)) {
                Some(first) => Times::Stamps(Stamps::new(first)),
                None => Times::Numbers(header.time_factor(file)?),
            },
            header,
        };
        let mut series = Self {
            columns,
            ..Self::default()
        };
        while more {
            series.push_row(&rows, &mut cells)?;
            more = rows.advance()?;
        }
        let mut is_text = cells.texts.iter().map(Option::is_some);
        series.columns.retain(|_| is_text.next() != Some(true));
        series.texts = cells.texts.into_iter().flatten().collect();
        series.comments = rows.comments();
        taken.extend(cells.numbers.taken(file)?);
        series.time_unit = match cells.times {
            Times::Numbers(_) => cells.header.cells.swap_remove(0).1,
            Times::Stamps(stamps) => {
                taken.push(stamps.taken());
                "s".to_owned()
            }
        };
        series.note = rows.note(taken);
        Ok(series)
    }

    /// Appends the current row of `rows`.
    fn push_row<R: BufRead>(
        &mut self,
        rows: &Rows<R>,
        cells: &mut Cells,
    ) -> Result<(), SeriesError> {
        let header = &cells.header;
        header.check_count(rows)?;
        let file = || rows.file().to_owned();
        // Once for all columns of words, of which there may be many.
        let line = LazyCell::new(|| rows.line());
        let wrong = |column: usize, unclear: Option<String>| TextColumn {
            name: header.cells[column].0.clone(),
            line: *line,
            found: rows.cell(column).into(),
            unclear,
        };
        let error = |column, unclear| wrong(column, unclear).error(rows.file());
        let place = |column: usize| (*line, header.cells[column].0.clone());
        let time = match &mut cells.times {
            Times::Numbers(factor) => match cells.numbers.read(rows.cell(0), || place(0)) {
                Cell::Number(value) if value.is_infinite() => return Err(error(0, None)),
                Cell::Number(value) => value * *factor,
                Cell::Word => return Err(error(0, Some(NO_TIME.to_owned()))),
                Cell::Unclear(why) => return Err(error(0, Some(why))),
            },
            Times::Stamps(_) if rows.cell(0).is_empty() => f64::NAN,
            Times::Stamps(stamps) => {
                (stamps.seconds(rows.cell(0))).ok_or_else(|| error(0, Some(NO_STAMP.to_owned())))?
            }
        };
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
        for (i, (column, text)) in self.columns.iter_mut().zip(&mut cells.texts).enumerate() {
            let i = i + 1;
            let read = cells.numbers.read(rows.cell(i), || place(i));
            let unclear = match read {
                Cell::Number(value) => {
                    match text {
                        // Words among numbers are mistakes.
                        Some(text) if !value.is_nan() => return Err(text.error(rows.file())),
                        _ if value.is_infinite() && cells.form == Form::Recording => {
                            return Err(error(i, None));
                        }
                        _ => column.values.push(value),
                    }
                    continue;
                }
                Cell::Word => None,
                Cell::Unclear(why) => Some(why),
            };
            match text {
                Some(_) => {}
                None if column.values.iter().all(|value| value.is_nan()) => {
                    *text = Some(wrong(i, unclear));
                }
                None => return Err(error(i, unclear)),
            }
            column.values.push(f64::NAN);
        }
        self.time.push(time);
        Ok(())
    }
}

const NO_TIME: &str =
    "is neither a number nor a time; times are numbers, 12:00:00.5 or 2024-03-01T12:00:00.5Z";

const NO_STAMP: &str =
    "is no time of the form of the first row's; all are 12:00:00.5 or 2024-03-01T12:00:00.5Z";

/// How cells become samples, and what is known of the columns.
struct Cells {
    header: Header,
    /// The first word of each column of words.
    texts: Vec<Option<TextColumn>>,
    form: Form,
    numbers: Numbers,
    times: Times,
}

/// What the cells of the time column are.
enum Times {
    /// Numbers, with the factor from their unit to seconds.
    Numbers(f64),
    Stamps(Stamps),
}

/// The header row: names and units of all columns.
struct Header {
    cells: Vec<(String, String)>,
    line: usize,
    /// Whether lines end with a separator.
    is_trailing: bool,
}

impl Header {
    fn read<R: BufRead>(rows: &mut Rows<R>, time: &str) -> Result<Self, SeriesError> {
        if !rows.advance()? {
            return Err(SeriesError::Empty {
                file: rows.file().into(),
            });
        }
        let (line, rows, file) = (rows.line(), &*rows, || rows.file().to_owned());
        let first = rows.cell(0);
        if first.parse::<f64>().is_ok() || Stamp::parse(first).is_some() {
            return Err(SeriesError::NoHeader { file: file(), line });
        }
        let is_trailing = rows.count() > 1 && rows.cell(rows.count() - 1).is_empty();
        let (mut cells, mut places) = (Vec::new(), HashMap::new());
        let named = rows.count() - usize::from(is_trailing);
        for (i, cell) in rows.cells().take(named).enumerate() {
            let (name, unit) = name_and_unit(cell).ok_or_else(|| SeriesError::Header {
                file: file(),
                line,
                column: i + 1,
                found: cell.into(),
            })?;
            if let Some(first) = places.insert(name.clone(), i) {
                return Err(SeriesError::Duplicate {
                    file: file(),
                    line,
                    first: first + 1,
                    second: i + 1,
                    name,
                });
            }
            cells.push((name, unit));
        }
        if !cells[0].0.eq_ignore_ascii_case(time) {
            return Err(SeriesError::NoTime {
                file: file(),
                line,
                found: cells[0].0.clone(),
                expected: time.to_owned(),
            });
        }
        Ok(Self {
            cells,
            line,
            is_trailing,
        })
    }

    /// Checks that the row has as many cells.
    fn check_count<R: BufRead>(&self, rows: &Rows<R>) -> Result<(), SeriesError> {
        let (found, expected) = (rows.count(), self.cells.len());
        let is_more =
            || self.is_trailing && found == expected + 1 && rows.cell(expected).is_empty();
        match found == expected || is_more() {
            true => Ok(()),
            false => Err(rows.ragged(expected)),
        }
    }

    /// Takes the units of the line below.
    fn add_units<R: BufRead>(
        &mut self,
        units: Vec<String>,
        rows: &Rows<R>,
    ) -> Result<(), SeriesError> {
        self.check_count(rows)?;
        for ((name, own), unit) in self.cells.iter_mut().zip(units) {
            if !own.is_empty() && !unit.is_empty() && *own != unit {
                return Err(SeriesError::Unclear {
                    file: rows.file().to_owned(),
                    line: rows.line(),
                    column: name.clone(),
                    found: unit,
                    reason: format!(
                        "is a unit, and that of the header is `{own}`; leave one of them out"
                    ),
                });
            }
            if own.is_empty() {
                *own = unit;
            }
        }
        Ok(())
    }

    /// Factor from the time column's unit to seconds; without a unit it is 1.
    fn time_factor(&self, file: &str) -> Result<f64, SeriesError> {
        let unit = &self.cells[0].1;
        if unit.is_empty() {
            return Ok(1.0);
        }
        let seconds = Unit::named(unit).conversion(&Unit::named("s"));
        (seconds.map(|seconds| seconds.factor)).ok_or_else(|| SeriesError::TimeUnit {
            file: file.to_owned(),
            line: self.line,
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
    use proptest::prelude::*;
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

    /// The same numbers, as many programs write them.
    #[test]
    fn each_dialect_says_the_same() {
        let plain = "time [s],x [m],mode\n0,1234.5,A\n0.05,,\n0.1,-0.25,B\n";
        let plain = Series::parse(plain.as_bytes(), "f.csv").unwrap();
        assert_eq!(plain.note, None);
        let bits = |series: &Series| -> Vec<u64> {
            let all = series.time.iter().chain(&series.columns[0].values);
            all.map(|value| value.to_bits()).collect()
        };
        for (text, note) in [
            (
                "time [s];x [m];mode\n0;1234,5;A\n0,05;;\n0,1;-0,25;B\n",
                "semicolons between cells; decimal commas",
            ),
            (
                "time [s];x [m];mode\n0;1234.5;A\n0.05;;\n0.1;-0.25;B\n",
                "semicolons between cells; decimal points",
            ),
            (
                "time [s]\tx [m]\tmode\n0\t1234,5\tA\n0,05\t\t\n0,1\t-0,25\tB\n",
                "tabs between cells; decimal commas",
            ),
            (
                "time [s]\tx [m]\tmode\n0\t1234.5\tA\n0.05\t\t\n0.1\t-0.25\tB\n",
                "tabs between cells",
            ),
            (
                "time [s],x [m],mode\n0,\"1234,5\",A\n\"0,05\",NA,NA\n\"0,1\",\"-0,25\",B\n",
                "decimal commas; `NA` for no sample",
            ),
            (
                "sep=;\ntime [s];x [m];mode\n0;1234,5;A\n0,05;-;-\n0,1;-0,25;B\n;;\n",
                "semicolons between cells; decimal commas; `-` for no sample",
            ),
            (
                "\u{feff}sep=\t\r\n# a\r\ntime [s]\tx [m]\tmode\r\n0\t1234.5\tA\r\n0.05\t\t\r\n0.1\t-0.25\tB\r\n",
                "tabs between cells",
            ),
            (
                "time,x,mode\ns,m,\n0,1234.5,A\n0.05,nan,\n0.1,-0.25,B\n",
                "units from the line below the header",
            ),
            (
                "time,x,mode\n[s],[m],[-]\n0,1234.5,A\n0.05,nan,\n0.1,-0.25,B\n",
                "units from the line below the header",
            ),
            (
                "time [s],x [m],mode,\n0,1234.5,A,\n0.05,,,\n0.1,-0.25,B,\n,,,\n",
                "",
            ),
            (
                "time,x [m],mode\n12:00:00.00,1234.5,A\n12:00:00.05,,\n12:00:00.10,-0.25,B\n",
                "times of the clock as seconds since the first row",
            ),
            (
                "time;x;mode\nhh:mm:ss;m;\n23:59:59,95;1234,5;A\n00:00:00,00;null;\n00:00:00,05;-0,25;B\n",
                "semicolons between cells; units from the line below the header; decimal commas; `null` for no sample; times of the clock as seconds since the first row, past midnight",
            ),
            (
                "time,x [m],mode\n2024-02-29T23:59:59.95Z,1234.5,A\n2024-03-01T01:00:00+01:00,,\n\"2024-03-01 00:00:00,050Z\",-0.25,B\n",
                "time stamps as seconds since the first row",
            ),
        ] {
            let read = Series::parse(text.as_bytes(), "f.csv")
                .unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_eq!(bits(&read), bits(&plain), "{text}");
            let column = &read.columns[0];
            assert_eq!(
                (
                    column.name.as_str(),
                    column.unit.as_str(),
                    read.time_unit.as_str()
                ),
                ("x", "m", "s"),
                "{text}"
            );
            assert!(read.text("mode").is_some(), "{text}");
            let said = read.note.unwrap_or_default();
            assert_eq!(
                said.strip_prefix("read with ").unwrap_or_default(),
                note,
                "{text}"
            );
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 2048,
            rng_seed: proptest::test_runner::RngSeed::Fixed(7),
            ..ProptestConfig::default()
        })]
        /// Whatever a file holds, it is read or refused; and what is read has as many values in each column.
        #[test]
        fn nothing_panics(
            head in "(sep=[;,\t]\n)?(time|x|[;,\t\"#]){1,5}[;,\t\r]?\n",
            rows in "([0-9]{1,4}|[.,;:\t\n\"#+eNA-]|12:00:0|2024-02-29[T ]12:00:|[sm]|ä|\u{0}){0,40}",
        ) {
            for head in [head.as_str(), "time;x\n", "time,x\n"] {
                if let Ok(read) = Series::parse((head.to_owned() + &rows).as_bytes(), "f.csv") {
                    prop_assert!(read.columns.iter().all(|own| own.values.len() == read.time.len()));
                    prop_assert!(read.time.iter().all(|time| time.is_finite()));
                }
            }
        }
    }

    /// What can be read in two ways is refused, with its place.
    #[test]
    fn what_is_unclear_is_refused() {
        for (text, begin) in [
            (
                "time;x\n0;1,234\n1;2,345\n",
                "f.csv:2: column `x`: `1,234` is 1.234 or 1234, and no number",
            ),
            (
                "time;x\n0;1.234\n1;2\n",
                "f.csv:2: column `x`: `1.234` is 1.234 or 1234, and no number",
            ),
            (
                "time,x\n0,\"1,234\"\n1,2\n",
                "f.csv:2: column `x`: `1,234` is 1.234 or 1234, and no number",
            ),
            (
                "time,x\n0,1,234\n",
                "f.csv:2: 3 cells; expected 2, as in the header: commas",
            ),
            (
                "time;x\n0;1,5\n1;1.5\n",
                "f.csv:3: column `x`: `1.5` has a point, but `1,5` on line 2 has a comma",
            ),
            (
                "time\tx\n0.0\t1\n1\t1,5\n",
                "f.csv:3: column `x`: `1,5` has a comma, but `0.0` on line 2 has a point",
            ),
            (
                "time;x\n0;1.234,5\n",
                "f.csv:2: column `x`: `1.234,5` has signs between thousands",
            ),
            (
                "time;x\n0;1\n1;1,234,567\n",
                "f.csv:3: column `x`: `1,234,567` has signs between thousands",
            ),
            (
                "time,x\n12:00,1\n12:01,2\n",
                "f.csv:2: column `time`: `12:00` is neither a number nor a time",
            ),
            (
                "time,x\n01.02.2024 12:00:00,1\n",
                "f.csv:2: column `time`: `01.02.2024 12:00:00` is neither",
            ),
            (
                "time,x\n12:00:00,1\n2,2\n",
                "f.csv:3: column `time`: `2` is no time of the form of the first row's",
            ),
            (
                "time,x\n12:00:00,1\nNA,2\n",
                "f.csv:3: column `time`: `NA` is no time",
            ),
            (
                "time,x\n2024-01-01T12:00:00,1\n2024-01-01T12:00:01Z,2\n",
                "f.csv:3: column `time`: ",
            ),
            (
                "time,x\n12:00:01,1\n12:00:00,2\n",
                "f.csv:3: time -1 s does not come after 0 s",
            ),
            (
                "time [s],x\nms,m\n0,1\n",
                "f.csv:2: column `time`: `ms` is a unit, and that of the header is `s`",
            ),
            ("time;x\ns;m\n", "f.csv: a header but no samples below it"),
            (
                "time;x\nhh:mm:ss;m\n0;1\n",
                "f.csv:1: `time` is in `hh:mm:ss`",
            ),
            ("0,0;1,5\n", "f.csv:1: the first row holds numbers"),
            ("12:00:00;1,5\n", "f.csv:1: the first row holds numbers"),
            (
                "time;x;y\n0;1\n",
                "f.csv:2: 2 cells; expected 3, as in the header",
            ),
        ] {
            let read = Series::parse(text.as_bytes(), "f.csv");
            let error = match read {
                Ok(read) => read.text("x").expect(text).error("f.csv"),
                Err(error) => error,
            };
            let error = error.to_string();
            assert!(error.starts_with(begin), "{text}: {error}");
        }
        // Nobody may use the column.
        for cell in ["192.168.100.200", "1,234,567", "1,5"] {
            let text = format!("time,x,y\n0.5,1.5,\"{cell}\"\n1,2,\"{cell}\"\n");
            let read = Series::parse(text.as_bytes(), "f.csv").unwrap();
            assert_eq!(read.text("y").unwrap().found, cell);
        }
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
