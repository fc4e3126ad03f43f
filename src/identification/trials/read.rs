//! A trial from its file.

use super::{Trial, TrialError};
use crate::nearest::nearest;
use crate::series::{Column, Series};
use sha2::{Digest, Sha256};
use std::path::Path;

/// Least number of recorded positions: below that six parameters mean nothing.
const MIN_SAMPLES: usize = 10;

/// Lengths that are converted to metres; no unit means metres.
const LENGTHS: &[(&str, f64)] = &[
    ("m", 1.0),
    ("", 1.0),
    ("mm", 1e-3),
    ("cm", 1e-2),
    ("km", 1e3),
    ("ft", 0.3048),
];

/// Units of the stick; full deflection is 1.
const STICKS: &[(&str, f64)] = &[("1", 1.0), ("", 1.0), ("-", 1.0), ("%", 1e-2)];

impl Trial {
    /// Reads one run from its CSV file.
    ///
    /// # Errors
    /// When the file cannot be read, is not a time series, or lacks what a trial must have.
    pub fn read(path: &Path) -> Result<Self, TrialError> {
        let bytes = std::fs::read(path).map_err(|source| TrialError::Read {
            file: path.to_owned(),
            source,
        })?;
        Self::parse(&bytes, &path.display().to_string())
    }

    /// Parses the bytes of a CSV file; `origin` is its name, and the trial is named after its stem.
    ///
    /// # Errors
    /// As [`Trial::read`].
    pub fn parse(bytes: &[u8], origin: &str) -> Result<Self, TrialError> {
        let series = Series::parse(bytes, origin)?;
        let stem = Path::new(origin).file_stem();
        let target = values(
            required(&series, "target", origin)?,
            "target",
            LENGTHS,
            origin,
        )?;
        let position = required(&series, "position", origin)?;
        let position = values(position, "position", LENGTHS, origin)?;
        let recorded = |column: &&Column| column.values.iter().any(|value| !value.is_nan());
        let stick = (series.column("stick").filter(recorded))
            .map(|column| values(column, "stick", STICKS, origin))
            .transpose()?;
        let trial = Self {
            name: stem.map_or_else(|| origin.into(), |stem| stem.to_string_lossy().into_owned()),
            origin: origin.into(),
            sha256: hex(&Sha256::digest(bytes)),
            time: series.time,
            target,
            position,
            stick,
            weight: 1.0,
        };
        trial.check()?;
        Ok(trial)
    }

    fn check(&self) -> Result<(), TrialError> {
        let file = || self.origin.clone();
        if let Some(k) = self.target.iter().position(|target| target.is_nan()) {
            return Err(TrialError::NoTarget {
                file: file(),
                time: self.time[k],
            });
        }
        let found = self.position.iter().filter(|p| !p.is_nan()).count();
        if found < MIN_SAMPLES {
            return Err(TrialError::TooFew {
                file: file(),
                found,
                expected: MIN_SAMPLES,
            });
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

/// The column that must be there.
fn required<'a>(
    series: &'a Series,
    column: &'static str,
    file: &str,
) -> Result<&'a Column, TrialError> {
    series.column(column).ok_or_else(|| {
        let names = || series.columns.iter().map(|c| c.name.as_str());
        TrialError::NoColumn {
            file: file.into(),
            column,
            nearest: nearest(column, names()).map(str::to_owned),
            found: names().map(str::to_owned).collect(),
        }
    })
}

/// The column's values in the unit of factor 1.
fn values(
    column: &Column,
    name: &'static str,
    units: &[(&'static str, f64)],
    file: &str,
) -> Result<Vec<f64>, TrialError> {
    match units.iter().find(|(unit, _)| *unit == column.unit) {
        Some((_, factor)) => Ok(column.values.iter().map(|value| value * factor).collect()),
        None => Err(TrialError::Unit {
            file: file.into(),
            column: name,
            found: column.unit.clone(),
            known: units
                .iter()
                .map(|(unit, _)| *unit)
                .filter(|unit| !unit.is_empty())
                .collect(),
        }),
    }
}

/// Bytes in lower-case hexadecimal.
fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
