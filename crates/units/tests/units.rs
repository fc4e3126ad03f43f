//! Names read and written, and factors against a table of its own.

use pilotage_units::{BASE_UNITS, Base, Product, Unit, respelt};
use proptest::prelude::*;

/// What the names mean, digit by digit from the sources: BIPM, "The International System of Units", 9th edition,
/// 2019, tables 4, 5, 7 and 8; NIST SP 811 (2008), appendix B.8; powers of kg, m, s, A, K, rad.
#[rustfmt::skip]
#[expect(clippy::approx_constant, reason = "digits of the sources, not of the standard library")]
const MEANINGS: &[(&str, f64, [i32; 6])] = &[
    ("1", 1.0, [0; 6]), ("%", 0.01, [0; 6]),
    ("kg", 1.0, [1, 0, 0, 0, 0, 0]), ("g", 0.001, [1, 0, 0, 0, 0, 0]), ("mg", 0.000_001, [1, 0, 0, 0, 0, 0]),
    ("lb", 0.453_592_37, [1, 0, 0, 0, 0, 0]), ("slug", 14.593_902_937, [1, 0, 0, 0, 0, 0]),
    ("m", 1.0, [0, 1, 0, 0, 0, 0]), ("km", 1000.0, [0, 1, 0, 0, 0, 0]), ("dm", 0.1, [0, 1, 0, 0, 0, 0]),
    ("cm", 0.01, [0, 1, 0, 0, 0, 0]), ("mm", 0.001, [0, 1, 0, 0, 0, 0]), ("nm", 0.000_000_001, [0, 1, 0, 0, 0, 0]),
    ("ft", 0.3048, [0, 1, 0, 0, 0, 0]), ("in", 0.0254, [0, 1, 0, 0, 0, 0]), ("mi", 1609.344, [0, 1, 0, 0, 0, 0]),
    ("NM", 1852.0, [0, 1, 0, 0, 0, 0]), ("nmi", 1852.0, [0, 1, 0, 0, 0, 0]),
    ("s", 1.0, [0, 0, 1, 0, 0, 0]), ("ms", 0.001, [0, 0, 1, 0, 0, 0]), ("us", 0.000_001, [0, 0, 1, 0, 0, 0]),
    ("µs", 0.000_001, [0, 0, 1, 0, 0, 0]), ("ns", 0.000_000_001, [0, 0, 1, 0, 0, 0]),
    ("min", 60.0, [0, 0, 1, 0, 0, 0]), ("h", 3600.0, [0, 0, 1, 0, 0, 0]),
    ("d", 86_400.0, [0, 0, 1, 0, 0, 0]),
    ("Hz", 1.0, [0, 0, -1, 0, 0, 0]), ("kHz", 1000.0, [0, 0, -1, 0, 0, 0]), ("GHz", 1_000_000_000.0, [0, 0, -1, 0, 0, 0]),
    ("rad", 1.0, [0, 0, 0, 0, 0, 1]), ("mrad", 0.001, [0, 0, 0, 0, 0, 1]), ("krad", 1000.0, [0, 0, 0, 0, 0, 1]),
    ("deg", 0.017_453_292_519_943_295, [0, 0, 0, 0, 0, 1]), ("°", 0.017_453_292_519_943_295, [0, 0, 0, 0, 0, 1]),
    ("rev", 6.283_185_307_179_586, [0, 0, 0, 0, 0, 1]), ("rpm", 0.104_719_755_119_659_77, [0, 0, -1, 0, 0, 1]),
    ("kn", 0.514_444_444_444_444_4, [0, 1, -1, 0, 0, 0]), ("kt", 0.514_444_444_444_444_4, [0, 1, -1, 0, 0, 0]),
    ("mph", 0.447_04, [0, 1, -1, 0, 0, 0]), ("km/h", 0.277_777_777_777_777_8, [0, 1, -1, 0, 0, 0]),
    ("ft/min", 0.005_08, [0, 1, -1, 0, 0, 0]),
    ("N", 1.0, [1, 1, -2, 0, 0, 0]), ("kN", 1000.0, [1, 1, -2, 0, 0, 0]),
    ("lbf", 4.448_221_615_260_5, [1, 1, -2, 0, 0, 0]),
    ("Pa", 1.0, [1, -1, -2, 0, 0, 0]), ("hPa", 100.0, [1, -1, -2, 0, 0, 0]), ("kPa", 1000.0, [1, -1, -2, 0, 0, 0]),
    ("MPa", 1_000_000.0, [1, -1, -2, 0, 0, 0]), ("bar", 100_000.0, [1, -1, -2, 0, 0, 0]),
    ("J", 1.0, [1, 2, -2, 0, 0, 0]), ("kJ", 1000.0, [1, 2, -2, 0, 0, 0]),
    ("W", 1.0, [1, 2, -3, 0, 0, 0]), ("kW", 1000.0, [1, 2, -3, 0, 0, 0]), ("MW", 1_000_000.0, [1, 2, -3, 0, 0, 0]),
    ("kW.h", 3_600_000.0, [1, 2, -2, 0, 0, 0]), ("N.m", 1.0, [1, 2, -2, 0, 0, 0]),
    ("A", 1.0, [0, 0, 0, 1, 0, 0]), ("mA", 0.001, [0, 0, 0, 1, 0, 0]), ("V", 1.0, [1, 2, -3, -1, 0, 0]),
    ("Ohm", 1.0, [1, 2, -3, -2, 0, 0]), ("kOhm", 1000.0, [1, 2, -3, -2, 0, 0]), ("S", 1.0, [-1, -2, 3, 2, 0, 0]),
    ("C", 1.0, [0, 0, 1, 1, 0, 0]), ("F", 1.0, [-1, -2, 4, 2, 0, 0]), ("uF", 0.000_001, [-1, -2, 4, 2, 0, 0]),
    ("pF", 0.000_000_000_001, [-1, -2, 4, 2, 0, 0]), ("H", 1.0, [1, 2, -2, -2, 0, 0]), ("mH", 0.001, [1, 2, -2, -2, 0, 0]),
    ("Wb", 1.0, [1, 2, -2, -1, 0, 0]), ("T", 1.0, [1, 0, -2, -1, 0, 0]), ("THz", 1_000_000_000_000.0, [0, 0, -1, 0, 0, 0]),
    ("l", 0.001, [0, 3, 0, 0, 0, 0]), ("L", 0.001, [0, 3, 0, 0, 0, 0]), ("mL", 0.000_001, [0, 3, 0, 0, 0, 0]), ("gal", 0.003_785_411_784, [0, 3, 0, 0, 0, 0]),
    ("t", 1000.0, [1, 0, 0, 0, 0, 0]), ("kgf", 9.806_65, [1, 1, -2, 0, 0, 0]), ("yd", 0.9144, [0, 1, 0, 0, 0, 0]),
    ("hp", 745.699_871_582_270_2, [1, 2, -3, 0, 0, 0]), ("psi", 6_894.757_293_168_361, [1, -1, -2, 0, 0, 0]),
    ("mbar", 100.0, [1, -1, -2, 0, 0, 0]), ("atm", 101_325.0, [1, -1, -2, 0, 0, 0]),
    ("mmHg", 133.3224, [1, -1, -2, 0, 0, 0]), ("inHg", 3_386.389, [1, -1, -2, 0, 0, 0]),
    ("K", 1.0, [0, 0, 0, 0, 1, 0]), ("mK", 0.001, [0, 0, 0, 0, 1, 0]),
    ("krad/(s2.us)", 1_000_000_000.0, [0, 0, -3, 0, 0, 1]), ("us.s/rad", 0.000_001, [0, 0, 2, 0, 0, -1]),
];

