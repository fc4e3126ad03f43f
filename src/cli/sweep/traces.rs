//! Trajectories of a study: on disk one after another as samples come to their end, then in one file by number.

use super::plan::Plan;
use crate::atomic_file::AtomicFile;
use crate::cli::Failure;
use crate::inference::sample::quantile;
use crate::series::Series;
use crate::series::parquet::{Field, Kind, ParquetWriter, Values};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Quantiles of a fan.
pub const PARTS: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];
/// Most times of a fan.
const TIMES: u64 = 200;
/// Most numbers in memory.
const HELD: usize = 1 << 21;
/// Most rows of a group of the file.
const ROWS: usize = 1 << 16;

/// A signal whose trajectories are kept.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Traced {
    /// `instance.variable`.
    pub name: String,
    /// Its unit, or nothing.
    pub unit: String,
    /// What it is, or nothing.
    pub description: String,
}

/// Where the trajectory of a sample is.
#[derive(Debug, Clone, Copy)]
struct Place {
    file: usize,
    begin: u64,
    rows: u64,
}

/// Trajectories on disk. Each is a record of little-endian numbers of 8 bytes: the sample, the number of rows, the times, the
/// values of each signal, and the sample again, without which the record was cut off by a kill.
#[derive(Default)]
pub struct Traces {
    files: Vec<(PathBuf, File)>,
    places: BTreeMap<usize, Place>,
    signals: usize,
    end: u64,
}

/// A kind of record, as long as it is whole.
fn length(rows: u64, signals: usize) -> Option<u64> {
    rows.checked_mul(signals as u64 + 1)?
        .checked_add(3)?
        .checked_mul(8)
}

