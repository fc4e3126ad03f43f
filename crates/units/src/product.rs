//! Names as products of symbols: `m/s`, `kg.m2`, `1/(m.s3)`, `rad·s^-1`.

use super::{Base, table};
use std::fmt;

/// Largest magnitude of a power.
const LARGEST_POWER: i32 = 30;

/// A product of powers of symbols. It is written in FMI's spelling (Modelica's): dots between symbols, one stroke,
/// parentheses around more than one symbol after it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Product {
    /// Symbols, each with its power.
    factors: Vec<(String, i32)>,
}

impl Product {
    /// Reads a name: symbols with or without prefix, with `.`, `·` or `*` between them and `2`, `^2`, `-2`, `²` or
    /// `³` after them, and one `/`, followed by one symbol or several in parentheses. `None` if it has another form
    /// or a symbol that is not known.
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
        Some(Self { factors })
    }

    /// What it means.
    pub fn base(&self) -> Base {
        let mut base = Base::default();
        for (symbol, power) in &self.factors {
            // Known since it was read.
            let part = table::symbol(symbol).unwrap_or_default();
            base.factor *= part.factor.powi(*power);
            for (sum, exponent) in base.exponents.iter_mut().zip(part.exponents) {
                *sum += power * exponent;
            }
        }
        base
    }

    /// The unit of the time derivative: `m/s` of `m`, `m.s` of `m.s2`.
    pub fn rate(mut self) -> Self {
        match self.factors.iter_mut().find(|(symbol, _)| symbol == "s") {
            Some((_, power)) => *power -= 1,
            None => self.factors.push(("s".to_owned(), -1)),
        }
        self.factors.retain(|(_, power)| *power != 0);
        self
    }

    /// The unit of a power spectral density: `m2.s` of `m`.
    pub fn density(mut self) -> Self {
        self.factors.iter_mut().for_each(|(_, power)| *power *= 2);
        match self.factors.iter_mut().find(|(symbol, _)| symbol == "s") {
            Some((_, power)) => *power += 1,
            None => self.factors.push(("s".to_owned(), 1)),
        }
        self.factors.retain(|(_, power)| *power != 0);
        self
    }

    /// What may stand in a name in Modelica's spelling, for messages.
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

/// A symbol to that power, in FMI's spelling.
pub fn power(symbol: &str, exponent: usize) -> String {
    match exponent {
        1 => symbol.to_owned(),
        _ => format!("{symbol}{exponent}"),
    }
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
            let power: i32 = match power.trim_start_matches('^') {
                "²" => 2,
                "³" => 3,
                digits => digits.parse().ok()?,
            };
            (power.abs() <= LARGEST_POWER).then_some((symbol, power))
        }
    }
}
