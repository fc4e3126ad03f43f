//! Recording of a run: a flight for `pilotage fit`, written to disk row by row, and a log of all steps.

use crate::hand::Heard;
use crate::run::{Flown, Table};
use pilotage_series::parquet::{Field, ParquetWriter, Values};
use pilotage_text::number::rounded;
use pilotage_text::printable::comment;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Folder of the logs of all steps.
pub const LOGS: &str = "full-rate";

/// Suffix of the file of an unfinished flight.
pub const PART: &str = ".part";

/// Metadata of a run, in the order of the lines at the top of its file.
pub type Header = Vec<(&'static str, String)>;

/// A flight file that grows row by row; a separate thread writes, so that the disk does not delay the vehicle.
#[derive(Debug)]
pub struct Growing {
    path: PathBuf,
    part: PathBuf,
    rows: Sender<Vec<f64>>,
    writer: JoinHandle<io::Result<()>>,
}

impl Growing {
    /// Creates the part file of a flight, next to its final path. Rows reach the disk with a delay of at most `pace`.
    ///
    /// # Errors
    /// If it cannot be written, or another program is recording there.
    pub fn create(
        path: &Path,
        header: &Header,
        columns: &[(String, String)],
        pace: Duration,
    ) -> io::Result<Self> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let part = with_ending(path, PART);
        let mut file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&part)?;
        if let Err(error) = file.write_all((head(header, columns)).as_bytes()) {
            // The disk is full: leave no file that would block the next run.
            let _ = std::fs::remove_file(&part);
            return Err(error);
        }
        let (rows, came) = channel::<Vec<f64>>();
        let writer = std::thread::Builder::new().spawn(move || {
            while let Ok(row) = came.recv() {
                let mut text = line(&row);
                std::thread::sleep(pace);
                text.extend(came.try_iter().map(|row| line(&row)));
                // Passed to the system at once, so that nothing is lost if the process is killed.
                file.write_all(text.as_bytes())?;
            }
            Ok(())
        })?;
        Ok(Self {
            path: path.to_owned(),
            part,
            rows,
            writer,
        })
    }

    /// Appends a row. If the disk is full, `finish` or `discard` reports it.
    pub fn row(&self, row: &[f64]) {
        let _ = self.rows.send(row.to_vec());
    }

    /// Removes the part file, whose data is stored elsewhere.
    ///
    /// # Errors
    /// If it could not be written, or cannot be removed.
    pub fn discard(self) -> io::Result<()> {
        drop(self.rows);
        let written = self.writer.join().unwrap_or(Ok(()));
        std::fs::remove_file(&self.part)?;
        written
    }

    /// Writes the complete flight to its final path, with the final metadata.
    ///
    /// # Errors
    /// If it cannot be written; the rows so far remain in the part file.
    pub fn finish(
        self,
        path: Option<&Path>,
        header: &Header,
        table: &Table,
    ) -> io::Result<PathBuf> {
        drop(self.rows);
        self.writer.join().unwrap_or(Ok(()))?;
        let path = path.unwrap_or(&self.path);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let mut text = head(header, &table.names);
        for k in 0..table.len() {
            text += &line(&table.row(k));
        }
        let whole = with_ending(path, ".whole");
        fresh(&whole)?.write_all(text.as_bytes())?;
        std::fs::rename(&whole, path)?;
        std::fs::remove_file(&self.part)?;
        Ok(path.to_owned())
    }
}

/// A new file in the place of one that a killed process left, whatever that is.
fn fresh(path: &Path) -> io::Result<File> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => OpenOptions::new().write(true).create_new(true).open(path),
    }
}

fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    name.into()
}

fn head(header: &Header, columns: &[(String, String)]) -> String {
    let lines = header
        .iter()
        .map(|(key, value)| comment(&format!("{key}: {value}")));
    let columns: Vec<String> = columns
        .iter()
        .map(|(name, unit)| pilotage_series::head(name, unit))
        .collect();
    lines.collect::<String>() + &columns.join(",") + "\n"
}

