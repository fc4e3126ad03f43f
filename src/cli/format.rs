//! How numbers look on the terminal.

use nalgebra::Complex;

/// A pole, or a pair of conjugate poles: `-4.240 ± 3.180 i`.
pub fn pole(pole: Complex<f64>) -> String {
    match pole.im == 0.0 {
        true => format!("{:.3}", pole.re),
        false => format!("{:.3} ± {:.3} i", pole.re, pole.im.abs()),
    }
}
