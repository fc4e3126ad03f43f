//! Rows as Parquet.

use super::{Recorder, Signal};
use pilotage_series::parquet::{Field, ParquetWriter, Values};
use std::io::{self, Write};

/// Most values that are held until they are written.
const HELD: usize = 1 << 20;
/// Most rows of a group.
const ROWS: usize = 1 << 16;

/// Writes the rows as Parquet, in groups, so that memory does not grow with the run. The file can be read once it is
/// [finished](Self::finish). Columns are `time` and the signals; units and descriptions are in the metadata.
pub struct ParquetRecorder<W: Write + Send> {
    writer: Option<ParquetWriter<W>>,
    to: Option<W>,
    columns: Vec<Vec<f64>>,
}

/// The column of a signal.
pub fn field(signal: &Signal) -> Field {
    Field {
        description: signal.description.clone(),
        ..Field::real(&signal.name, &signal.unit)
    }
}

impl<W: Write + Send> ParquetRecorder<W> {
    /// Writes to `to`.
    pub fn new(to: W) -> Self {
        Self {
            writer: None,
            to: Some(to),
            columns: Vec::new(),
        }
    }

    /// Writes what is left, and gives the writer back.
    ///
    /// # Errors
    /// If writing fails.
    pub fn finish(mut self) -> io::Result<W> {
        self.write()?;
        match (self.writer, self.to) {
            (Some(writer), _) => writer.finish(),
            (None, Some(to)) => ParquetWriter::new(to, &[Field::real("time", "s")], &[])?.finish(),
            (None, None) => Err(io::Error::other("its beginning could not be written")),
        }
    }

    fn write(&mut self) -> io::Result<()> {
        if let Some(writer) = &mut self.writer
            && self.columns.first().is_some_and(|own| !own.is_empty())
        {
            let values: Vec<Values> = self
                .columns
                .iter()
                .map(|own| Values::Numbers(own))
                .collect();
            writer.rows(&values)?;
            self.columns.iter_mut().for_each(Vec::clear);
        }
        Ok(())
    }
}

impl<W: Write + Send> Recorder for ParquetRecorder<W> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        let to = self.to.take().ok_or_else(|| {
            io::Error::other("it has the rows of a run already; take another recorder")
        })?;
        let fields: Vec<Field> = std::iter::once(Field::real("time", "s"))
            .chain(signals.iter().map(field))
            .collect();
        self.columns = vec![Vec::new(); fields.len()];
        self.writer = Some(ParquetWriter::new(to, &fields, &[])?);
        Ok(())
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        for (column, value) in self
            .columns
            .iter_mut()
            .zip(std::iter::once(&time).chain(values))
        {
            column.push(*value);
        }
        let rows = self.columns.first().map_or(0, Vec::len);
        match rows >= ROWS.min(HELD / self.columns.len().max(1)).max(1) {
            true => self.write(),
            false => Ok(()),
        }
    }
}