/// Values that are not finite are missing samples.
fn line(row: &[f64]) -> String {
    let cell = |value: &f64| match value.is_finite() {
        true => short(*value),
        false => String::new(),
    };
    let cells: Vec<String> = row.iter().map(cell).collect();
    cells.join(",") + "\n"
}

/// Rounds to nine digits; human data has no more.
fn short(value: f64) -> String {
    rounded(value, 9).to_string()
}

/// Unfinished flights in the folder: the program was killed, the power failed, or the disk was full. If only the log of
/// all steps is left of a run, the log is listed.
///
/// # Errors
/// If the folder cannot be read.
pub fn unfinished(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut all = parts(folder)?;
    let names: Vec<_> = all
        .iter()
        .map(|path| path.file_name().map(ToOwned::to_owned))
        .collect();
    let logs = folder.join(LOGS);
    if logs.is_dir() {
        let is_alone = |path: &PathBuf| !names.contains(&path.file_name().map(ToOwned::to_owned));
        all.extend(parts(&logs)?.into_iter().filter(is_alone));
    }
    Ok(all)
}

/// The part files in a folder.
fn parts(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.to_string_lossy().ends_with(&format!(".csv{PART}")) {
            all.push(path);
        }
    }
    all.sort();
    Ok(all)
}

/// Writes all steps and all input frames of a run as Parquet files: `NAME.parquet` and `NAME.frames.parquet`.
///
/// # Errors
/// If they cannot be written.
pub fn logs(folder: &Path, name: &str, header: &Header, flown: &Flown) -> io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let write = |ending: &str, table: &Table| {
        let path = folder.join(format!("{name}{ending}.parquet"));
        parquet(&path, header, table)
            .map_err(|error| io::Error::other(format!("{}: {error}", path.display())))
    };
    write("", &flown.log)?;
    write(".frames", &frames(&flown.heard))
}

/// The page's frames: number, page time, arrival, deflection, visibility, and what was drawn when.
fn frames(heard: &Heard) -> Table {
    let axes = heard
        .frames
        .first()
        .map_or(0, |frame| frame.input.stick.len());
    let sticks = (1..=axes).map(|axis| format!("hand{axis}"));
    let names = [
        "n",
        "page_time",
        "arrival",
        "frame",
        "seen",
        "drawn",
        "drawn_at",
    ]
    .map(str::to_owned)
    .into_iter()
    .chain(sticks);
    let unit = |name: &str| match name {
        "page_time" | "frame" | "drawn_at" => "ms",
        "arrival" | "drawn" => "s",
        _ => "1",
    };
    let names: Vec<(String, String)> = names
        .map(|name| (name.clone(), unit(&name).to_owned()))
        .collect();
    let of = |own: &dyn Fn(&crate::hand::Frame) -> f64| {
        heard.frames.iter().map(own).collect::<Vec<f64>>()
    };
    let mut columns = vec![
        of(&|own| own.input.n as f64),
        of(&|own| own.input.t),
        of(&|own| own.time),
        of(&|own| own.input.frame),
        of(&|own| f64::from(u8::from(own.input.seen))),
        of(&|own| own.input.drawn.unwrap_or(f64::NAN)),
        of(&|own| own.input.drawn_at.unwrap_or(f64::NAN)),
    ];
    columns.extend((0..axes).map(|axis| of(&|own| own.input.stick[axis])));
    Table { names, columns }
}

fn parquet(path: &Path, header: &Header, table: &Table) -> io::Result<()> {
    let columns = table.names.iter();
    let fields: Vec<Field> = columns
        .map(|(name, unit)| Field::real(field(name, unit), unit))
        .collect();
    let part = with_ending(path, PART);
    let mut writer = ParquetWriter::new(fresh(&part)?, &fields, header)?;
    let values: Vec<Values> = table
        .columns
        .iter()
        .map(|own| Values::Numbers(own))
        .collect();
    writer.rows(&values)?;
    writer.finish()?;
    std::fs::rename(&part, path)
}

/// A column's name with its unit in letters, digits and underscores, as required by the schema.
fn field(name: &str, unit: &str) -> String {
    let both = match unit {
        "1" => name.to_owned(),
        _ => format!("{name}_{unit}"),
    };
    both.replace(|c: char| !c.is_ascii_alphanumeric(), "_")
}
