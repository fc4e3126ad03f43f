//! Formats numbers and tables for the terminal.

use super::terminal::line;
use crate::linear::Mode;
use nalgebra::Complex;

/// A pole, or a pair of conjugate poles: `-4.240 ± 3.180 i`.
fn pole(pole: Complex<f64>) -> String {
    match pole.im == 0.0 {
        true => decimals(pole.re),
        false => format!("{} ± {} i", decimals(pole.re), decimals(pole.im.abs())),
    }
}

/// Three decimals, or the digits of what is smaller.
fn decimals(value: f64) -> String {
    match value != 0.0 && value.abs() < 5e-4 {
        true => format!("{value:.2e}"),
        false => format!("{value:.3}"),
    }
}

/// A row of a table of modes: pole, frequency, damping.
pub fn mode(mode: &Mode) -> String {
    format!(
        "  {:<20}  {:>17}  {:>7.3}\n",
        pole(mode.pole),
        decimals(mode.frequency),
        mode.damping
    )
}

/// Maximum column width used for padding: one long text must not widen all lines.
const WIDEST: usize = 120;

/// Aligns columns, up to the maximum width. Each row is one line, whatever its cells contain.
pub fn aligned<R: AsRef<[String]>>(rows: &[R]) -> String {
    let rows: Vec<Vec<String>> = (rows.iter())
        .map(|row| row.as_ref().iter().map(|cell| line(cell)).collect())
        .collect();
    let width = |column: usize| {
        let widths = rows.iter().map(|row| row[column].chars().count());
        widths.max().unwrap_or(0).min(WIDEST)
    };
    let columns = rows.first().map_or(0, Vec::len);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let begin = text.len();
        for (cell, &width) in row.iter().zip(&widths) {
            text += &format!("{cell:<width$}  ");
        }
        text.truncate(begin + text[begin..].trim_end().len());
        text += "\n";
    }
    text
}