#[test]
fn names_mean_what_the_sources_say() {
    for &(name, factor, [kg, m, s, a, k, rad]) in MEANINGS {
        let base = Base::of(name).unwrap_or_else(|| panic!("{name} is not known"));
        assert_eq!(base.exponents, [kg, m, s, a, k, 0, 0, rad], "{name}");
        // The slug is given with eleven digits.
        let tolerance = if name == "slug" { 1e-10 } else { 1e-15 };
        let error = (base.factor / factor - 1.0).abs();
        assert!(error <= tolerance, "{name}: {}", base.factor);
        assert_eq!(base.offset, 0.0, "{name}");
    }
    for (i, name) in BASE_UNITS.iter().enumerate() {
        let base = Base::of(name).unwrap();
        let expected: [i32; 8] = std::array::from_fn(|j| i32::from(i == j));
        assert_eq!((base.exponents, base.factor), (expected, 1.0), "{name}");
    }
}

/// A symbol or a prefix that is added has a row here, with its factor from a source.
#[test]
fn every_symbol_and_every_prefix_has_a_meaning_above() {
    let known = Product::known();
    let (symbols, rest) = known.split_once(" (with or without a prefix: ").unwrap();
    let (prefixes, others) = rest.split_once("), ").unwrap();
    let has = |name: &str| MEANINGS.iter().any(|(own, ..)| *own == name);
    // Those of temperature with a zero of their own are in the next test.
    let elsewhere = |name: &str| BASE_UNITS.contains(&name) || name.starts_with("deg");
    for symbol in symbols.split(", ").chain(others.split(", ")) {
        assert!(has(symbol) || elsewhere(symbol), "{symbol} has no row");
    }
    for prefix in prefixes.split(", ") {
        let mut names = symbols
            .split(", ")
            .map(|symbol| format!("{prefix}{symbol}"));
        assert!(names.any(|name| has(&name)), "{prefix} has no row");
    }
}

