//! What units mean that stand in a table's header: names as people and FMI (2.0.5, section 2.2.2) write
//! them, `m/s`, `kg.m2`, `1/(m.s3)`, `deg/s`, `ft/min`, `rad·s^-1`.

use super::slave::{Base, Unit};
use std::f64::consts::PI;

/// Exponents of kg, m, s, A, K, mol, cd, rad.
type Exponents = [i32; 8];

const ONE: Exponents = [0; 8];
const KILOGRAM: Exponents = [1, 0, 0, 0, 0, 0, 0, 0];
const METRE: Exponents = [0, 1, 0, 0, 0, 0, 0, 0];
const SECOND: Exponents = [0, 0, 1, 0, 0, 0, 0, 0];
const AMPERE: Exponents = [0, 0, 0, 1, 0, 0, 0, 0];
const KELVIN: Exponents = [0, 0, 0, 0, 1, 0, 0, 0];
const MOLE: Exponents = [0, 0, 0, 0, 0, 1, 0, 0];
const CANDELA: Exponents = [0, 0, 0, 0, 0, 0, 1, 0];
const RADIAN: Exponents = [0, 0, 0, 0, 0, 0, 0, 1];
const PER_SECOND: Exponents = [0, 0, -1, 0, 0, 0, 0, 0];
const METRE_PER_SECOND: Exponents = [0, 1, -1, 0, 0, 0, 0, 0];
const RADIAN_PER_SECOND: Exponents = [0, 0, -1, 0, 0, 0, 0, 1];
const NEWTON: Exponents = [1, 1, -2, 0, 0, 0, 0, 0];
const PASCAL: Exponents = [1, -1, -2, 0, 0, 0, 0, 0];
const JOULE: Exponents = [1, 2, -2, 0, 0, 0, 0, 0];
const WATT: Exponents = [1, 2, -3, 0, 0, 0, 0, 0];
const VOLT: Exponents = [1, 2, -3, -1, 0, 0, 0, 0];

/// Units that take the prefixes of [`PREFIXES`] (BIPM, "The International System of Units", 9th edition,
/// 2019).
const PREFIXED: &[(&str, f64, Exponents)] = &[
    ("g", 1e-3, KILOGRAM),
    ("m", 1.0, METRE),
    ("s", 1.0, SECOND),
    ("A", 1.0, AMPERE),
    ("K", 1.0, KELVIN),
    ("mol", 1.0, MOLE),
    ("cd", 1.0, CANDELA),
    ("rad", 1.0, RADIAN),
    ("Hz", 1.0, PER_SECOND),
    ("N", 1.0, NEWTON),
    ("Pa", 1.0, PASCAL),
    ("J", 1.0, JOULE),
    ("W", 1.0, WATT),
    ("V", 1.0, VOLT),
];

const PREFIXES: &[(&str, f64)] = &[
    ("n", 1e-9),
    ("u", 1e-6),
    ("µ", 1e-6),
    ("m", 1e-3),
    ("c", 1e-2),
    ("d", 1e-1),
    ("h", 1e2),
    ("k", 1e3),
    ("M", 1e6),
    ("G", 1e9),
];

/// Units without prefixes (BIPM as above; international foot, nautical mile and pound, NIST SP 811).
const PLAIN: &[(&str, f64, Exponents)] = &[
    ("1", 1.0, ONE),
    ("%", 0.01, ONE),
    ("deg", PI / 180.0, RADIAN),
    ("°", PI / 180.0, RADIAN),
    ("rev", 2.0 * PI, RADIAN),
    ("rpm", 2.0 * PI / 60.0, RADIAN_PER_SECOND),
    ("min", 60.0, SECOND),
    ("h", 3600.0, SECOND),
    ("ft", 0.3048, METRE),
    ("in", 0.0254, METRE),
    ("mi", 1609.344, METRE),
    ("NM", 1852.0, METRE),
    ("nmi", 1852.0, METRE),
    ("kn", 1852.0 / 3600.0, METRE_PER_SECOND),
    ("kt", 1852.0 / 3600.0, METRE_PER_SECOND),
    ("mph", 1609.344 / 3600.0, METRE_PER_SECOND),
    ("lb", 0.453_592_37, KILOGRAM),
    ("lbf", 0.453_592_37 * 9.806_65, NEWTON),
    ("slug", 0.453_592_37 * 9.806_65 / 0.3048, KILOGRAM),
    ("bar", 1e5, PASCAL),
];

/// Units whose zero is elsewhere; alone, never in a product.
const SHIFTED: &[(&str, f64, f64, Exponents)] = &[
    ("degC", 1.0, 273.15, KELVIN),
    ("°C", 1.0, 273.15, KELVIN),
    ("degF", 5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0, KELVIN),
];

impl Unit {
    /// The unit of that name, with its meaning where the name is one that we know.
    pub fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            base: meaning(name),
        }
    }
}

