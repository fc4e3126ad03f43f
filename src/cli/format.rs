//! How numbers look on the terminal.

use crate::linear::Mode;
use nalgebra::Complex;

/// A pole, or a pair of conjugate poles: `-4.240 ± 3.180 i`.
fn pole(pole: Complex<f64>) -> String {
    match pole.im == 0.0 {
        true => format!("{:.3}", pole.re),
        false => format!("{:.3} ± {:.3} i", pole.re, pole.im.abs()),
    }
}

/// A row of a table of modes: pole, frequency, damping.
pub fn mode(mode: &Mode) -> String {
    format!(
        "  {:<20}  {:>17.3}  {:>7.3}\n",
        pole(mode.pole),
        mode.frequency,
        mode.damping
    )
}
