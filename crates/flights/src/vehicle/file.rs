//! The vehicle file.

use pilotage_models::{COEFFICIENTS, Quadcopter};
use pilotage_text::document::{self, Document, DocumentError, TomlTable};
use std::path::Path;

/// Errors of a vehicle file.
#[derive(Debug, thiserror::Error)]
pub enum VehicleError {
    /// Not a TOML file with the fields of a vehicle.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A value is out of range.
    #[error(
        "{file}:{line}: {field} = {value} {unit} is out of range; expected {min} to {max} {unit} ({meaning})"
    )]
    Range {
        /// The file.
        file: String,
        /// Line of the value.
        line: usize,
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: String,
        /// Minimum value.
        min: f64,
        /// Maximum value.
        max: f64,
        /// Meaning of the field.
        meaning: &'static str,
    },
}

/// Reads a vehicle file.
///
/// # Errors
/// If the file cannot be read, or a field is unknown, missing or out of range.
pub fn read(path: &Path) -> Result<Quadcopter, VehicleError> {
    parse(&document::read(path)?, &path.display().to_string())
}

/// Parses the text of a vehicle file; `file` is its name in messages.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, file: &str) -> Result<Quadcopter, VehicleError> {
    of_table(&Document::parse(text, file)?.root())
}

/// Reads the vehicle from a table that contains only its coefficients.
///
/// # Errors
/// As [`read`].
pub fn of_table(table: &TomlTable) -> Result<Quadcopter, VehicleError> {
    table.only(&COEFFICIENTS.map(|coefficient| coefficient.name))?;
    let mut vehicle = Quadcopter::default();
    for field in &COEFFICIENTS {
        let unit = pilotage_units::pretty(field.unit);
        let value = table.required(field.name, table.number(field.name)?)?;
        let (min, max) = field.range;
        if !(min..=max).contains(&value) {
            return Err(VehicleError::Range {
                file: table.file().into(),
                line: table.line(field.name),
                field: field.name,
                value,
                unit,
                min,
                max,
                meaning: field.meaning,
            });
        }
        (field.set)(&mut vehicle, value);
    }
    Ok(vehicle)
}

/// Text of a vehicle file, with unit and meaning of each field.
pub fn to_toml(vehicle: &Quadcopter) -> String {
    let mut text =
        String::from("# Pitch axis of a quadcopter: the coefficients and their units.\n");
    for field in &COEFFICIENTS {
        let unit = pilotage_units::pretty(field.unit);
        let assignment = format!("{} = {:?}", field.name, (field.get)(vehicle));
        text += &format!("{assignment:<36} # [{}] {}\n", unit, field.meaning);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 256,
            rng_seed: proptest::test_runner::RngSeed::Fixed(8),
            ..ProptestConfig::default()
        })]
        /// Values anywhere in the ranges, including their ends.
        #[test]
        fn a_vehicle_that_is_written_is_read_again_to_the_same_bits(
            parts in prop::array::uniform10(prop_oneof![Just(0.0), Just(1.0), 0.0..1.0]),
        ) {
            let mut vehicle = Quadcopter::default();
            for (field, part) in COEFFICIENTS.iter().zip(parts) {
                let (min, max) = field.range;
                (field.set)(&mut vehicle, if part == 1.0 { max } else { min + part * (max - min) });
            }
            prop_assert_eq!(parse(&to_toml(&vehicle), "v.toml").unwrap(), vehicle);
        }
    }
}