/// What a name means; `None` if it is not known.
fn meaning(name: &str) -> Option<Base> {
    let shifted = SHIFTED.iter().find(|(known, ..)| *known == name);
    if let Some(&(_, factor, offset, exponents)) = shifted {
        return Some(Base {
            exponents,
            factor,
            offset,
        });
    }
    let (above, below) = match name.split_once('/') {
        Some((above, below)) => (above, inside_parentheses(below)?),
        None => (name, "1"),
    };
    let (mut factor, mut exponents) = (1.0, ONE);
    for (product, sign) in [(above, 1), (below, -1)] {
        for part in product.split(['.', '·', '*']) {
            let (unit, power) = symbol_and_power(part.trim())?;
            let (unit_factor, unit_exponents) = symbol(unit)?;
            factor *= f64::powi(unit_factor, sign * power);
            for (sum, exponent) in exponents.iter_mut().zip(unit_exponents) {
                *sum += sign * power * exponent;
            }
        }
    }
    Some(Base {
        exponents,
        factor,
        offset: 0.0,
    })
}

/// What is below the stroke: one unit, or several in parentheses. Without them `a/b.c` could mean two
/// things.
fn inside_parentheses(text: &str) -> Option<&str> {
    let text = text.trim();
    match text.strip_prefix('(') {
        Some(rest) => rest.strip_suffix(')'),
        None => (!text.contains(['.', '·', '*', '/'])).then_some(text),
    }
}

/// `s2`, `s^2`, `s-2` and `s²` as a symbol and a power; no power is the first.
fn symbol_and_power(part: &str) -> Option<(&str, i32)> {
    let is_power = |c: char| c.is_ascii_digit() || c == '-' || c == '^' || "²³".contains(c);
    match part.find(is_power) {
        None | Some(0) => Some((part, 1)),
        Some(at) => {
            let (symbol, power) = part.split_at(at);
            let power = match power.trim_start_matches('^') {
                "²" => 2,
                "³" => 3,
                digits => digits.parse().ok().filter(|p: &i32| p.abs() <= 30)?,
            };
            Some((symbol, power))
        }
    }
}

/// Factor and exponents of one symbol, with or without prefix.
fn symbol(symbol: &str) -> Option<(f64, Exponents)> {
    let known = |list: &[(&str, f64, Exponents)], name: &str| {
        let found = list.iter().find(|(known, ..)| *known == name);
        found.map(|&(_, factor, exponents)| (factor, exponents))
    };
    let prefixed = || {
        PREFIXES.iter().find_map(|(prefix, scale)| {
            let (factor, exponents) = known(PREFIXED, symbol.strip_prefix(prefix)?)?;
            Some((scale * factor, exponents))
        })
    };
    known(PLAIN, symbol)
        .or_else(|| known(PREFIXED, symbol))
        .or_else(prefixed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The models' own units, which say by hand what their names mean.
    #[test]
    fn names_of_the_models_mean_what_the_models_say() {
        use pilotage_models::{Model, Quadcopter};
        let models = [
            Model::pilot(&[1.0; 8], 1.0),
            Model::quadcopter(&Quadcopter::default()),
        ];
        for variable in models.iter().flat_map(|model| model.variables()) {
            let unit = &variable.unit;
            let base = meaning(&unit.name).unwrap_or_else(|| panic!("{}", unit.name));
            let [kg, m, s, rad] = unit.exponents;
            assert_eq!(base.exponents, [kg, m, s, 0, 0, 0, 0, rad], "{}", unit.name);
            assert!(
                (base.factor / unit.factor - 1.0).abs() < 1e-15,
                "{}",
                unit.name
            );
        }
    }

    #[test]
    fn values_in_the_units_of_aviation() {
        for (from, to, value, expected) in [
            ("ft", "m", 100.0, 30.48),
            ("kn", "m/s", 1.0, 0.514_444_444_444_444_4),
            ("ft/min", "m/s", 196.850_393_700_787_4, 1.0),
            ("deg", "rad", 180.0, PI),
            ("deg/s", "rad/s", 90.0, PI / 2.0),
            ("rpm", "krad/s", 60.0, 2e-3 * PI),
            ("degC", "K", 15.0, 288.15),
            ("degF", "degC", 59.0, 15.0),
            ("kg.m2", "kg·m²", 3.0, 3.0),
            ("m.s-2", "m/s^2", 2.0, 2.0),
            ("%", "1", 50.0, 0.5),
            ("slug.ft2", "kg.m2", 1.0, 1.355_817_948_331_400_4),
            ("mm/ms", "m/s", 7.0, 7.0),
            ("1/(m.s3)", "1/(cm.s3)", 1.0, 0.01),
        ] {
            let conversion = Unit::named(from).conversion(&Unit::named(to)).unwrap();
            let found = conversion.apply(value);
            assert!(
                (found - expected).abs() <= 1e-12 * expected.abs(),
                "{value} {from} are {found} {to}, not {expected}"
            );
        }
    }

    #[test]
    fn names_that_mean_nothing_or_two_things_are_not_known() {
        for name in [
            "", "furlong", "m/s/s", "m/s.kg", "m^x", "m^99", "K/degC", "kft", "(m)",
        ] {
            assert_eq!(meaning(name), None, "{name}");
        }
        assert_eq!(Unit::named("m").conversion(&Unit::named("s")), None);
    }
}
