//! Parsers of numeric arguments. Options need `allow_hyphen_values`, since clap would take `-1e-6` for an option.

use crate::document::with_point;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Any number; the caller checks the range.
pub fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| expected("a number", "10", text))
}

/// A finite positive number.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err(expected("a number above 0", "0.05 or 1e-6", text)),
    }
}

/// A non-negative integer.
pub fn whole<N: FromStr>(text: &str) -> Result<N, String> {
    text.parse()
        .map_err(|_| "expected a whole number, not negative, such as 20".to_owned())
}

/// An integer within a range.
pub fn within<N: FromStr + PartialOrd + Display + Clone>(
    range: RangeInclusive<N>,
) -> impl Fn(&str) -> Result<N, String> + Clone {
    move |text| {
        let (first, last) = (range.start(), range.end());
        let value = text.parse().ok().filter(|value| range.contains(value));
        value.ok_or_else(|| {
            format!("expected a whole number from {first} to {last}, such as {last}")
        })
    }
}

fn expected(what: &str, example: &str, text: &str) -> String {
    match with_point(text) {
        Some(number) => format!("expected {what}, with a decimal point: {number}"),
        None => format!("expected {what}, such as {example}"),
    }
}
