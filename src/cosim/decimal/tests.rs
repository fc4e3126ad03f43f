//! Against the standard library, and the quick way against the paper's.

use super::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

fn text(number: f64) -> String {
    let mut room = [b'?'; LONGEST + SLACK];
    let length = put_rows(&mut room, &[number], 1);
    assert!(length <= LONGEST, "{number:e} takes {length} bytes");
    let text = std::str::from_utf8(&room[..length]).unwrap();
    text.strip_suffix('\n').unwrap().to_owned()
}

/// The digits and the power of the first, as text.
fn scientific(text: &str) -> String {
    let (digits, power) = text.split_once('e').unwrap_or((text, "0"));
    let digits = digits.trim_start_matches('-');
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    let all = format!("{whole}{part}");
    let first = all.find(|c| c != '0').expect("it is not zero");
    let power = power.parse::<i32>().unwrap() + whole.len() as i32 - 1 - first as i32;
    format!("{}e{power}", all[first..].trim_end_matches('0'))
}

/// Against the standard library's, whose digits are the shortest and closest too. Of two that are equally
/// close it takes the upper one, here it is the even one.
fn check(number: f64) {
    let text = text(number);
    assert_eq!(
        text.parse::<f64>().unwrap().to_bits(),
        number.to_bits(),
        "{text}"
    );
    let (ours, theirs) = (scientific(&text), scientific(&format!("{number:e}")));
    if ours != theirs {
        let (digits, power) = ours.split_once('e').unwrap();
        let exact = scientific(&format!("{number:.800e}"));
        assert_eq!(exact, format!("{digits}5e{power}"), "{number:e} as {text}");
        assert!(digits.ends_with(['0', '2', '4', '6', '8']), "{text}");
    }
}

/// The quick way, where it gives an answer, against the paper's.
#[test]
fn the_quick_way_is_right() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut open = 0;
    for _ in 0..300_000 {
        let c = random.next_u64() >> 11 | HIDDEN;
        let q = (random.next_u64() % 2046) as i32 - 1074;
        let (digits, k, is_open) = quickly(c, q);
        open += u32::from(is_open);
        if !is_open {
            assert_eq!((digits, k), shortest(c, q, false), "{c} 2^{q}");
        }
    }
    // Whole numbers halfway between two with a digit less.
    insta::assert_snapshot!(open, @"349");
}

#[test]
fn forms() {
    for (number, expected) in [
        (0.0, "0"),
        (-0.0, "-0"),
        (1.0, "1"),
        (-300.0, "-300"),
        (0.3, "0.3"),
        (0.1 + 0.2, "0.30000000000000004"),
        (-12.5, "-12.5"),
        (1e-5, "0.00001"),
        (9.5e-6, "9.5e-6"),
        (1e15, "1000000000000000"),
        (1.5e15 + 0.25, "1500000000000000.2"),
        (9007199254740993.0, "9007199254740992"),
        (1e16, "1e+16"),
        (-1.25e-123, "-1.25e-123"),
        (f64::MAX, "1.7976931348623157e+308"),
        (f64::MIN_POSITIVE, "2.2250738585072014e-308"),
        (5e-324, "5e-324"),
        (f64::NAN, "NaN"),
        (-f64::NAN, "NaN"),
        (f64::INFINITY, "inf"),
        (f64::NEG_INFINITY, "-inf"),
    ] {
        assert_eq!(text(number), expected);
    }
}

#[test]
fn every_power_of_two_and_its_neighbours() {
    for exponent in 0..0x7ff_u64 {
        for bits in (exponent << 52).saturating_sub(2)..=(exponent << 52) + 2 {
            if bits > 0 && bits < 0x7ff << 52 {
                check(f64::from_bits(bits));
            }
        }
    }
}

#[test]
fn random_numbers_of_all_sizes() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..100_000 {
        let bits = random.next_u64();
        let numbers = [
            // Any bits; such as results have; subnormal; few digits; whole.
            f64::from_bits(bits),
            f64::from_bits(bits >> 2 | 0x3f << 56),
            f64::from_bits(bits >> 12 >> (bits % 52)),
            (bits % 100_000) as f64 / 10_f64.powi((bits >> 60) as i32),
            (bits >> (bits % 64)) as f64,
        ];
        for number in numbers {
            if number.is_finite() && number != 0.0 {
                check(number);
            }
        }
    }
}
