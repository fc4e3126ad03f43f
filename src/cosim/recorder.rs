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

/// Writes the rows as CSV, each as it comes.
///
/// The header is `time,instance.variable,...` without units, numbers are the shortest that read back
/// as the same `f64`: what `fmpy.util.read_csv` and the FMI cross-check rules expect.
#[derive(Debug)]
pub struct CsvRecorder<W: Write> {
    to: W,
}

impl<W: Write> CsvRecorder<W> {
    /// Writes to `to`, which should be buffered.
    pub fn new(to: W) -> Self {
        Self { to }
    }

    /// Flushes and hands the writer back.
    pub fn finish(mut self) -> io::Result<W> {
        self.to.flush()?;
        Ok(self.to)
    }
}

impl<W: Write> Recorder for CsvRecorder<W> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        self.to.write_all(b"time")?;
        for signal in signals {
            if signal.name.contains([',', '"', '\n', '\r']) {
                write!(self.to, ",\"{}\"", signal.name.replace('"', "\"\""))?;
            } else {
                write!(self.to, ",{}", signal.name)?;
            }
        }
        self.to.write_all(b"\n")
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        write_number(&mut self.to, time)?;
        for &value in values {
            self.to.write_all(b",")?;
            write_number(&mut self.to, value)?;
        }
        self.to.write_all(b"\n")
    }
}

/// The shortest text that reads back as the same number; a whole number without `.0`.
fn write_number(to: &mut impl Write, value: f64) -> io::Result<()> {
    let mut buffer = zmij::Buffer::new();
    let text = buffer.format(value);
    to.write_all(text.strip_suffix(".0").unwrap_or(text).as_bytes())
}
