//! A flight as a recorder writes it.

use super::{Signal, Vehicle};
use pilotage_series::{Column, Series};

/// Resolution of a recording, as a power of ten, unless a small target requires a finer one: no recorder has sixteen
/// digits.
const RESOLUTION: i32 = -4;

/// Sampled values: for each sample one number per axis, or per other output of the vehicle.
#[derive(Debug, Default)]
pub struct Recording {
    pub positions: Vec<Vec<f64>>,
    pub sticks: Vec<Vec<f64>>,
    pub others: Vec<Vec<f64>>,
}

impl Recording {
    /// The table: target, position and stick of each axis, then the other outputs.
    pub fn series(&self, vehicle: &dyn Vehicle, targets: &[Signal], time: Vec<f64>) -> Series {
        let mut columns = Vec::new();
        for (axis, target) in targets.iter().enumerate() {
            let (unit, digits) = (vehicle.unit(axis), digits(target));
            let names = ["target", "position", "stick"].map(|name| match axis {
                0 => name.to_owned(),
                _ => format!("{name}{}", axis + 1),
            });
            let places = time.iter().map(|time| match target {
                Signal::Constant(place) => *place,
                moving => rounded(moving.at(*time).0, digits),
            });
            let [name, position, stick] = names;
            columns.push(column(name, unit, places.collect()));
            columns.push(column(position, unit, each(&self.positions, axis, digits)));
            columns.push(column(stick, "1", each(&self.sticks, axis, RESOLUTION)));
        }
        let finest = targets.iter().map(digits).min().unwrap_or(RESOLUTION);
        for (k, (name, unit)) in vehicle.others().into_iter().enumerate() {
            columns.push(column(name, &unit, each(&self.others, k, finest)));
        }
        Series {
            texts: Vec::new(),
            note: None,
            comments: Vec::new(),
            time_unit: "s".into(),
            time,
            columns,
        }
    }
}

fn column(name: String, unit: &str, values: Vec<f64>) -> Column {
    let unit = unit.into();
    Column { name, unit, values }
}

/// The `k`-th number of each sample, rounded.
fn each(samples: &[Vec<f64>], k: usize, digits: i32) -> Vec<f64> {
    samples
        .iter()
        .map(|sample| rounded(sample[k], digits))
        .collect()
}

/// Resolution of the values of a target, as a power of ten.
fn digits(target: &Signal) -> i32 {
    match target.size() {
        0.0 => RESOLUTION,
        size => (size.log10().floor() as i32 + RESOLUTION).min(RESOLUTION),
    }
}

/// `+ 0.0` turns -0 into 0.
fn rounded(value: f64, digits: i32) -> f64 {
    let scale = 10_f64.powi(-digits);
    (value * scale).round() / scale + 0.0
}
