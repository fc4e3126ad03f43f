//! Reading a trial from its file.

use super::{ColumnNames, Trial, TrialError};
use pilotage_estimation::posed::data::{filled, gap};
use pilotage_inference::sampling::median_step;
use pilotage_series::{Column, Series};
use pilotage_text::file;
use pilotage_text::printable::one_line;
use pilotage_text::suggestion::suggestion;
use pilotage_units::Unit;
use sha2::{Digest, Sha256};
use std::ffi::OsStr;
use std::path::Path;

/// Limit on the magnitude of positions and targets \[m\]: more than twice the distance to the Moon.
const FARTHEST: f64 = 1e9;

/// Limit on the duration of a run \[s\]: eleven days.
const LONGEST: f64 = 1e6;

/// Minimum number of recorded positions: fewer are no motion.
const MIN_SAMPLES: usize = 2;

/// Unit of lengths, assumed if a column has none, and examples for messages.
const LENGTH: Quantity = ("m", "a length, such as m, cm or ft");

/// The same for the stick; full deflection is 1.
const STICK: Quantity = ("1", "1 or %");

/// Unit, and the expected units for messages.
type Quantity = (&'static str, &'static str);

/// Excess of a stick over its stops, by rounding and calibration, up to which it is set to full deflection: 1 % of the
/// full range.
const STICK_TOLERANCE: f64 = 0.02;

/// Minimum sampling interval [s] that makes seconds doubtful for times without a unit: a human's stick is not recorded
/// only once a second.
const SLOW: f64 = 1.0;

/// A trial, and further contents of its file.
pub(super) struct Read {
    pub trial: Trial,
    /// Notes on possible mistakes for the user.
    pub notes: Vec<String>,
    /// Leading comments of the file.
    pub comments: Vec<String>,
}

impl Trial {
    /// Reads one run from its CSV file. Notes on possible mistakes are reported only by
    /// [`TrialSet::read`](super::TrialSet::read).
    ///
    /// # Errors
    /// If the file cannot be read, is not a time series, or lacks a required quantity.
    pub fn read(path: &Path) -> Result<Self, TrialError> {
        Self::read_with_notes(path, &ColumnNames::default()).map(|read| read.trial)
    }

    /// The same, with notes on possible mistakes.
    pub(super) fn read_with_notes(path: &Path, columns: &ColumnNames) -> Result<Read, TrialError> {
        let bytes = file::bytes(path).map_err(|source| TrialError::Read {
            file: path.to_owned(),
            source,
        })?;
        Self::parse_with_notes(&bytes, &path.display().to_string(), columns)
    }

    /// Parses the bytes of a CSV file; `origin` is its name, and the trial is named after its stem.
    ///
    /// # Errors
    /// As [`Trial::read`].
    pub fn parse(bytes: &[u8], origin: &str) -> Result<Self, TrialError> {
        Self::parse_with_notes(bytes, origin, &ColumnNames::default()).map(|read| read.trial)
    }

    fn parse_with_notes(
        bytes: &[u8],
        origin: &str,
        columns: &ColumnNames,
    ) -> Result<Read, TrialError> {
        let series = Series::parse_with_time(bytes, origin, columns.of("time"))?;
        let stem = Path::new(origin).file_stem();
        let target = values(
            required(&series, columns.of("target"), origin)?,
            "target",
            LENGTH,
            origin,
        )?;
        let target = whole(&series.time, &target, origin)?;
        let position = required(&series, columns.of("position"), origin)?;
        let position = values(position, "position", LENGTH, origin)?;
        let recorded = |column: &&Column| column.values.iter().any(|value| !value.is_nan());
        let stick = match columns.given("stick") {
            Some(name) => Some(required(&series, name, origin)?),
            None => {
                check_text(&series, "stick", origin)?;
                series.column("stick")
            }
        };
        let mut stick = (stick.filter(recorded))
            .map(|column| values(column, "stick", STICK, origin))
            .transpose()?;
        let clipped = stick.as_mut().and_then(|stick| clip(stick));
        let notes = [series.note.clone(), doubtful_times(&series), clipped];
        let trial = Self {
            name: one_line(&stem.map_or(origin.into(), OsStr::to_string_lossy)).into_owned(),
            origin: origin.into(),
            sha256: sha256(bytes),
            time: series.time,
            time_unit: series.time_unit,
            target,
            position,
            stick,
            weight: 1.0,
            note: series.note,
        };
        trial.check()?;
        let notes = notes.into_iter().flatten();
        Ok(Read {
            trial,
            notes: notes.map(|note| format!("{origin}: {note}")).collect(),
            comments: series.comments,
        })
    }

