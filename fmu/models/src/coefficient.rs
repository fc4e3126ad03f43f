//! The vehicle's coefficients as data: name, unit, range and meaning of each field of [`Quadcopter`].

use crate::quadcopter::N_COEFFICIENTS;
use crate::{Quadcopter, Unit};

/// One coefficient of the vehicle. Files, parameters of the FMU and their checks derive from it.
#[derive(Debug, Clone, Copy)]
pub struct Coefficient {
    /// Name, the field's.
    pub name: &'static str,
    /// Makes its unit.
    pub unit: fn() -> Unit,
    /// Least and greatest plausible value: wide, so as to catch a wrong unit or a slipped digit.
    pub range: (f64, f64),
    /// What it is.
    pub meaning: &'static str,
    /// Reads it.
    pub get: fn(&Quadcopter) -> f64,
    /// Sets it.
    pub set: fn(&mut Quadcopter, f64),
}

macro_rules! coefficient {
    ($name:ident, $unit:ident, $min:expr, $max:expr, $meaning:literal) => {
        Coefficient {
            name: stringify!($name),
            unit: Unit::$unit,
            range: ($min, $max),
            meaning: $meaning,
            get: |vehicle| vehicle.$name,
            set: |vehicle, value| vehicle.$name = value,
        }
    };
}

/// The coefficients, in the order of the fields of [`Quadcopter`].
#[rustfmt::skip]
pub const COEFFICIENTS: [Coefficient; N_COEFFICIENTS] = [
    coefficient!(mass, kilogram, 1e-3, 1e4, "mass m"),
    coefficient!(arm_length, metre, 1e-3, 100.0, "arm length ℓ, from the centre to a motor"),
    coefficient!(inertia, kilogram_metre_squared, 1e-9, 1e6, "pitch moment of inertia I_yy"),
    coefficient!(gravity, metre_per_second_squared, 0.1, 30.0, "gravitational acceleration g"),
    coefficient!(hover_speed, kiloradian_per_second, 1e-3, 10.0, "rotor speed at hover ω_0"),
    coefficient!(propeller_lag, reciprocal_second, 0.1, 1e3, "propeller lag a"),
    coefficient!(propeller_gain, kiloradian_per_second_squared_microsecond, 1e-6, 1e3,
        "propeller gain b, for each µs of throttle pulse"),
    coefficient!(attitude_gain, microsecond_per_radian, 0.0, 1e5, "attitude gain k_φ, positive"),
    coefficient!(rate_gain, microsecond_second_per_radian, 0.0, 1e5, "pitch-rate gain k_q, positive"),
    coefficient!(max_pitch, radian, 1e-3, std::f64::consts::FRAC_PI_2,
        "pitch angle that full stick commands, φ_max"),
];
