//! Numbers as arguments.

use crate::document::with_point;

/// Any number; who takes it knows its range.
pub fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| expected("a number", text))
}

/// A finite number above zero.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err(expected("a number above 0", text)),
    }
}

/// A whole number, not negative.
pub fn whole(text: &str) -> Result<usize, String> {
    text.parse()
        .map_err(|_| "expected a whole number".to_owned())
}

fn expected(what: &str, text: &str) -> String {
    match with_point(text) {
        Some(number) => format!("expected {what}, with a decimal point: {number}"),
        None => format!("expected {what}"),
    }
}
