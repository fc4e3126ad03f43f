//! Units by name: the meaning of `m/s`, `kg.m2`, `1/(m.s3)`, `deg/s`, `ft/min` or `rad·s^-1`, and the conversion of
//! values between units.
//!
//! ```
//! use pilotage_units::Unit;
//!
//! let conversion = Unit::named("km/h").conversion(&Unit::named("m/s")).expect("both are speeds");
//! assert!((conversion.apply(36.0) - 10.0).abs() < 1e-14);
//! assert!(Unit::named("kg").conversion(&Unit::named("s")).is_none());
//! ```
//!
//! | module | what it holds |
//! | --- | --- |
//! | `table` | symbols and prefixes: the only place that lists them |
//! | [`product`] | names as products of symbols, read and written |

pub mod product;
mod table;

pub use product::{Product, power};

/// The base units: those of the SI and the radian, as in FMI (2.0.5, section 2.2.2).
pub const BASE_UNITS: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];

/// The meaning of a unit: `value in base units = factor·value + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Base {
    /// Exponents of [`BASE_UNITS`].
    pub exponents: [i32; 8],
    /// Factor to the base units.
    pub factor: f64,
    /// Offset to the base units.
    pub offset: f64,
}

impl Default for Base {
    /// The dimensionless unit 1.
    fn default() -> Self {
        Self {
            exponents: [0; 8],
            factor: 1.0,
            offset: 0.0,
        }
    }
}

impl Base {
    /// The meaning of a unit name; `None` if it is unknown.
    pub fn of(name: &str) -> Option<Self> {
        match table::shifted(name) {
            Some(base) => Some(base),
            None => Product::parse(name).map(|product| product.base()),
        }
    }

    /// As [`Base::of`], but only for Modelica's spelling, as in FMU model descriptions: no `·`, `²`, `^` or `%`.
    pub fn in_modelicas_spelling(name: &str) -> Option<Self> {
        let is_modelicas = |c: char| c.is_ascii_alphanumeric() || "./()-".contains(c);
        match name.chars().all(is_modelicas) {
            true => Self::of(name),
            false => None,
        }
    }
}

/// Common spellings of units, and the units they mean.
const SPELT: &[(&str, &str)] = &[
    ("sec", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("msec", "ms"),
    ("mins", "min"),
    ("minute", "min"),
    ("minutes", "min"),
    ("hr", "h"),
    ("hour", "h"),
    ("hours", "h"),
    ("day", "d"),
    ("days", "d"),
    ("meter", "m"),
    ("meters", "m"),
    ("metre", "m"),
    ("metres", "m"),
    ("feet", "ft"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("ohm", "Ohm"),
    ("Ω", "Ohm"),
    ("lbs", "lb"),
    ("Nm", "N.m"),
    ("Ah", "A.h"),
    ("kWh", "kW.h"),
    ("kph", "km/h"),
    ("kmh", "km/h"),
    ("mps", "m/s"),
    ("knots", "kn"),
    ("-", "1"),
];

/// Modelica's spelling of a unit that is written otherwise: `m/s2` for `m/s^2`, `h` for `hours`.
pub fn respelt(name: &str) -> Option<String> {
    let known = SPELT.iter().find(|(own, _)| *own == name);
    let meant = known.map_or(name, |(_, meant)| meant);
    let product = Product::parse(meant).map(|product| product.to_string());
    let found = product.unwrap_or_else(|| meant.to_owned());
    let is_other = found != name && Base::in_modelicas_spelling(&found).is_some();
    is_other.then_some(found)
}

/// A unit: its name and, if known, its meaning.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Name, for example `m/s`.
    pub name: String,
    /// Meaning.
    pub base: Option<Base>,
}

/// Conversion of values from one unit to another: `factor·value + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conversion {
    /// Factor.
    pub factor: f64,
    /// Offset, in the second unit.
    pub offset: f64,
}

impl Conversion {
    /// Conversion between equal units.
    pub const NONE: Self = Self {
        factor: 1.0,
        offset: 0.0,
    };

    /// This conversion, and another one of its values.
    pub fn then(self, next: Self) -> Self {
        match (self == Self::NONE, next == Self::NONE) {
            (true, _) => next,
            (_, true) => self,
            _ => Self {
                factor: next.factor * self.factor,
                offset: next.factor * self.offset + next.offset,
            },
        }
    }

    /// The value in the second unit; the same bits if the units are equal.
    pub fn apply(self, value: f64) -> f64 {
        match self == Self::NONE {
            true => value,
            false => self.factor * value + self.offset,
        }
    }
}

impl Unit {
    /// The unit of that name, with its meaning if the name is known.
    pub fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            base: Base::of(name),
        }
    }

    /// Conversion of values in this unit to values in `other` (FMI 2.0.5, section 2.2.2). `None` if the dimensions
    /// differ, or if a definition is missing and the names differ.
    pub fn conversion(&self, other: &Self) -> Option<Conversion> {
        match (&self.base, &other.base) {
            (Some(from), Some(to)) if from.exponents == to.exponents => Some(match from == to {
                true => Conversion::NONE,
                false => Conversion {
                    factor: from.factor / to.factor,
                    offset: (from.offset - to.offset) / to.factor,
                },
            }),
            (Some(_), Some(_)) => None,
            _ => (self.name == other.name).then_some(Conversion::NONE),
        }
    }
}

/// A unit name for display: `kg·m²`, `µs/rad`; empty if dimensionless.
pub fn pretty(name: &str) -> String {
    if name == "1" {
        return String::new();
    }
    let mut shown = String::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let letters = rest
            .find(|c: char| !c.is_alphabetic())
            .unwrap_or(rest.len());
        let (symbol, after) = rest.split_at(letters);
        match symbol.strip_prefix('u') {
            Some(prefixed) if table::symbol(symbol).is_some() => shown.extend(["µ", prefixed]),
            _ => shown.push_str(symbol),
        }
        rest = after;
        if letters > 0 {
            let digits = rest
                .find(|c: char| !c.is_ascii_digit())
                .unwrap_or(rest.len());
            let (power, after) = rest.split_at(digits);
            let superscript = |c: char| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(c.to_digit(10)? as usize);
            shown.extend(power.chars().filter_map(superscript));
            rest = after;
        } else {
            shown.push(if first == '.' { '·' } else { first });
            rest = &rest[first.len_utf8()..];
        }
    }
    shown
}
