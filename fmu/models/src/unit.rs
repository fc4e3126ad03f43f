//! Units of the variables: names in FMI's spelling (`kg.m2`), and what they mean in SI and radian.

use std::f64::consts::PI;

/// A unit, `value in base units = factor · value` (FMI 2.0.5, section 2.2.2).
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Name in Modelica's spelling: `m/s`, `kg.m2`, `1/(m.s3)`; `1` for dimensionless.
    pub name: String,
    /// Exponents of kilogram, metre, second and radian.
    pub exponents: [i32; 4],
    /// Factor from this unit to the base units.
    pub factor: f64,
    /// A unit in which people prefer to read it: name, and factor from this unit.
    pub display: Option<(&'static str, f64)>,
}

impl Unit {
    fn new(name: impl Into<String>, exponents: [i32; 4], factor: f64) -> Self {
        Self {
            name: name.into(),
            exponents,
            factor,
            display: None,
        }
    }

    fn shown_in(mut self, name: &'static str, factor: f64) -> Self {
        self.display = Some((name, factor));
        self
    }

    /// `1`, dimensionless.
    pub fn one() -> Self {
        Self::new("1", [0; 4], 1.0)
    }

    /// `m`.
    pub fn metre() -> Self {
        Self::new("m", [0, 1, 0, 0], 1.0)
    }

    /// `m/s`.
    pub fn metre_per_second() -> Self {
        Self::new("m/s", [0, 1, -1, 0], 1.0)
    }

    /// `m/s2`.
    pub fn metre_per_second_squared() -> Self {
        Self::new("m/s2", [0, 1, -2, 0], 1.0)
    }

    /// `kg`.
    pub fn kilogram() -> Self {
        Self::new("kg", [1, 0, 0, 0], 1.0)
    }

    /// `kg.m2`.
    pub fn kilogram_metre_squared() -> Self {
        Self::new("kg.m2", [1, 2, 0, 0], 1.0)
    }

    /// `rad`, read in degrees.
    pub fn radian() -> Self {
        Self::new("rad", [0, 0, 0, 1], 1.0).shown_in("deg", 180.0 / PI)
    }

    /// `rad/s`, read in degrees per second.
    pub fn radian_per_second() -> Self {
        Self::new("rad/s", [0, 0, -1, 1], 1.0).shown_in("deg/s", 180.0 / PI)
    }

    /// `krad/s`, read in revolutions per minute.
    pub fn kiloradian_per_second() -> Self {
        Self::new("krad/s", [0, 0, -1, 1], 1e3).shown_in("rpm", 1e3 * 60.0 / (2.0 * PI))
    }

    /// `krad/(s2.us)`: rotor acceleration for each microsecond of throttle pulse.
    pub fn kiloradian_per_second_squared_microsecond() -> Self {
        Self::new("krad/(s2.us)", [0, 0, -3, 1], 1e9)
    }

    /// `us/rad`: throttle pulse for each radian.
    pub fn microsecond_per_radian() -> Self {
        Self::new("us/rad", [0, 0, 1, -1], 1e-6)
    }

    /// `us.s/rad`: throttle pulse for each radian per second.
    pub fn microsecond_second_per_radian() -> Self {
        Self::new("us.s/rad", [0, 0, 2, -1], 1e-6)
    }

    /// `1/s`.
    pub fn reciprocal_second() -> Self {
        Self::per_second(1)
    }

    /// `1/s<k>`.
    pub fn per_second(k: usize) -> Self {
        Self::new(format!("1/{}", power("s", k)), [0, 0, -exponent(k), 0], 1.0)
    }

    /// `m.s<k>`.
    pub fn metre_second(k: usize) -> Self {
        Self::new(format!("m.{}", power("s", k)), [0, 1, exponent(k), 0], 1.0)
    }

    /// `1/(m.s<k>)`.
    pub fn per_metre_second(k: usize) -> Self {
        let name = format!("1/(m.{})", power("s", k));
        Self::new(name, [0, -1, -exponent(k), 0], 1.0)
    }

    /// The name as people write it: `kg·m²`, `µs/rad`; empty for dimensionless.
    pub fn symbol(&self) -> String {
        if self.name == "1" {
            return String::new();
        }
        let mut previous = ' ';
        let superscript = |c: char| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(c.to_digit(10)? as usize);
        self.name
            .replace("us", "µs")
            .chars()
            .map(|c| {
                let after_letter = previous.is_alphabetic() || "⁰¹²³⁴⁵⁶⁷⁸⁹".contains(previous);
                previous = match c {
                    '.' => '·',
                    _ if after_letter => superscript(c).unwrap_or(c),
                    _ => c,
                };
                previous
            })
            .collect()
    }
}

fn power(base: &str, k: usize) -> String {
    match k {
        1 => base.to_owned(),
        _ => format!("{base}{k}"),
    }
}

fn exponent(k: usize) -> i32 {
    i32::try_from(k).unwrap_or(i32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_symbols() {
        let symbols = [
            Unit::one(),
            Unit::per_second(1),
            Unit::per_second(3),
            Unit::per_metre_second(12),
            Unit::kilogram_metre_squared(),
            Unit::microsecond_second_per_radian(),
            Unit::kiloradian_per_second_squared_microsecond(),
        ]
        .map(|unit| unit.symbol());
        assert_eq!(
            symbols,
            [
                "",
                "1/s",
                "1/s³",
                "1/(m·s¹²)",
                "kg·m²",
                "µs·s/rad",
                "krad/(s²·µs)"
            ]
        );
    }
}
