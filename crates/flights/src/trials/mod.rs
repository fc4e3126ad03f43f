//! Recorded flights.
//!
//! One run is one CSV file with the columns `time` \[s\], `target` \[m\], `position` \[m\] and, if recorded, `stick`
//! [-1 to 1]; other columns are ignored. A manifest (TOML) lists runs:
//!
//! ```toml
//! [[run]]
//! file = "10m-run1.csv"     # beside the manifest
//! weight = 1.0              # of its squared residuals; 1 where it is missing
//! use = "fit"               # or "validation": kept out of the fit; "fit" where it is missing
//! ```

mod columns;
mod driven;
mod error;
mod manifest;
mod read;
mod summary;

pub use columns::ColumnNames;
pub use driven::driven;
pub use error::TrialError;
pub use manifest::TrialSet;
pub use read::sha256;
pub use summary::{SATURATED, Summary, at_stop};

use pilotage_estimation::posed::data::filled;
use pilotage_series::{Column, Series};

/// One recorded flight to a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Short name, unique among the trials of a fit (the file's stem).
    pub name: String,
    /// The file it was read from, as given by the user.
    pub origin: String,
    /// SHA-256 of the file's bytes, in hexadecimal.
    pub sha256: String,
    /// Sample times \[s\], increasing; rows with equal times are replicates, or the target jumps there.
    pub time: Vec<f64>,
    /// Unit of the times in the file's header, from which they were converted; empty if there is none.
    pub time_unit: String,
    /// The target ŷ at each sample \[m\].
    pub target: Vec<f64>,
    /// The vehicle's position at each sample \[m\]; NaN where missing.
    pub position: Vec<f64>,
    /// The stick at each sample [-1, 1]; NaN where missing. `None` if it was not recorded.
    pub stick: Option<Vec<f64>>,
    /// Weight of this run's squared residuals in the objective.
    pub weight: f64,
    /// How the file was taken ([`Series::note`]).
    pub note: Option<String>,
}

impl Trial {
    /// The initial position: the first recorded one \[m\].
    pub fn origin(&self) -> f64 {
        let recorded = self.position.iter().find(|z| z.is_finite());
        recorded.copied().unwrap_or(0.0)
    }

    /// Largest distance of the target from the initial position \[m\].
    pub fn forcing(&self) -> f64 {
        let origin = self.origin();
        let ways = self.target.iter().map(|target| (target - origin).abs());
        ways.fold(0.0, f64::max)
    }

    /// Time from the first sample to the last \[s\].
    pub fn duration(&self) -> f64 {
        self.time[self.time.len() - 1] - self.time[0]
    }

    /// The positions, with missing samples by linear interpolation, constant at the ends.
    pub fn filled_position(&self) -> Vec<f64> {
        filled(&self.time, &self.position)
    }

    /// The flight as a time series, with these names of its columns and the units of [`Trial`].
    pub fn series(&self, names: &ColumnNames) -> Series {
        let column = |quantity: &str, unit: &str, values: &[f64]| Column {
            name: names.of(quantity).to_owned(),
            unit: unit.to_owned(),
            values: values.to_vec(),
        };
        let mut columns = vec![
            column("target", "m", &self.target),
            column("position", "m", &self.position),
        ];
        columns.extend((self.stick.iter()).map(|stick| column("stick", "1", stick)));
        Series {
            time: self.time.clone(),
            time_unit: self.time_unit.clone(),
            columns,
            note: self.note.clone(),
            ..Series::default()
        }
    }
}
