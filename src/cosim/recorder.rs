//! Where the rows of a run go.

use super::decimal;
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

/// Writes the rows as CSV: each by one call as it comes, so that in a file without buffer all rows survive
/// whatever ends the process; or, which is faster, in larger portions.
///
/// The header is `time,instance.variable,...` without units, numbers are the shortest that read back
/// as the same `f64`: what `fmpy.util.read_csv` and the FMI cross-check rules expect.
#[derive(Debug)]
pub struct CsvRecorder<W: Write> {
    to: W,
    /// Bytes of a portion.
    portion: usize,
    /// Numbers of a row, and of the rows that are not written yet; how many of them are waited for.
    columns: usize,
    waiting: Vec<f64>,
    enough: usize,
    /// For the text of a portion.
    room: Vec<u8>,
}

impl<W: Write> CsvRecorder<W> {
    /// Writes each row to `to` as it comes.
    pub fn new(to: W) -> Self {
        Self::in_portions(to, 0)
    }

    /// Writes as many rows at a time as surely fit into so many bytes, and the last ones at the
    /// [end](Self::finish).
    pub fn in_portions(to: W, portion: usize) -> Self {
        Self {
            to,
            portion,
            columns: 1,
            waiting: Vec::new(),
            enough: 1,
            room: Vec::new(),
        }
    }

    /// Writes what is left, flushes and hands the writer back.
    ///
    /// # Errors
    /// If that fails.
    pub fn finish(mut self) -> io::Result<W> {
        self.write()?;
        self.to.flush()?;
        Ok(self.to)
    }

    fn write(&mut self) -> io::Result<()> {
        let end = decimal::put_rows(&mut self.room, &self.waiting, self.columns);
        self.waiting.clear();
        self.to.write_all(&self.room[..end])
    }
}

impl<W: Write> Recorder for CsvRecorder<W> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        let mut header = b"time".to_vec();
        for signal in signals {
            header.push(b',');
            if signal.name.contains([',', '"', '\n', '\r']) {
                let quoted = format!("\"{}\"", signal.name.replace('"', "\"\""));
                header.extend(quoted.as_bytes());
            } else {
                header.extend(signal.name.as_bytes());
            }
        }
        header.push(b'\n');
        self.columns = 1 + signals.len();
        let rows = (self.portion / (decimal::LONGEST * self.columns)).max(1);
        self.enough = rows * self.columns;
        self.waiting = Vec::with_capacity(self.enough);
        self.room = vec![0; decimal::LONGEST * self.enough + decimal::SLACK];
        self.to.write_all(&header)
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        self.waiting.push(time);
        self.waiting.extend_from_slice(values);
        match self.waiting.len() < self.enough {
            true => Ok(()),
            false => self.write(),
        }
    }
}
