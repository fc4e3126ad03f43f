//! Where the rows of a run go.

use crate::series::{Column, Series};
use std::io::{self, Write};

/// A recorded signal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signal {
    /// `instance.variable`.
    pub name: String,
    /// Unit; empty if unknown.
    pub unit: String,
}

/// Takes the rows of a run as they are computed.
pub trait Recorder {
    /// Called once, before the first row.
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()>;

    /// One row: the time [s] and a value for each signal.
    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()>;

    /// Whether the run shall end after this row: asked after each.
    fn is_stop_asked(&mut self) -> bool {
        false
    }
}

/// Keeps the rows as a [`Series`].
#[derive(Debug, Clone, Default)]
pub struct SeriesRecorder {
    /// What was recorded.
    pub series: Series,
}

impl SeriesRecorder {
    /// An empty series with room for `rows` rows, so that recording does not allocate.
    pub fn with_capacity(rows: usize) -> Self {
        let mut recorder = Self::default();
        recorder.series.time.reserve(rows);
        recorder
    }
}

impl Recorder for SeriesRecorder {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
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

/// Writes the rows as CSV, each by one call as it comes: into a file without buffer, all rows survive
/// whatever ends the process.
///
/// The header is `time,instance.variable,...` without units, numbers are the shortest that read back
/// as the same `f64`: what `fmpy.util.read_csv` and the FMI cross-check rules expect.
#[derive(Debug)]
pub struct CsvRecorder<W: Write> {
    to: W,
    line: Vec<u8>,
}

impl<W: Write> CsvRecorder<W> {
    /// Writes to `to`.
    pub fn new(to: W) -> Self {
        let line = Vec::new();
        Self { to, line }
    }

    /// Flushes and hands the writer back.
    pub fn finish(mut self) -> io::Result<W> {
        self.to.flush()?;
        Ok(self.to)
    }
}

impl<W: Write> Recorder for CsvRecorder<W> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        self.line.extend(b"time");
        for signal in signals {
            self.line.push(b',');
            if signal.name.contains([',', '"', '\n', '\r']) {
                let quoted = format!("\"{}\"", signal.name.replace('"', "\"\""));
                self.line.extend(quoted.as_bytes());
            } else {
                self.line.extend(signal.name.as_bytes());
            }
        }
        self.line.push(b'\n');
        // Longer than a row of numbers will ever be, so that rows allocate nothing.
        self.line.reserve(LONGEST * (signals.len() + 1));
        self.write_line()
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        push_number(&mut self.line, time);
        for &value in values {
            self.line.push(b',');
            push_number(&mut self.line, value);
        }
        self.line.push(b'\n');
        self.write_line()
    }
}

impl<W: Write> CsvRecorder<W> {
    fn write_line(&mut self) -> io::Result<()> {
        self.to.write_all(&self.line)?;
        self.line.clear();
        Ok(())
    }
}

/// Bytes that a number and its comma take at most.
const LONGEST: usize = 26;

/// The shortest text that reads back as the same number; a whole number without `.0`.
fn push_number(line: &mut Vec<u8>, value: f64) {
    let mut buffer = zmij::Buffer::new();
    let text = buffer.format(value);
    line.extend(text.strip_suffix(".0").unwrap_or(text).as_bytes());
}
