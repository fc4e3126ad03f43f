//! Curves that are drawn over a map, such as a flight manual's.

use crate::cli::Failure;
use crate::series::Rows;
use pilotage_units::Unit;
use std::path::{Path, PathBuf};

/// A curve.
pub struct Curve {
    /// Its name in the legend: that of the file.
    pub name: String,
    /// Speeds \[m/s\] and heights \[m\], in the order of the file.
    pub points: Vec<[f64; 2]>,
}

/// Reads curves: CSV with the columns `speed [UNIT]` and `height [UNIT]`.
pub fn read(files: &[PathBuf]) -> Result<Vec<Curve>, Failure> {
    files.iter().map(|own| one(own)).collect()
}

fn one(path: &Path) -> Result<Curve, Failure> {
    let file = path.display().to_string();
    let bytes = crate::file::bytes(path);
    let bytes = bytes.map_err(|error| Failure::new(format!("cannot read {file}: {error}")))?;
    let mut rows = Rows::new(&bytes[..], &file)?;
    let fault = |line: usize, words: String| Failure::new(format!("{file}, line {line}: {words}"));
    let mut columns = Vec::new();
    if rows.advance()? {
        for (name, unit) in [("speed", "m/s"), ("height", "m")] {
            let found = rows
                .cells()
                .position(|own| own.split('[').next().map(str::trim) == Some(name));
            let place = found.ok_or_else(|| {
                fault(rows.line(), format!("no column `{name}`"))
                    .hint("the header is `speed [kn],height [ft]`, in any units")
            })?;
            let given = rows
                .cell(place)
                .split_once('[')
                .map_or(unit, |(_, own)| own.trim_end_matches(']').trim());
            let conversion = Unit::named(given).conversion(&Unit::named(unit));
            columns.push((
                place,
                name,
                conversion.ok_or_else(|| {
                    fault(rows.line(), format!("`{given}` is no unit of a {name}"))
                })?,
            ));
        }
    }
    let mut points = Vec::new();
    while rows.advance()? {
        let mut point = [0.0; 2];
        for (own, (place, name, conversion)) in point.iter_mut().zip(&columns) {
            let cell = if *place < rows.count() {
                rows.cell(*place)
            } else {
                ""
            };
            let value = cell.parse().ok().map(|value: f64| conversion.apply(value));
            let value = value.filter(|value| value.is_finite() && *value >= 0.0);
            *own = value.ok_or_else(|| {
                fault(
                    rows.line(),
                    format!("the {name} is `{cell}`; expected a number, 0 or more"),
                )
            })?;
        }
        points.push(point);
    }
    if points.is_empty() {
        return Err(Failure::new(format!("{file} has no points")));
    }
    let name = path
        .file_stem()
        .map_or_else(|| file.clone(), |own| own.to_string_lossy().into());
    Ok(Curve { name, points })
}
