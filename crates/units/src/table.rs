//! Table of unit symbols and prefixes.

use super::Base;
use std::f64::consts::PI;

/// Exponents of the base units: kg, m, s, A, K, mol, cd, rad.
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
const OHM: Exponents = [1, 2, -3, -2, 0, 0, 0, 0];
const SIEMENS: Exponents = [-1, -2, 3, 2, 0, 0, 0, 0];
const COULOMB: Exponents = [0, 0, 1, 1, 0, 0, 0, 0];
const FARAD: Exponents = [-1, -2, 4, 2, 0, 0, 0, 0];
const HENRY: Exponents = [1, 2, -2, -2, 0, 0, 0, 0];
const WEBER: Exponents = [1, 2, -2, -1, 0, 0, 0, 0];
const TESLA: Exponents = [1, 0, -2, -1, 0, 0, 0, 0];
const CUBIC_METRE: Exponents = [0, 3, 0, 0, 0, 0, 0, 0];

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
    ("Ohm", 1.0, OHM),
    ("S", 1.0, SIEMENS),
    ("C", 1.0, COULOMB),
    ("F", 1.0, FARAD),
    ("H", 1.0, HENRY),
    ("Wb", 1.0, WEBER),
    ("T", 1.0, TESLA),
    ("l", 1e-3, CUBIC_METRE),
    ("L", 1e-3, CUBIC_METRE),
    ("bar", 1e5, PASCAL),
];

const PREFIXES: &[(&str, f64)] = &[
    ("p", 1e-12),
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
    ("T", 1e12),
];

/// Units without prefixes (BIPM as above; international foot, nautical mile and pound, gallon of the USA, horsepower of
/// 550 ft.lbf/s and conventional millimetre and inch of mercury, NIST SP 811, appendix B).
const PLAIN: &[(&str, f64, Exponents)] = &[
    ("1", 1.0, ONE),
    ("%", 0.01, ONE),
    ("deg", PI / 180.0, RADIAN),
    ("°", PI / 180.0, RADIAN),
    ("rev", 2.0 * PI, RADIAN),
    ("rpm", 2.0 * PI / 60.0, RADIAN_PER_SECOND),
    ("min", 60.0, SECOND),
    ("h", 3600.0, SECOND),
    ("d", 86_400.0, SECOND),
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
    ("t", 1000.0, KILOGRAM),
    ("kgf", 9.806_65, NEWTON),
    ("yd", 0.9144, METRE),
    ("gal", 231.0 * 0.0254 * 0.0254 * 0.0254, CUBIC_METRE),
    ("hp", 550.0 * 0.3048 * 0.453_592_37 * 9.806_65, WATT),
    ("psi", 0.453_592_37 * 9.806_65 / (0.0254 * 0.0254), PASCAL),
    ("atm", 101_325.0, PASCAL),
    ("mmHg", 133.322_4, PASCAL),
    ("inHg", 3386.389, PASCAL),
];

/// Units with a shifted zero; they stand alone, never in a product.
const SHIFTED: &[(&str, f64, f64, Exponents)] = &[
    ("degC", 1.0, 273.15, KELVIN),
    ("°C", 1.0, 273.15, KELVIN),
    ("degF", 5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0, KELVIN),
    ("°F", 5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0, KELVIN),
];

/// The unit of that name with a shifted zero.
pub(super) fn shifted(name: &str) -> Option<Base> {
    let (_, factor, offset, exponents) = *SHIFTED.iter().find(|(known, ..)| *known == name)?;
    Some(Base {
        exponents,
        factor,
        offset,
    })
}

/// The unit of one symbol, with or without prefix.
pub(super) fn symbol(symbol: &str) -> Option<Base> {
    let known = |list: &[(&str, f64, Exponents)], name: &str| {
        let (_, factor, exponents) = *list.iter().find(|(known, ..)| *known == name)?;
        Some((factor, exponents))
    };
    let prefixed = || {
        PREFIXES.iter().find_map(|(prefix, scale)| {
            let (factor, exponents) = known(PREFIXED, symbol.strip_prefix(prefix)?)?;
            Some((scale * factor, exponents))
        })
    };
    let (factor, exponents) = known(PLAIN, symbol)
        .or_else(|| known(PREFIXED, symbol))
        .or_else(prefixed)?;
    Some(Base {
        exponents,
        factor,
        offset: 0.0,
    })
}

/// The symbols in Modelica's spelling, for messages: prefixable symbols, prefixes, other symbols.
pub(super) fn symbols() -> [Vec<&'static str>; 3] {
    let names =
        |list: &'static [(&'static str, f64, Exponents)]| list.iter().map(|(name, ..)| *name);
    let shifted = SHIFTED.iter().map(|(name, ..)| *name);
    let prefixes = PREFIXES.iter().map(|(prefix, _)| *prefix);
    [
        names(PREFIXED).filter(|name| name.is_ascii()).collect(),
        prefixes.filter(|prefix| prefix.is_ascii()).collect(),
        (names(PLAIN).chain(shifted))
            .filter(|name| name.chars().all(|c| c.is_ascii_alphanumeric()))
            .collect(),
    ]
}
