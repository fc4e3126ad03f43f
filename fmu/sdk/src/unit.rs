//! Units of the variables: their meaning and their preferred display.

use pilotage_units::{Base, Product};

/// A unit (FMI 2.0.5, section 2.2.2).
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Name in Modelica's spelling: `m/s`, `kg.m2`, `1/(m.s3)`; `1` for dimensionless.
    pub name: String,
    /// Meaning of the unit.
    pub base: Base,
    /// Preferred unit for display: name, and factor from this unit.
    pub display: Option<(String, f64)>,
}

/// Units that are displayed in another unit.
const DISPLAYED: [(&str, &str); 3] = [("rad", "deg"), ("rad/s", "deg/s"), ("krad/s", "rpm")];

impl Unit {
    /// The unit with that name: symbols with exponents, separated by dots, at most one `/`, and brackets around a
    /// denominator of more than one symbol.
    ///
    /// # Panics
    /// If the name has another form or an unknown symbol; the message lists the known symbols.
    pub fn of(name: &str) -> Self {
        Self::parse(name).unwrap_or_else(|| {
            panic!(
                "unit \"{name}\" cannot be read; write it as in m/s2 or 1/(m.s), with the symbols {}",
                Product::known()
            )
        })
    }

    /// As [`of`](Self::of), but `None` instead of a panic.
    pub fn parse(name: &str) -> Option<Self> {
        if name.is_empty() {
            return Some(Self::none());
        }
        let Some(base) = Base::in_modelicas_spelling(name) else {
            return name.strip_suffix("/s").and_then(Self::rate_of_temperature);
        };
        let display = || {
            let (_, display) = DISPLAYED.iter().find(|(unit, _)| *unit == name)?;
            let factor = base.factor / Base::of(display)?.factor;
            Some((display.to_string(), factor))
        };
        Some(Self {
            name: name.to_owned(),
            base,
            display: display(),
        })
    }

    /// No unit, for variables without a declared one. Its name is empty.
    pub fn none() -> Self {
        Self {
            name: String::new(),
            base: Base::default(),
            display: None,
        }
    }

    /// Whether there is a unit.
    pub fn is_some(&self) -> bool {
        !self.name.is_empty()
    }

    /// The unit of the time derivative: `m/s` of `m`, `m.s` of `m.s2`.
    pub fn rate(&self) -> Self {
        if !self.is_some() {
            return Self::none();
        }
        // Every name was parsed before, in `of`; one that is not a product is a temperature in degrees.
        match Product::parse(&self.name) {
            Some(product) => Self::of(&product.rate().to_string()),
            None => Self::rate_of_temperature(&self.name).expect("a temperature in degrees"),
        }
    }

    /// `degC/s` of `degC`, which is no product; `None` for a unit without an offset.
    fn rate_of_temperature(name: &str) -> Option<Self> {
        let mut base = Base::in_modelicas_spelling(name).filter(|base| base.offset != 0.0)?;
        base.offset = 0.0;
        base.exponents[2] -= 1;
        Some(Self {
            name: format!("{name}/s"),
            base,
            display: None,
        })
    }

    /// The name as it is printed: `kg·m²`, `µs/rad`; empty for dimensionless.
    pub fn symbol(&self) -> String {
        pilotage_units::pretty(&self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_symbols() {
        for (name, symbol) in [
            ("1", ""),
            ("1/s", "1/s"),
            ("1/s3", "1/s³"),
            ("1/(m.s12)", "1/(m·s¹²)"),
            ("kg.m2", "kg·m²"),
            ("us.s/rad", "µs·s/rad"),
            ("krad/(s2.us)", "krad/(s²·µs)"),
        ] {
            assert_eq!(Unit::of(name).symbol(), symbol);
        }
    }

    #[test]
    fn meaning_follows_from_the_name() {
        let of = |name| {
            let base = Unit::of(name).base;
            let [kg, m, s, .., rad] = base.exponents;
            ([kg, m, s, rad], base.factor)
        };
        assert_eq!(of("1"), ([0; 4], 1.0));
        assert_eq!(of("krad/(s2.us)"), ([0, 0, -3, 1], 1e9));
        assert_eq!(of("us.s/rad"), ([0, 0, 2, -1], 1e-6));
        assert_eq!(of("N.m"), ([1, 2, -2, 0], 1.0));
        assert_eq!(of("km/h").0, [0, 1, -1, 0]);
        assert!((of("km/h").1 - 1.0 / 3.6).abs() < 1e-15);
        for wrong in ["m/s/s", "furlong", "m^2", "m·s", "1/m.s", "m.", "m2x", "°"] {
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
        // What a library says of a rate is read again by `pack`.
        for name in ["degC", "degF"] {
            let rate = Unit::of(name).rate();
            assert_eq!(Unit::parse(&rate.name), Some(rate));
        }
        let factor = Unit::of("degF/s").base.factor;
        assert!((factor - 5.0 / 9.0).abs() < 1e-15, "{factor}");
        assert_eq!(Unit::parse("km/h/s"), None);
    }

    #[test]
    fn angles_are_shown_in_degrees_and_rotors_in_revolutions() {
        let shown = |name| Unit::of(name).display.unwrap();
        for (name, display, factor) in [
            ("rad", "deg", 57.295_779_513_082_32),
            ("rad/s", "deg/s", 57.295_779_513_082_32),
            ("krad/s", "rpm", 9_549.296_585_513_72),
        ] {
            let (found, by) = shown(name);
            assert_eq!(found, display);
            assert!((by / factor - 1.0).abs() < 1e-15, "{name}: {by}");
        }
        assert_eq!(Unit::of("m").display, None);
    }
}
