//! Recorders for the rows of a run.

#[cfg(feature = "parquet")]
mod parquet;

#[cfg(feature = "parquet")]
pub use self::parquet::{ParquetRecorder, field};
use pilotage_series::{Column, Series, head};
use std::io::{self, Write};

/// A recorded signal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signal {
    /// `instance.variable`.
    pub name: String,
    /// Unit; empty if unknown.
    pub unit: String,
    /// What it is; empty if unknown.
    pub description: String,
}

/// Receives the rows of a run as they are computed.
pub trait Recorder: Send {
    /// Called once, before the first row.
    ///
    /// # Errors
    /// If the beginning cannot be written, here and below.
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()>;

    /// One row: the time \[s\] and a value for each signal.
    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()>;

    /// Called once, after the last row.
    fn end_rows(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// Whether the run should end after this row; called after each row.
    fn is_stop_asked(&mut self) -> bool {
        false
    }
}

/// Keeps the rows as a [`Series`].
#[derive(Debug, Clone, Default)]
pub struct SeriesRecorder {
    /// The recorded series.
    pub series: Series,
}

impl SeriesRecorder {
    /// An empty series with capacity for `rows` rows, so that recording does not allocate.
    pub fn with_capacity(rows: usize) -> Self {
        let mut recorder = Self::default();
        recorder.series.time.reserve(rows);
        recorder
    }
}

impl Recorder for SeriesRecorder {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        // Only the rows of the last run are kept.
        self.series.time.clear();
        let rows = self.series.time.capacity();
        let column = |signal: &Signal| Column {
            name: signal.name.clone(),
            unit: signal.unit.clone(),
            values: Vec::with_capacity(rows),
        };
        self.series.columns = signals.iter().map(column).collect();
        Ok(())
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        self.series.time.push(time);
        for (column, &value) in self.series.columns.iter_mut().zip(values) {
            column.values.push(value);
        }
        Ok(())
    }
}

/// Writes the rows as CSV: either each row with one call, so that with an unbuffered file all rows survive a crash of
/// the process, or in larger portions, which is faster.
///
/// The header is `time,instance.variable [unit],...`; numbers are the shortest that read back as the same `f64`
/// (including `NaN` and `inf`). [`Series::read_table`] restores names and units. `fmpy.util.read_csv` reads the file
/// too, with the unit as part of the name; it requires a column `time`, which therefore has no unit \[s\].
#[derive(Debug)]
pub struct CsvRecorder<W: Write> {
    to: W,
    /// Number of bytes to collect before writing, number of bytes collected, and a buffer for these plus the longest
    /// row.
    portion: usize,
    filled: usize,
    room: Vec<u8>,
}

impl<W: Write> CsvRecorder<W> {
    /// Writes each row to `to` immediately.
    pub fn new(to: W) -> Self {
        Self::in_portions(to, 0)
    }

    /// Writes once `portion` bytes are collected, and at the [end](Self::finish).
    pub fn in_portions(to: W, portion: usize) -> Self {
        Self {
            to,
            portion,
            filled: 0,
            room: Vec::new(),
        }
    }

    /// Writes the remaining bytes, flushes and returns the writer.
    ///
    /// # Errors
    /// If writing fails.
    pub fn finish(mut self) -> io::Result<W> {
        self.write()?;
        self.to.flush()?;
        Ok(self.to)
    }

    fn write(&mut self) -> io::Result<()> {
        let filled = std::mem::take(&mut self.filled);
        self.to.write_all(&self.room[..filled])
    }
}

impl<W: Write + Send> Recorder for CsvRecorder<W> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        if !self.room.is_empty() {
            return Err(io::Error::other(
                "it has the rows of a run already; take another recorder",
            ));
        }
        let mut header = b"time".to_vec();
        for signal in signals {
            header.push(b',');
            header.extend(head(&signal.name, &signal.unit).as_bytes());
        }
        header.push(b'\n');
        self.room = vec![0; self.portion + LONGEST * (signals.len() + 1)];
        self.to.write_all(&header)
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        if self.room.is_empty() {
            return Err(io::Error::other("a row before its head"));
        }
        let mut end = put_numbers(&mut self.room, self.filled, &[time]);
        for some in values.chunks(TOGETHER) {
            end = put_numbers(&mut self.room, end, some);
        }
        self.room[end - 1] = b'\n';
        self.filled = end;
        match end > self.portion {
            true => self.write(),
            false => Ok(()),
        }
    }
}