fn number(from: &mut impl Read) -> io::Result<u64> {
    let mut bytes = [0; 8];
    from.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

impl Traces {
    /// Those of a study that a file has; it is made if there is none.
    pub fn open(path: &Path, plan: &Plan) -> io::Result<Self> {
        let mut own = Self {
            signals: plan.traced.len(),
            ..Self::default()
        };
        own.add_file(
            path,
            plan,
            OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false),
        )?;
        own.files[0].1.set_len(own.end)?;
        Ok(own)
    }

    /// Those of several files.
    pub fn of_parts(paths: &[PathBuf], plan: &Plan) -> io::Result<Self> {
        let mut own = Self {
            signals: plan.traced.len(),
            ..Self::default()
        };
        for path in paths {
            own.add_file(path, plan, OpenOptions::new().read(true))?;
        }
        Ok(own)
    }

    fn add_file(&mut self, path: &Path, plan: &Plan, how: &OpenOptions) -> io::Result<()> {
        let file = how.open(path)?;
        let whole = file.metadata()?.len();
        let mut from = BufReader::new(file);
        self.end = 0;
        while let (Ok(sample), Ok(rows)) = (number(&mut from), number(&mut from)) {
            let Some(next) = length(rows, self.signals).and_then(|own| own.checked_add(self.end))
            else {
                break;
            };
            if next > whole || sample >= plan.design.count() as u64 {
                break;
            }
            from.seek_relative((next - self.end - 24) as i64)?;
            if number(&mut from)? != sample {
                break;
            }
            let place = Place {
                file: self.files.len(),
                begin: self.end + 16,
                rows,
            };
            self.places.insert(sample as usize, place);
            self.end = next;
        }
        self.files.push((path.to_owned(), from.into_inner()));
        Ok(())
    }

    /// Whether a sample's trajectory is there.
    pub fn has(&self, sample: usize) -> bool {
        self.places.contains_key(&sample)
    }

    /// Keeps a trajectory, of which the last columns are those of the signals.
    pub fn add(&mut self, sample: usize, series: &Series) -> io::Result<()> {
        let rows = series.time.len() as u64;
        let columns = series.columns.iter().rev().take(self.signals).rev();
        let numbers = columns.flat_map(|own| &own.values).map(|own| own.to_bits());
        let numbers = series.time.iter().map(|own| own.to_bits()).chain(numbers);
        let all = [sample as u64, rows]
            .into_iter()
            .chain(numbers)
            .chain([sample as u64]);
        let bytes: Vec<u8> = all.flat_map(u64::to_le_bytes).collect();
        let (_, file) = &mut self.files[0];
        file.seek(SeekFrom::Start(self.end))?;
        file.write_all(&bytes)?;
        self.places.insert(
            sample,
            Place {
                file: 0,
                begin: self.end + 16,
                rows,
            },
        );
        self.end += bytes.len() as u64;
        Ok(())
    }

    /// The values of a column of a sample: 0 has the times, the others the signals.
    fn column(&self, place: Place, column: usize) -> io::Result<Vec<f64>> {
        let mut bytes = vec![0; usize::try_from(8 * place.rows).map_err(io::Error::other)?];
        let mut file = &self.files[place.file].1;
        file.seek(SeekFrom::Start(
            place.begin + 8 * place.rows * column as u64,
        ))?;
        file.read_exact(&mut bytes)?;
        let numbers = bytes.as_chunks::<8>().0.iter();
        Ok(numbers.map(|own| f64::from_le_bytes(*own)).collect())
    }

    /// Writes all of them into one file, by number.
    pub fn write(&self, path: &Path, plan: &Plan) -> Result<(), Failure> {
        self.written(path, plan)
            .map_err(|error| Failure::cannot_write(path, &error))
    }

    fn written(&self, path: &Path, plan: &Plan) -> io::Result<()> {
        let sample = Field {
            kind: Kind::Whole,
            ..Field::real("sample", "")
        };
        let signals = plan.traced.iter().map(|own| Field {
            description: own.description.clone(),
            ..Field::real(&own.name, &own.unit)
        });
        let fields: Vec<Field> = [sample, Field::real("time", "s")]
            .into_iter()
            .chain(signals)
            .collect();
        let mut writer = ParquetWriter::new(AtomicFile::create(path)?, &fields, &[])?;
        let (mut samples, mut columns) = (Vec::new(), vec![Vec::new(); self.signals + 1]);
        let most = ROWS.min(HELD / columns.len());
        let mut flush = |samples: &mut Vec<i64>, columns: &mut Vec<Vec<f64>>| -> io::Result<()> {
            let values = columns.iter().map(|own| Values::Numbers(own));
            let all: Vec<Values> = std::iter::once(Values::Whole(samples))
                .chain(values)
                .collect();
            writer.rows(&all)?;
            samples.clear();
            columns.iter_mut().for_each(Vec::clear);
            Ok(())
        };
        for (sample, place) in &self.places {
            for (k, column) in columns.iter_mut().enumerate() {
                column.extend(self.column(*place, k)?);
            }
            samples.resize(columns[0].len(), *sample as i64);
            if samples.len() >= most {
                flush(&mut samples, &mut columns)?;
            }
        }
        if !samples.is_empty() {
            flush(&mut samples, &mut columns)?;
        }
        writer.finish()?.finish()
    }

    /// Quantiles of a signal over time.
    pub fn fan(&self, signal: usize, plan: &Plan) -> io::Result<Fan> {
        let clock = plan.clock().map_err(io::Error::other)?;
        let count = clock.steps().min(TIMES);
        let at =
            |k: u64| clock.time((k as f64 * clock.steps() as f64 / count as f64).round() as u64);
        let times: Vec<f64> = (0..=count).map(at).collect();
        let mut quantiles: [Vec<f64>; PARTS.len()] = Default::default();
        // As many times at once as there is room for the values of all samples.
        for some in times.chunks((HELD / self.places.len().max(1)).max(1)) {
            let mut values = vec![Vec::with_capacity(self.places.len()); some.len()];
            for place in self.places.values() {
                let (time, column) = (self.column(*place, 0)?, self.column(*place, signal + 1)?);
                for (t, values) in some.iter().zip(&mut values) {
                    values.extend(value_at(&time, &column, *t).filter(|own| own.is_finite()));
                }
            }
            for values in &mut values {
                values.sort_by(f64::total_cmp);
                for (part, own) in PARTS.iter().zip(&mut quantiles) {
                    own.push(quantile(values, *part));
                }
            }
        }
        Ok(Fan { times, quantiles })
    }

    /// Removes the files.
    pub fn remove(self) {
        for (path, file) in self.files {
            drop(file);
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Quantiles of all samples at each time.
pub struct Fan {
    /// Times \[s\].
    pub times: Vec<f64>,
    /// For each of [`PARTS`].
    pub quantiles: [Vec<f64>; PARTS.len()],
}

/// What a trajectory is at a time: where it jumps, after the jump; between rows on a straight line; nothing after its end.
fn value_at(time: &[f64], values: &[f64], t: f64) -> Option<f64> {
    let near = 1e-9 * t.abs().max(1.0);
    let after = time.partition_point(|own| *own <= t + near);
    let k = after.checked_sub(1)?;
    if (time[k] - t).abs() <= near {
        return Some(values[k]);
    }
    let (t0, t1) = (time[k], *time.get(after)?);
    Some(values[k] + (values[after] - values[k]) * (t - t0) / (t1 - t0))
}
