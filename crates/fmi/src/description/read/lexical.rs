//! Lexical forms of values in XML (XML Schema, part 2), stricter than Rust's own parsers.

use super::{IntegerType, Precision};

/// White space of XML.
pub(super) fn is_space(c: char) -> bool {
    matches!(c, ' ' | '\t' | '\r' | '\n')
}

/// Items of an XML Schema list.
pub(super) fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(is_space).filter(|word| !word.is_empty())
}

/// Description of an `xs:boolean`.
pub(super) const BOOLEAN: &str = "true or false";

/// Parses an `xs:boolean`.
pub(super) fn parse_boolean(text: &str) -> Option<bool> {
    match text {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}

/// Description of a number of that type.
pub(super) fn real_name(precision: Precision) -> &'static str {
    match precision {
        Precision::Double => "a number (xs:double)",
        Precision::Single => "a number (xs:float)",
    }
}

/// Parses an `xs:double` or `xs:float`: `INF`, `-INF`, `NaN` or a decimal. Rust's own parser would also accept `inf`
/// and `nan`, and returns infinity for numbers out of range.
pub(super) fn parse_real(text: &str, precision: Precision) -> Option<f64> {
    match text {
        "INF" => return Some(f64::INFINITY),
        "-INF" => return Some(f64::NEG_INFINITY),
        "NaN" => return Some(f64::NAN),
        _ => {}
    }
    let is_letter = |b: u8| b.is_ascii_alphabetic() && !matches!(b, b'e' | b'E');
    if text.bytes().any(is_letter) {
        return None;
    }
    let value = match precision {
        Precision::Double => text.parse().ok(),
        Precision::Single => text.parse::<f32>().ok().map(f64::from),
    };
    value.filter(|value| value.is_finite())
}

/// Description of an integer of that type.
pub(super) fn integer_name(integer: IntegerType) -> String {
    let bits = (integer.range().end() - integer.range().start()).ilog2() + 1;
    match (*integer.range().start(), bits) {
        (0, _) => format!("an unsigned {bits}-bit integer"),
        (_, 8) => "an 8-bit integer".to_owned(),
        _ => format!("a {bits}-bit integer"),
    }
}

/// Parses an integer of that type.
pub(super) fn parse_integer(text: &str, integer: IntegerType) -> Option<i128> {
    let value: i128 = text.parse().ok()?;
    integer.range().contains(&value).then_some(value)
}

/// Parses an `xs:unsignedInt`.
pub(super) fn parse_unsigned(text: &str) -> Option<u32> {
    u32::try_from(parse_integer(text, IntegerType::UInt32)?).ok()
}

/// Parses an `xs:hexBinary`.
pub(super) fn parse_hex(text: &str) -> Option<Vec<u8>> {
    let digit = |byte: u8| char::from(byte).to_digit(16);
    let byte = |pair: &[u8]| match *pair {
        [high, low] => u8::try_from(digit(high)? * 16 + digit(low)?).ok(),
        _ => None,
    };
    text.as_bytes().chunks(2).map(byte).collect()
}
