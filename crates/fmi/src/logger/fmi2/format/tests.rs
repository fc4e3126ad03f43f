//! The guard against the C library itself, and against a reader that tries every way to cut a format.

use super::super::sys_v::vsnprintf;
use super::*;
use proptest::prelude::*;
use std::ffi::CString;

#[test]
fn conversions_that_do_harm_are_seen() {
    let bad = "%n|a %d %hhn|%%%n|%*.3ln|%1$n|%Ln|%Zn|%In|%qn|%w32n|%é%n|%1$|%0$d|%100$d|%99999999999999999999$d|\
        %2147483647d|%é%2147483640d|%.99999999999999999999f|%4000d%96d|%2048.2048f|%*d|%.*f|%*s|%.*1$s|%.5*s|100 %|%.|% |\
        %é";
    for bad in bad.split('|').map(str::as_bytes).chain([&b"%\x80%n"[..]]) {
        assert!(!is_harmless(bad), "{}", bad.escape_ascii());
    }
    let good = "|n|%%n|%d n|%s%%n|% d|%.*s|%-12.6e|%2$s|%99$s|é%sé|%+#08.3lf|%4000d%95d|%.f|%llu%zu%jd%td%hhx%Lg|\
        %p%c%lc%C%S%m%a%'d";
    for good in good.split('|') {
        assert!(is_harmless(good.as_bytes()), "{good}");
    }
}

#[test]
fn there_are_not_too_many_conversions() {
    assert!(is_harmless("%Lf".repeat(MOST_ARGUMENTS).as_bytes()));
    assert!(!is_harmless("%Lf".repeat(MOST_ARGUMENTS + 1).as_bytes()));
}

/// Formats, most of which are harmful somewhere.
fn formats() -> impl Strategy<Value = Vec<u8>> {
    let ascii = "%%%%%%nnndiouxXeEfFgGaAcCsSpm0123456789$*.-+ #'hljztLqZIw";
    let piece = prop_oneof![
        20 => proptest::sample::select(ascii.as_bytes()).prop_map(|byte| vec![byte]),
        1 => Just("é".as_bytes().to_vec()),
        1 => (1u8..).prop_map(|byte| vec![byte]),
        1 => Just(b"%99".to_vec()),
    ];
    proptest::collection::vec(piece, 0..14).prop_map(|pieces| pieces.concat())
}

/// The sum of width and precision of a conversion that is cut into argument, flags, width, precision and size.
fn sum(parts: [&[u8]; 5], kind: u8) -> Option<usize> {
    let [argument, flags, width, precision, size] =
        parts.map(|part| str::from_utf8(part).unwrap_or("?"));
    let number = |text: &str| match text.bytes().all(|byte| byte.is_ascii_digit()) {
        true if text.is_empty() => Some(0),
        true => Some(text.parse().unwrap_or(usize::MAX / 4)),
        false => None,
    };
    let argument = match argument {
        "" => 1,
        _ => number(
            argument
                .strip_suffix('$')
                .filter(|digits| !digits.is_empty())?,
        )?,
    };
    let precision = match precision {
        "" => 0,
        ".*" if kind == b's' || kind == b'S' => 0,
        _ => number(precision.strip_prefix('.')?)?,
    };
    let is_one = (1..=99).contains(&argument)
        && flags.chars().all(|c| "#0- +'".contains(c))
        && !width.starts_with('0')
        && ["", "h", "hh", "l", "ll", "j", "z", "t", "L"].contains(&size)
        && b"diouxXeEfFgGaAcCsSpm%".contains(&kind);
    is_one.then_some(number(width)? + precision)
}

/// As [`is_harmless`]: every conversion can be cut in some way into parts that are what they should be.
fn can_be_cut(format: &[u8], room: usize) -> bool {
    let Some(at) = format.iter().position(|&byte| byte == b'%') else {
        return true;
    };
    let rest = &format[at + 1..];
    let cuts = (0..rest.len()).flat_map(|e| {
        (0..=e).flat_map(move |d| {
            (0..=d)
                .flat_map(move |c| (0..=c).flat_map(move |b| (0..=b).map(move |a| [a, b, c, d, e])))
        })
    });
    let mut found = cuts.filter_map(|[a, b, c, d, e]| {
        let parts = [
            &rest[..a],
            &rest[a..b],
            &rest[b..c],
            &rest[c..d],
            &rest[d..e],
        ];
        Some((sum(parts, rest[e])?, e))
    });
    found
        .next()
        .is_some_and(|(sum, e)| sum < room && can_be_cut(&rest[e + 1..], room - sum))
}

/// What the C library writes for a format whose values are all addresses of the same eight bytes, and these bytes
/// afterwards.
fn written(format: &[u8]) -> (i32, u64) {
    /// `va_list` (System V ABI, AMD64 supplement, section 3.5.7): no value is in a register.
    #[repr(C)]
    struct Values {
        general: u32,
        floating: u32,
        stack: *const u64,
        saved: *const u64,
    }
    let mut bytes = u64::from(b'a');
    // Each takes two words if it is a `long double`.
    let stack = vec![(&raw mut bytes).expose_provenance() as u64; 2 * MOST_ARGUMENTS + 2];
    let mut values = Values {
        general: 48,
        floating: 176,
        stack: stack.as_ptr(),
        saved: stack.as_ptr(),
    };
    let mut text = [0u8; 64];
    let format = CString::new(format).unwrap();
    // SAFETY: the buffer has that size; there are more values than a format of this test has conversions, each is an
    // address of a string, also of a wide one, that may be written to.
    let length = unsafe {
        vsnprintf(
            text.as_mut_ptr().cast(),
            text.len(),
            format.as_ptr(),
            (&raw mut values).cast(),
        )
    };
    (length, bytes)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 20_000,
        rng_seed: proptest::test_runner::RngSeed::Fixed(9),
        ..ProptestConfig::default()
    })]

    /// The guard agrees with the slow reader; what it lets pass writes no value, and not much text.
    #[test]
    fn what_passes_is_known_and_does_no_harm(format in formats()) {
        let is_harmless = is_harmless(&format);
        prop_assert_eq!(is_harmless, can_be_cut(&format, LONGEST));
        if is_harmless {
            let (length, bytes) = written(&format);
            prop_assert_eq!(bytes, u64::from(b'a'));
            prop_assert!(length < 2 * LONGEST as i32 + 14 * 5000, "{}", length);
        }
    }
}

/// Those that are refused are: the C library writes the value.
#[test]
fn the_c_library_writes_where_the_guard_does_not_let_it() {
    for format in ["%n", "%é%n", "%Ln", "%1$n", "abc%hhn"] {
        assert!(!is_harmless(format.as_bytes()), "{format}");
    }
    assert_eq!(written("ab%é%Ln".as_bytes()).1, 5);
}
