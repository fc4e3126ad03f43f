//! The vehicle's coefficients as data: name, unit, range and meaning of each field of [`Quadcopter`].

use crate::Quadcopter;
use crate::quadcopter::N_COEFFICIENTS;

/// One coefficient of the vehicle. Files, parameters of the FMU and their checks are derived from it.
#[derive(Debug, Clone, Copy)]
pub struct Coefficient {
    /// Name of the field.
    pub name: &'static str,
    /// Name of the unit.
    pub unit: &'static str,
    /// Smallest and largest plausible value: a wide range that catches a wrong unit or a misplaced decimal point.
    pub range: (f64, f64),
    /// Description.
    pub meaning: &'static str,
    /// Reads the coefficient.
    pub get: fn(&Quadcopter) -> f64,
    /// Sets the coefficient.
    pub set: fn(&mut Quadcopter, f64),
}

macro_rules! coefficient {
    ($name:ident, $unit:literal, $min:expr, $max:expr, $meaning:literal) => {
        Coefficient {
            name: stringify!($name),
            unit: $unit,
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
    coefficient!(mass, "kg", 1e-3, 1e4, "mass m"),
    coefficient!(arm_length, "m", 1e-3, 100.0, "arm length ℓ, from the centre to a motor"),
    coefficient!(inertia, "kg.m2", 1e-9, 1e6, "pitch moment of inertia I_yy"),
    coefficient!(gravity, "m/s2", 0.1, 30.0, "gravitational acceleration g"),
    coefficient!(hover_speed, "krad/s", 1e-3, 10.0, "rotor speed at hover ω_0"),
    coefficient!(propeller_lag, "1/s", 0.1, 1e3, "propeller lag a"),
    coefficient!(propeller_gain, "krad/(s2.us)", 1e-6, 1e3,
        "propeller gain b, for each µs of throttle pulse"),
    coefficient!(attitude_gain, "us/rad", 0.0, 1e5, "attitude gain k_φ, positive"),
    coefficient!(rate_gain, "us.s/rad", 0.0, 1e5, "pitch-rate gain k_q, positive"),
    coefficient!(max_pitch, "rad", 1e-3, std::f64::consts::FRAC_PI_2,
        "pitch angle that full stick commands, φ_max"),
];
