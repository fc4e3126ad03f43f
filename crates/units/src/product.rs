//! Unit names as products of symbols: `m/s`, `kg.m2`, `1/(m.s3)`, `rad·s^-1`.

use super::{Base, table};
use std::fmt;

/// Largest magnitude of a power.
const LARGEST_POWER: i32 = 30;

/// A product of powers of symbols. It is displayed in FMI's (Modelica's) spelling: dots between symbols, one slash, and
/// parentheses around several symbols after the slash.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Product {
    /// Symbols, each with its power.
    factors: Vec<(String, i32)>,
}

impl Product {
    /// Parses a unit name: symbols with or without prefix, separated by `.`, `·` or `*`, each optionally followed by
    /// `2`, `^2`, `-2`, `²` or `³`, and at most one `/`, followed by one symbol or several in parentheses. `None` if
    /// the form is different, a symbol is unknown, or the factor to base units is beyond what a double holds.
    pub fn parse(name: &str) -> Option<Self> {
        let (above, below) = match name.split_once('/') {
            Some((above, below)) => (above, inside_parentheses(below)?),
            None => (name, "1"),
        };
        let mut factors = Vec::new();
        for (product, sign) in [(above, 1), (below, -1)] {
            for part in product.split(['.', '·', '*']) {
                let (symbol, power) = symbol_and_power(part.trim())?;
                table::symbol(symbol)?;
                if symbol != "1" {
                    factors.push((symbol.to_owned(), sign * power));
                }
            }
        }
        let product = Self { factors };
        product.base().factor.is_normal().then_some(product)
    }

    /// The meaning of the product.
    pub fn base(&self) -> Base {
        let mut base = Base::default();
        for (symbol, power) in &self.factors {
            // Known, since `parse` checked it.
            let part = table::symbol(symbol).unwrap_or_default();
            base.factor *= part.factor.powi(*power);
            for (sum, exponent) in base.exponents.iter_mut().zip(part.exponents) {
                *sum += power * exponent;
            }
        }
        base
    }

    /// The unit of the time derivative: `m/s` for `m`, `m.s` for `m.s2`.
    pub fn rate(mut self) -> Self {
        match self.factors.iter_mut().find(|(symbol, _)| symbol == "s") {
            Some((_, power)) => *power -= 1,
            None => self.factors.push(("s".to_owned(), -1)),
        }
        self.factors.retain(|(_, power)| *power != 0);
        self
    }

    /// The unit of a power spectral density: `m2.s` for `m`.
    pub fn density(mut self) -> Self {
        self.factors.iter_mut().for_each(|(_, power)| *power *= 2);
        match self.factors.iter_mut().find(|(symbol, _)| symbol == "s") {
            Some((_, power)) => *power += 1,
            None => self.factors.push(("s".to_owned(), 1)),
        }
        self.factors.retain(|(_, power)| *power != 0);
        self
    }

    /// The symbols allowed in Modelica's spelling, for messages.
    pub fn known() -> String {
        let [prefixed, prefixes, others] = table::symbols().map(|names| names.join(", "));
        format!("{prefixed} (with or without a prefix: {prefixes}), {others}")
    }
}

impl fmt::Display for Product {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |sign: i32| -> Vec<String> {
            let those = (self.factors.iter()).filter(|(_, power)| power * sign > 0);
            those
                .map(|(symbol, exponent)| power(symbol, exponent.unsigned_abs() as usize))
                .collect()
        };
        let (above, below) = (list(1), list(-1));
        match above.is_empty() {
            true => f.write_str("1")?,
            false => f.write_str(&above.join("."))?,
        }
        match &below[..] {
            [] => Ok(()),
            [one] => write!(f, "/{one}"),
            several => write!(f, "/({})", several.join(".")),
        }
    }
}

/// A symbol with an exponent, in FMI's spelling.
pub fn power(symbol: &str, exponent: usize) -> String {
    match exponent {
        1 => symbol.to_owned(),
        _ => format!("{symbol}{exponent}"),
    }
}

/// The denominator: one unit, or several in parentheses. Without parentheses `a/b.c` is ambiguous.
fn inside_parentheses(text: &str) -> Option<&str> {
    let text = text.trim();
    match text.strip_prefix('(') {
        Some(rest) => rest.strip_suffix(')'),
        None => (!text.contains(['.', '·', '*', '/'])).then_some(text),
    }
}

/// Splits `s2`, `s^2`, `s-2` or `s²` into symbol and power; without a power it is 1.
fn symbol_and_power(part: &str) -> Option<(&str, i32)> {
    let is_power = |c: char| c.is_ascii_digit() || c == '-' || c == '^' || "²³".contains(c);
    match part.find(is_power) {
        None | Some(0) => Some((part, 1)),
        Some(at) => {
            let (symbol, power) = part.split_at(at);
            let power: i32 = match power.trim_start_matches('^') {
                "²" => 2,
                "³" => 3,
                digits => digits.parse().ok()?,
            };
            (power.abs() <= LARGEST_POWER).then_some((symbol, power))
        }
    }
}
