//! The vehicle file.

use crate::document::{self, Document, DocumentError};
use crate::models::Quadcopter;
use std::path::Path;

/// What can be wrong with a vehicle file.
#[derive(Debug, thiserror::Error)]
pub enum VehicleError {
    /// Not a TOML file with the fields of a vehicle.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A value that no such vehicle has.
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
        unit: &'static str,
        /// Least value.
        min: f64,
        /// Greatest value.
        max: f64,
        /// What the field is.
        meaning: &'static str,
    },
}

/// One coefficient of the vehicle: the file's fields, their checks and their comments derive from it.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    /// Name in the file.
    pub name: &'static str,
    /// Unit; the file's numbers are in it.
    pub unit: &'static str,
    /// Least and greatest plausible value: wide, so as to catch a wrong unit or a slipped digit.
    pub range: (f64, f64),
    /// What it is.
    pub meaning: &'static str,
    /// Reads it.
    pub get: fn(&Quadcopter) -> f64,
    set: fn(&mut Quadcopter, f64),
}

macro_rules! field {
    ($name:ident, $unit:literal, $min:expr, $max:expr, $meaning:literal) => {
        Field {
            name: stringify!($name),
            unit: $unit,
            range: ($min, $max),
            meaning: $meaning,
            get: |vehicle| vehicle.$name,
            set: |vehicle, value| vehicle.$name = value,
        }
    };
}

/// The fields of a vehicle file, in their order; all are required.
#[rustfmt::skip]
pub const FIELDS: [Field; 10] = [
    field!(mass, "kg", 1e-3, 1e4, "mass m"),
    field!(arm_length, "m", 1e-3, 100.0, "arm length ℓ, from the centre to a motor"),
    field!(inertia, "kg·m²", 1e-9, 1e6, "pitch moment of inertia I_yy"),
    field!(gravity, "m/s²", 0.1, 30.0, "gravitational acceleration g"),
    field!(hover_speed, "krad/s", 1e-3, 10.0, "rotor speed at hover ω_0"),
    field!(propeller_lag, "1/s", 0.1, 1e3, "propeller lag a"),
    field!(propeller_gain, "krad/s² per µs", 1e-6, 1e3, "propeller gain b, per µs of throttle pulse"),
    field!(attitude_gain, "µs/rad", 0.0, 1e5, "attitude gain k_φ, positive"),
    field!(rate_gain, "µs·s/rad", 0.0, 1e5, "pitch-rate gain k_q, positive"),
    field!(max_pitch, "rad", 1e-3, std::f64::consts::FRAC_PI_2, "pitch angle that full stick commands, φ_max"),
];

/// Reads a vehicle file.
///
/// # Errors
/// When the file cannot be read, a field is unknown, missing or out of its range.
pub fn read(path: &Path) -> Result<Quadcopter, VehicleError> {
    parse(&document::read(path)?, &path.display().to_string())
}

/// Parses the text of a vehicle file; `file` is its name in messages.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, file: &str) -> Result<Quadcopter, VehicleError> {
    let document = Document::parse(text, file)?;
    let table = document.root();
    table.only(&FIELDS.map(|field| field.name))?;
    let mut vehicle = Quadcopter::default();
    for field in &FIELDS {
        let value = table.required(field.name, table.number(field.name)?)?;
        let (min, max) = field.range;
        if !(min..=max).contains(&value) {
            return Err(VehicleError::Range {
                file: file.into(),
                line: table.line(field.name),
                field: field.name,
                value,
                unit: field.unit,
                min,
                max,
                meaning: field.meaning,
            });
        }
        (field.set)(&mut vehicle, value);
    }
    Ok(vehicle)
}

/// The vehicle as the text of a vehicle file, each field with unit and meaning beside it.
pub fn to_toml(vehicle: &Quadcopter) -> String {
    let mut text =
        String::from("# Pitch axis of a quadcopter: the coefficients and their units.\n");
    for field in &FIELDS {
        let assignment = format!("{} = {:?}", field.name, (field.get)(vehicle));
        text += &format!("{assignment:<36} # [{}] {}\n", field.unit, field.meaning);
    }
    text
}