#[test]
fn values_in_the_units_of_aviation() {
    for (from, to, value, expected) in [
        ("ft", "m", 100.0, 30.48),
        ("kn", "m/s", 1.0, 0.514_444_444_444_444_4),
        ("ft/min", "m/s", 196.850_393_700_787_4, 1.0),
        ("deg", "rad", 180.0, std::f64::consts::PI),
        ("deg/s", "rad/s", 90.0, std::f64::consts::FRAC_PI_2),
        ("rpm", "krad/s", 60.0, 2e-3 * std::f64::consts::PI),
        ("degC", "K", 15.0, 288.15),
        ("degF", "degC", 59.0, 15.0),
        ("°F", "degC", 212.0, 100.0),
        ("uF.Ohm", "us", 3.0, 3.0),
        ("Wb/s", "V", 2.0, 2.0),
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
        "",
        "furlong",
        "m/s/s",
        "m/s.kg",
        "1/m.s",
        "m.",
        "m2x",
        "m^x",
        "m^99",
        "K/degC",
        "kft",
        "(m)",
        "Tm30",
        "Gm30.Gm30",
    ] {
        assert_eq!(Base::of(name), None, "{name}");
    }
    assert_eq!(Unit::named("m").conversion(&Unit::named("s")), None);
    assert_eq!(Unit::named("furlong").conversion(&Unit::named("m")), None);
}

/// Symbols with any power but 0, each once.
fn products() -> impl Strategy<Value = Vec<(&'static str, i32)>> {
    let single: Vec<&str> = (MEANINGS.iter().map(|(name, ..)| *name))
        .filter(|name| *name != "1" && !name.contains(['/', '.']))
        .collect();
    let powers = prop::sample::subsequence(single, 1..5).prop_flat_map(|symbols| {
        let n = symbols.len();
        let power = (-12_i32..12).prop_filter("a power", |power| *power != 0);
        (Just(symbols), prop::collection::vec(power, n))
    });
    powers.prop_map(|(symbols, powers)| symbols.into_iter().zip(powers).collect())
}

/// In the way that the table's headers often have it.
fn with_signs(product: &[(&str, i32)]) -> String {
    let parts = product
        .iter()
        .map(|(symbol, power)| format!("{symbol}^{power}"));
    parts.collect::<Vec<_>>().join("·")
}

proptest! {
    #![proptest_config(ProptestConfig {
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn what_is_written_reads_back(product in products()) {
        let name = with_signs(&product);
        let read = Product::parse(&name).unwrap();
        let written = read.to_string();
        let again = Product::parse(&written).unwrap();
        prop_assert_eq!(again.to_string(), written);
        let (here, there) = (read.base(), again.base());
        prop_assert_eq!(here.exponents, there.exponents);
        prop_assert!((here.factor / there.factor - 1.0).abs() < 1e-13);
        let mut factor = 1.0;
        for (symbol, power) in &product {
            let (_, size, _) = MEANINGS.iter().find(|(name, ..)| name == symbol).unwrap();
            factor *= size.powi(*power);
        }
        prop_assert!((here.factor / factor - 1.0).abs() < 1e-8, "{}: {}", name, here.factor);
    }

    #[test]
    fn a_rate_is_one_second_less(product in products()) {
        let read = Product::parse(&with_signs(&product)).unwrap();
        let (before, rate) = (read.base(), read.rate());
        let after = Base::of(&rate.to_string()).unwrap();
        let mut expected = before.exponents;
        expected[2] -= 1;
        prop_assert_eq!(after.exponents, expected);
        prop_assert!((after.factor / before.factor - 1.0).abs() < 1e-13);
    }

    #[test]
    fn conversions_undo_each_other(from in 0..MEANINGS.len(), to in 0..MEANINGS.len(), value in -1e3..1e3_f64) {
        let [from, to] = [from, to].map(|i| Unit::named(MEANINGS[i].0));
        let alike = from.base.unwrap().exponents == to.base.unwrap().exponents;
        let (there, back) = (from.conversion(&to), to.conversion(&from));
        prop_assert_eq!((there.is_some(), back.is_some()), (alike, alike));
        if let (Some(there), Some(back)) = (there, back) {
            prop_assert!((back.apply(there.apply(value)) - value).abs() <= 1e-13 * value.abs());
        }
    }
}

#[test]
fn units_that_are_written_otherwise_are_spelt_as_in_modelica() {
    for (name, spelt) in [
        ("m/s^2", "m/s2"),
        ("N·m", "N.m"),
        ("hours", "h"),
        ("ohm", "Ohm"),
        ("sec", "s"),
    ] {
        assert_eq!(respelt(name).as_deref(), Some(spelt), "{name}");
    }
    for name in ["m/s2", "degC", "furlong"] {
        assert_eq!(respelt(name), None, "{name}");
    }
}

#[test]
fn names_are_shown_with_their_signs() {
    for (name, shown) in [
        ("kg.m2", "kg·m²"),
        ("us/rad", "µs/rad"),
        ("uF", "µF"),
        ("1/(m.us2)", "1/(m·µs²)"),
        ("1", ""),
    ] {
        assert_eq!(pilotage_units::pretty(name), shown, "{name}");
    }
}
