//! Poles, and what they mean.

use nalgebra::{Complex, DMatrix};

/// One pole, or one pair of conjugate poles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode {
    /// The pole; of a pair the one with the positive imaginary part [1/s].
    pub pole: Complex<f64>,
    /// Natural frequency `|s|` [rad/s].
    pub frequency: f64,
    /// Damping ratio `-Re s / |s|`; 1 for a stable real pole, negative when unstable, 0 for an
    /// integrator.
    pub damping: f64,
}

impl Mode {
    /// The modes of a set of poles that is closed under conjugation, slowest first.
    pub fn of_poles(poles: &[Complex<f64>]) -> Vec<Self> {
        let mut modes: Vec<Self> = (poles.iter())
            .filter(|pole| pole.im >= 0.0)
            .map(|&pole| Self {
                pole,
                frequency: pole.norm(),
                damping: match pole.norm() {
                    0.0 => 0.0,
                    frequency => -pole.re / frequency,
                },
            })
            .collect();
        modes.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
        modes
    }
}

/// Eigenvalues, sorted by magnitude, then imaginary part; none of a matrix that is not finite.
///
/// The matrix is scaled first (`balance`): states in metres and in kiloradians per second differ by
/// orders of magnitude, which would cost the small eigenvalues their digits.
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Vec<Complex<f64>> {
    // The iteration does not end on what is not finite.
    if matrix.is_empty() || matrix.iter().any(|value| !value.is_finite()) {
        return Vec::new();
    }
    let mut balanced = matrix.clone();
    balance(&mut balanced);
    let mut values: Vec<_> = balanced.complex_eigenvalues().iter().copied().collect();
    values.sort_by(|a, b| {
        let close = (a.norm() - b.norm()).abs() <= 1e-12 * a.norm().max(b.norm());
        match close {
            true => a.im.total_cmp(&b.im),
            false => a.norm().total_cmp(&b.norm()),
        }
    });
    values
}

/// Scales rows and columns by powers of two until they are of like size (B. N. Parlett, C. Reinsch,
/// "Balancing a matrix for calculation of eigenvalues and eigenvectors", Numer. Math. 13, 1969). The
/// eigenvalues stay, to the last bit.
fn balance(matrix: &mut DMatrix<f64>) {
    const RADIX: f64 = 2.0;
    let n = matrix.nrows();
    loop {
        let mut is_balanced = true;
        for i in 0..n {
            let others = || (0..n).filter(move |&j| j != i);
            let column: f64 = others().map(|j| matrix[(j, i)].abs()).sum();
            let row: f64 = others().map(|j| matrix[(i, j)].abs()).sum();
            if column == 0.0 || row == 0.0 || !(column + row).is_finite() {
                continue;
            }
            let factor = RADIX.powf((0.5 * (row / column).log2()).round());
            if column * factor + row / factor < 0.95 * (column + row) {
                is_balanced = false;
                for j in 0..n {
                    matrix[(j, i)] *= factor;
                    matrix[(i, j)] /= factor;
                }
            }
        }
        if is_balanced {
            return;
        }
    }
}