/// Maximum length of a number and its separator in bytes: 24 and one.
const LONGEST: usize = 25;

/// Number of values formatted before the first is copied, since data just written is slow to read.
const TOGETHER: usize = 8;

/// Writes up to [`TOGETHER`] numbers at `at`, each followed by a comma, and returns the end. Each text is the shortest
/// that reads back as the same number; whole numbers have no `.0`.
fn put_numbers(line: &mut [u8], mut at: usize, numbers: &[f64]) -> usize {
    let mut buffers: [zmij::Buffer; TOGETHER] = std::array::from_fn(|_| zmij::Buffer::new());
    let mut texts = [""; TOGETHER];
    for ((text, buffer), &number) in texts.iter_mut().zip(&mut buffers).zip(numbers) {
        *text = buffer.format(number);
    }
    for text in &texts[..numbers.len()] {
        let text = text.strip_suffix(".0").unwrap_or(text).as_bytes();
        let end = at + text.len();
        copy_short(&mut line[at..end], text);
        line[end] = b',';
        at = end + 1;
    }
    at
}

/// Copies up to 32 bytes in overlapping pieces of fixed size: a `memcpy` call with varying length takes a fourth of the
/// time of formatting the number.
#[inline]
fn copy_short(to: &mut [u8], from: &[u8]) {
    let n = from.len();
    if n >= 16 {
        to[..16].copy_from_slice(&from[..16]);
        to[n - 16..].copy_from_slice(&from[n - 16..]);
    } else if n >= 8 {
        to[..8].copy_from_slice(&from[..8]);
        to[n - 8..].copy_from_slice(&from[n - 8..]);
    } else {
        for (to, from) in to.iter_mut().zip(from) {
            *to = *from;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 256,
            rng_seed: proptest::test_runner::RngSeed::Fixed(4),
            ..ProptestConfig::default()
        })]
        /// Names, units and bits are kept; a NaN is a missing sample, and times may repeat.
        #[test]
        fn a_result_reads_back_as_a_table(
            names in prop::collection::btree_set("[a-z]{1,3}\\.[a-z_.()']{1,4}(\\[[0-9]{1,2}(,[0-9])?\\])?", 1..5),
            unit in "|1|m|rad/s|µs/rad|m,s",
            mut times in prop::collection::vec(-1e6..1e6, 1..9),
            seed in prop::collection::vec(prop::num::f64::ANY, 40),
        ) {
            times.push(times[0]);
            times.sort_by(f64::total_cmp);
            let signals: Vec<Signal> = (names.iter())
                .map(|name| Signal { name: name.clone(), unit: unit.clone(), description: String::new() })
                .collect();
            let row = |k: usize| &seed[4 * (k % 10)..][..signals.len()];
            let mut recorder = CsvRecorder::in_portions(Vec::new(), 100);
            recorder.begin(&signals).unwrap();
            for (k, time) in times.iter().enumerate() {
                recorder.row(*time, row(k)).unwrap();
            }
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), recorder.finish().unwrap()).unwrap();
            let read = Series::read_table(file.path()).unwrap();
            prop_assert_eq!(&read.time, &times);
            prop_assert_eq!(read.columns.len(), signals.len());
            for (i, (column, signal)) in read.columns.iter().zip(&signals).enumerate() {
                prop_assert_eq!((&column.name, &column.unit), (&signal.name, &signal.unit));
                for (k, value) in column.values.iter().enumerate() {
                    let written = row(k)[i];
                    prop_assert!(*value == written || (value.is_nan() && written.is_nan()));
                }
            }
        }
    }
}