    fn check(&self) -> Result<(), TrialError> {
        let file = || self.origin.clone();
        let recorded = self.time.iter().zip(&self.position);
        let recorded = recorded.filter(|(_, position)| !position.is_nan());
        let mut times: Vec<f64> = recorded.map(|(time, _)| *time).collect();
        times.dedup();
        let found = times.len();
        if found < MIN_SAMPLES {
            return Err(TrialError::TooFew {
                file: file(),
                found,
                expected: MIN_SAMPLES,
            });
        }
        let duration = self.duration();
        if duration > LONGEST {
            return Err(TrialError::Long {
                file: file(),
                duration,
                limit: LONGEST,
            });
        }
        let far = [("position", &self.position), ("target", &self.target)];
        for (column, values) in far {
            let mut samples = self.time.iter().zip(values);
            if let Some((time, value)) = samples.find(|(_, value)| value.abs() > FARTHEST) {
                return Err(TrialError::Far {
                    file: file(),
                    column,
                    time: *time,
                    value: *value,
                    limit: FARTHEST,
                });
            }
        }
        let stick = self.stick.iter().flatten();
        match stick.enumerate().find(|(_, stick)| stick.abs() > 1.0) {
            Some((k, &value)) => Err(TrialError::Stick {
                file: file(),
                time: self.time[k],
                value,
            }),
            None => Ok(()),
        }
    }
}

/// The target at all samples: along lines where few are missing, as a problem takes the columns of inputs.
fn whole(time: &[f64], target: &[f64], file: &str) -> Result<Vec<f64>, TrialError> {
    let known = time.iter().zip(target).filter(|(_, own)| own.is_finite());
    let known: Vec<f64> = known.map(|(time, _)| *time).collect();
    let ends = [0, time.len() - 1].map(|k| time[k]);
    let gap = if known.is_empty() {
        Some(ends)
    } else {
        gap(time, &known)
    };
    match gap {
        Some([from, to]) => Err(TrialError::NoTarget {
            file: file.to_owned(),
            from,
            to,
        }),
        None => Ok(filled(time, target)),
    }
}

/// Sets a stick that is slightly beyond its stops to full deflection, and returns a note.
fn clip(stick: &mut [f64]) -> Option<String> {
    let near = |value: f64| (1.0..=1.0 + STICK_TOLERANCE).contains(&value.abs());
    let beyond = stick
        .iter_mut()
        .filter(|value| near(**value) && value.abs() != 1.0);
    let (mut count, mut worst) = (0, 0.0_f64);
    for value in beyond {
        count += 1;
        if value.abs() > worst.abs() {
            worst = *value;
        }
        *value = value.signum();
    }
    let all = stick.len();
    (count > 0).then(|| {
        format!(
            "{count} of {all} samples of the stick are beyond its stops, the farthest at {worst:.4}; they are \
             taken for full"
        )
    })
}

/// A note if the times are probably not in seconds and the header has no unit.
fn doubtful_times(series: &Series) -> Option<String> {
    let step = median_step(&series.time).filter(|step| *step >= SLOW)?;
    let duration = series.time[series.time.len() - 1] - series.time[0];
    let rounded = |value: f64| (1e3 * value).round() / 1e3;
    series.time_unit.is_empty().then(|| {
        format!(
            "the times have no unit and are taken for seconds: {} samples in {} s, one every {} s; head the \
             column `time [ms]` if they are milliseconds, and `time [s]` if they are not",
            series.time.len(),
            rounded(duration),
            rounded(step)
        )
    })
}

/// Rejects a column of words.
fn check_text(series: &Series, column: &str, file: &str) -> Result<(), TrialError> {
    match series.text(column) {
        Some(text) => Err(text.error(file).into()),
        None => Ok(()),
    }
}

/// The column, or an error if it is missing or has words.
fn required<'a>(series: &'a Series, column: &str, file: &str) -> Result<&'a Column, TrialError> {
    check_text(series, column, file)?;
    series.column(column).ok_or_else(|| {
        let names = || series.columns.iter().map(|c| c.name.as_str());
        TrialError::NoColumn {
            file: file.into(),
            column: column.into(),
            suggestion: suggestion(column, names()).map(str::to_owned),
            found: names().map(str::to_owned).collect(),
        }
    })
}

/// The column's values in the quantity's unit.
fn values(
    column: &Column,
    name: &'static str,
    (unit, expected): Quantity,
    file: &str,
) -> Result<Vec<f64>, TrialError> {
    let own = match column.unit.as_str() {
        "" => unit,
        "-" => "1",
        own => own,
    };
    match Unit::named(own).conversion(&Unit::named(unit)) {
        Some(conversion) => Ok((column.values.iter())
            .map(|value| conversion.apply(*value))
            .collect()),
        None => Err(TrialError::Unit {
            file: file.into(),
            column: name,
            found: column.unit.clone(),
            expected,
        }),
    }
}

/// SHA-256 of a file's bytes in lower-case hexadecimal, by which a result identifies its data.
pub fn sha256(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}
