//! Where the rows of a run go: into a file, or to the program that calls the command.

use super::super::{Failure, call, guard, system, terminal};
use crate::atomic_file::{AtomicFile, GrowingFile};
use crate::cli::overwrite::is_parquet;
use crate::cosim::{
    CsvRecorder, MasterError, ParquetRecorder, Recorder, SeriesRecorder, SystemDescription,
};
use std::io;
use std::path::{Path, PathBuf};

/// The name of the table that a caller gets.
pub const TABLE: &str = "result";

/// The rows of a run.
pub enum Rows {
    /// A file under its final name with `.part`.
    File(Box<CsvRecorder<GrowingFile>>, PathBuf),
    /// A Parquet file, which is there once it is whole.
    Parquet(Box<ParquetRecorder<AtomicFile>>),
    /// Columns in memory.
    Memory(SeriesRecorder),
}

impl Rows {
    /// Opens the file, unless another program takes the rows, of which there will be about `count`.
    pub fn open(path: &Path, count: u64) -> Result<Self, Failure> {
        if call::is_on() {
            // Memory for more is taken as they come.
            const MOST: u64 = 1_000_000;
            let count = usize::try_from(count.min(MOST)).unwrap_or_default();
            return Ok(Self::Memory(SeriesRecorder::with_capacity(count)));
        }
        if is_parquet(path) {
            let file = AtomicFile::create(path);
            let file = file.map_err(|error| Failure::cannot_write(path, &error))?;
            return Ok(Self::Parquet(Box::new(ParquetRecorder::new(file))));
        }
        let file = file(path)?;
        let part = file.part().to_owned();
        pilotage_process::record(&format!("{}{}", guard::ROWS, part.display()));
        Ok(Self::File(Box::new(CsvRecorder::new(file)), part))
    }

    /// What takes the rows.
    pub fn recorder(&mut self) -> &mut dyn Recorder {
        match self {
            Self::File(csv, _) => csv.as_mut(),
            Self::Parquet(own) => own.as_mut(),
            Self::Memory(series) => series,
        }
    }

    /// Gives the file its final name, or the columns to the caller.
    pub fn save(self, path: &Path) -> Result<(), Failure> {
        let csv = match self {
            Self::File(csv, _) => csv,
            Self::Parquet(own) => {
                let written = own.finish().and_then(AtomicFile::finish);
                return written.map_err(|error| Failure::cannot_write(path, &error));
            }
            Self::Memory(recorder) => {
                call::keep(TABLE, recorder.series);
                return Ok(());
            }
        };
        let file = csv.finish().and_then(GrowingFile::finish);
        file.map_err(|error| match error.kind() {
            io::ErrorKind::InvalidData => Failure::new(error.to_string())
                .hint("with --isolate all an FMU cannot reach it")
                .ran(),
            _ => Failure::cannot_write(path, &error),
        })
    }

    /// The failure to report. Discards the rows written so far, unless writing them failed: otherwise the run has not
    /// begun.
    pub fn explain(self, error: MasterError, description: &SystemDescription) -> Failure {
        let is_write_error = matches!(error, MasterError::Record { .. });
        let failure = system::explain(error, description);
        let Self::File(csv, part) = self else {
            return failure;
        };
        match is_write_error {
            // A pipe or a device keeps no rows.
            true if !part.is_file() => failure,
            true => failure.hint(format!(
                "is there room? The rows until then are in {}",
                part.display()
            )),
            false => {
                if let Ok(file) = csv.finish() {
                    file.discard();
                }
                failure
            }
        }
    }
}

fn file(path: &Path) -> Result<GrowingFile, Failure> {
    let file = GrowingFile::create(path).map_err(|error| {
        let failure = Failure::cannot_write(path, &error);
        match error.kind() {
            io::ErrorKind::ResourceBusy => {
                failure.hint("wait for it, or give this run another --output")
            }
            _ => failure,
        }
    })?;
    if let Some(aside) = file.left_behind() {
        terminal::note(&format!(
            "an earlier run of {} was killed or crashed; its rows are in {}",
            path.display(),
            aside.display()
        ));
    }
    Ok(file)
}
