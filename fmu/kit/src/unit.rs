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
    pub display: Option<(String, f64)>,
}

/// Symbol, exponents of kilogram, metre, second and radian, factor to these.
type Symbol = (&'static str, [i32; 4], f64);

#[rustfmt::skip]
const SYMBOLS: [Symbol; 28] = [
    ("m", [0, 1, 0, 0], 1.0), ("km", [0, 1, 0, 0], 1e3), ("cm", [0, 1, 0, 0], 1e-2),
    ("mm", [0, 1, 0, 0], 1e-3), ("ft", [0, 1, 0, 0], 0.3048),
    ("kg", [1, 0, 0, 0], 1.0), ("g", [1, 0, 0, 0], 1e-3),
    ("s", [0, 0, 1, 0], 1.0), ("ms", [0, 0, 1, 0], 1e-3), ("us", [0, 0, 1, 0], 1e-6),
    ("min", [0, 0, 1, 0], 60.0), ("h", [0, 0, 1, 0], 3600.0), ("Hz", [0, 0, -1, 0], 1.0),
    ("rad", [0, 0, 0, 1], 1.0), ("mrad", [0, 0, 0, 1], 1e-3), ("krad", [0, 0, 0, 1], 1e3),
    ("deg", [0, 0, 0, 1], PI / 180.0), ("rev", [0, 0, 0, 1], 2.0 * PI),
    ("N", [1, 1, -2, 0], 1.0), ("kN", [1, 1, -2, 0], 1e3), ("lbf", [1, 1, -2, 0], 4.4482216152605),
    ("J", [1, 2, -2, 0], 1.0), ("kJ", [1, 2, -2, 0], 1e3), ("W", [1, 2, -3, 0], 1.0),
    ("kW", [1, 2, -3, 0], 1e3), ("Pa", [1, -1, -2, 0], 1.0), ("kPa", [1, -1, -2, 0], 1e3),
    ("bar", [1, -1, -2, 0], 1e5),
];

impl Unit {
    /// The unit of that name: symbols with exponents, dots between them, one `/`, brackets around more
    /// than one symbol after it.
    ///
    /// # Panics
    /// When it has another form or a symbol that is not known; the message lists those that are.
    pub fn of(name: &str) -> Self {
        Self::parse(name).unwrap_or_else(|| {
            let known: Vec<_> = SYMBOLS.iter().map(|(symbol, ..)| *symbol).collect();
            panic!(
                "unit \"{name}\" cannot be read; write it as in m/s2 or 1/(m.s), with the symbols {}",
                known.join(", ")
            )
        })
    }

    /// As [`of`](Self::of), `None` where that panics.
    pub fn parse(name: &str) -> Option<Self> {
        let factors = factors(name)?;
        let mut exponents = [0; 4];
        let mut factor = 1.0;
        for ((_, dimension, size), power) in &factors {
            for (sum, part) in exponents.iter_mut().zip(dimension) {
                *sum += part * power;
            }
            factor *= size.powi(*power);
        }
        let display = match name {
            "rad" => Some(("deg", 180.0 / PI)),
            "rad/s" => Some(("deg/s", 180.0 / PI)),
            "krad/s" => Some(("rpm", 1e3 * 60.0 / (2.0 * PI))),
            _ => None,
        };
        Some(Self {
            name: name.to_owned(),
            exponents,
            factor,
            display: display.map(|(name, factor)| (name.to_owned(), factor)),
        })
    }

    /// `1`, dimensionless.
    pub fn one() -> Self {
        Self::of("1")
    }

    /// `m`.
    pub fn metre() -> Self {
        Self::of("m")
    }

    /// `m/s`.
    pub fn metre_per_second() -> Self {
        Self::of("m/s")
    }

    /// `m/s2`.
    pub fn metre_per_second_squared() -> Self {
        Self::of("m/s2")
    }

    /// `kg`.
    pub fn kilogram() -> Self {
        Self::of("kg")
    }

    /// `kg.m2`.
    pub fn kilogram_metre_squared() -> Self {
        Self::of("kg.m2")
    }

    /// `rad`, read in degrees.
    pub fn radian() -> Self {
        Self::of("rad")
    }

    /// `rad/s`, read in degrees per second.
    pub fn radian_per_second() -> Self {
        Self::of("rad/s")
    }

    /// `krad/s`, read in revolutions per minute.
    pub fn kiloradian_per_second() -> Self {
        Self::of("krad/s")
    }

    /// `krad/(s2.us)`: rotor acceleration for each microsecond of throttle pulse.
    pub fn kiloradian_per_second_squared_microsecond() -> Self {
        Self::of("krad/(s2.us)")
    }

    /// `us/rad`: throttle pulse for each radian.
    pub fn microsecond_per_radian() -> Self {
        Self::of("us/rad")
    }

    /// `us.s/rad`: throttle pulse for each radian per second.
    pub fn microsecond_second_per_radian() -> Self {
        Self::of("us.s/rad")
    }

    /// `1/s`.
    pub fn reciprocal_second() -> Self {
        Self::per_second(1)
    }

    /// `1/s<k>`.
    pub fn per_second(k: usize) -> Self {
        Self::of(&format!("1/{}", power("s", k)))
    }

    /// `m.s<k>`.
    pub fn metre_second(k: usize) -> Self {
        Self::of(&format!("m.{}", power("s", k)))
    }

    /// `1/(m.s<k>)`.
    pub fn per_metre_second(k: usize) -> Self {
        Self::of(&format!("1/(m.{})", power("s", k)))
    }

    /// The unit of the time derivative: `m/s` of `m`, `m.s` of `m.s2`.
    pub fn rate(&self) -> Self {
        // Every name was parsed once, in `of`.
        let mut factors = factors(&self.name).unwrap_or_default();
        match factors.iter_mut().find(|((symbol, ..), _)| *symbol == "s") {
            Some((_, power)) => *power -= 1,
            None => factors.extend(product("s", -1).unwrap_or_default()),
        }
        let list = |sign: i32| -> Vec<String> {
            let those = factors.iter().filter(|(_, power)| power * sign > 0);
            those
                .map(|((symbol, ..), p)| power(symbol, p.unsigned_abs() as usize))
                .collect()
        };
        let (above, below) = (list(1), list(-1));
        let above = match above.is_empty() {
            true => "1".to_owned(),
            false => above.join("."),
        };
        Self::of(&match below.len() {
            0 => above,
            1 => format!("{above}/{}", below[0]),
            _ => format!("{above}/({})", below.join(".")),
        })
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

/// The symbols of a name with their exponents.
fn factors(name: &str) -> Option<Vec<(Symbol, i32)>> {
    let (above, below) = match name.split_once('/') {
        Some((above, below)) => (above, Some(below)),
        None => (name, None),
    };
    let mut factors = match above {
        "1" => Vec::new(),
        _ => product(above, 1)?,
    };
    if let Some(below) = below {
        let inside = below.strip_prefix('(').and_then(|b| b.strip_suffix(')'));
        match inside {
            Some(inside) => factors.extend(product(inside, -1)?),
            None if below.contains('.') => return None,
            None => factors.extend(product(below, -1)?),
        }
    }
    Some(factors)
}

fn product(text: &str, sign: i32) -> Option<Vec<(Symbol, i32)>> {
    text.split('.')
        .map(|part| {
            let end = part.find(|c: char| !c.is_ascii_alphabetic());
            let (name, exponent) = part.split_at(end.unwrap_or(part.len()));
            let symbol = SYMBOLS.iter().find(|(symbol, ..)| *symbol == name)?;
            let exponent: i32 = match exponent {
                "" => 1,
                digits => digits.parse().ok()?,
            };
            Some((*symbol, sign * exponent))
        })
        .collect()
}

fn power(base: &str, k: usize) -> String {
    match k {
        1 => base.to_owned(),
        _ => format!("{base}{k}"),
    }
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

    #[test]
    fn meaning_follows_from_the_name() {
        let of = |name| {
            let unit = Unit::of(name);
            (unit.exponents, unit.factor)
        };
        assert_eq!(of("1"), ([0; 4], 1.0));
        assert_eq!(of("krad/(s2.us)"), ([0, 0, -3, 1], 1e9));
        assert_eq!(of("us.s/rad"), ([0, 0, 2, -1], 1e-6));
        assert_eq!(of("N.m"), ([1, 2, -2, 0], 1.0));
        assert_eq!(of("km/h").0, [0, 1, -1, 0]);
        assert!((of("km/h").1 - 1.0 / 3.6).abs() < 1e-15);
        for wrong in ["", "m/s/s", "furlong", "m^2", "1/m.s", "m.", "m2x"] {
            assert!(Unit::parse(wrong).is_none(), "{wrong}");
        }
    }

    #[test]
    fn rates() {
        let names = ["1", "m", "m/s", "rad/s", "m.s", "m.s3", "1/s", "1/(m.s2)"];
        let rates = names.map(|name| Unit::of(name).rate().name);
        let expected = [
            "1/s", "m/s", "m/s2", "rad/s2", "m", "m.s2", "1/s2", "1/(m.s3)",
        ];
        assert_eq!(rates, expected);
    }
}
