//! Exact steps of a linear time-invariant system `ẋ = A x + B u` whose inputs are linear in time within the step:
//! `u(τ) = u_0 + u̇ τ`.
//!
//! With the inputs and their slopes appended to the state, the step is one matrix exponential (C. F. Van
//! Loan, "Computing integrals involving the matrix exponential", IEEE Trans. Automatic Control 23(3),
//! 1978):
//!
//! ```text
//!     ⎡A B 0⎤
//! exp ⎢0 0 I⎥ h  =  ⎡Φ Γ_0 Γ_1⎤      x(t+h) = Φ x(t) + Γ_0 u_0 + Γ_1 u̇
//!     ⎣0 0 0⎦       ⎣    ⋯    ⎦
//! ```
//!
//! The matrix is balanced first: in a canonical form with poles of magnitude ρ, each state is ρ times as large as the
//! one before it, and the norm would be of order ρⁿ (B. N. Parlett, C. Reinsch, "Balancing a matrix for calculation of
//! eigenvalues and eigenvectors", Numerische Mathematik 13, 1969).

use nalgebra::DMatrix;
use nalgebra::linalg::balancing::{balance_parlett_reinsch, unbalance};

/// Largest `‖A h‖` (1-norm of the augmented matrix, balanced): above it the exponential has no correct digits.
pub const MAX_NORM: f64 = 1e8;

/// Largest `‖A h‖` before balancing: the squares of norms must not overflow.
const MAX_UNBALANCED: f64 = 1e150;

/// One step of fixed size of a linear system.
#[derive(Debug, Clone, PartialEq)]
pub struct Transition {
    order: usize,
    inputs: usize,
    /// Rows `[Φ Γ_0 Γ_1]`, one after the other.
    rows: Vec<f64>,
}

/// Why a transition cannot be computed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TransitionError {
    /// The exponent is too large or not a number.
    #[error(
        "the norm of the system matrix times the step of {step} s is {norm:e}, more than {MAX_NORM:e}; \
         take a smaller step or smaller coefficients"
    )]
    TooLarge {
        /// Step \[s\].
        step: f64,
        /// Norm of the exponent.
        norm: f64,
    },
    /// The system overflows within the step.
    #[error("the linear system overflows within a step of {step} s; take a smaller step")]
    Overflow {
        /// Step \[s\].
        step: f64,
    },
}

impl Transition {
    /// The transition over `h` seconds of the system with that number of states and inputs; `derivative(x, u, dx)`
    /// writes `A x + B u` into `dx`.
    ///
    /// # Errors
    /// If `A h` is too large, or its exponential is not finite.
    pub fn new(
        [order, inputs]: [usize; 2],
        h: f64,
        derivative: impl Fn(&[f64], &[f64], &mut [f64]),
    ) -> Result<Self, TransitionError> {
        let mut exponent = augmented(order, inputs, derivative) * h;
        let within = |exponent: &DMatrix<f64>, limit| match norm(exponent) {
            norm if norm <= limit => Ok(()),
            norm => Err(TransitionError::TooLarge { step: h, norm }),
        };
        within(&exponent, MAX_UNBALANCED)?;
        let scales = balance_parlett_reinsch(&mut exponent);
        within(&exponent, MAX_NORM)?;
        let mut exponential = exponential(exponent);
        unbalance(&mut exponential, &scales);
        if exponential.iter().any(|v| !v.is_finite()) {
            return Err(TransitionError::Overflow { step: h });
        }
        let rows = exponential.rows(0, order).transpose();
        Ok(Self {
            order,
            inputs,
            rows: rows.iter().copied().collect(),
        })
    }

    /// Writes the states after the step into `next`; `x` are the states before it, `u` the inputs at its
    /// beginning and `slopes` the inputs' time derivatives.
    pub fn apply(&self, x: &[f64], u: &[f64], slopes: &[f64], next: &mut [f64]) {
        let (n, m) = (self.order, self.inputs);
        let product =
            |row: &[f64], x: &[f64], sum| row.iter().zip(x).fold(sum, |s, (a, x)| s + a * x);
        for (next, row) in next.iter_mut().zip(self.rows.chunks_exact(n + 2 * m)) {
            let (states, forced) = row.split_at(n);
            let held = product(&forced[..m], u, 0.0);
            *next = product(states, x, product(&forced[m..], slopes, held));
        }
    }
}

/// The exponential of a square matrix by scaling and squaring: a Padé approximant of degree 13 of the matrix divided by a
/// power of 2 (N. J. Higham, "The scaling and squaring method for the matrix exponential revisited", SIAM J. Matrix Anal.
/// Appl. 26(4), 2005, Algorithm 2.3, without its lower degrees). NaN if the approximant's denominator is singular.
///
/// Not nalgebra's, which comes with the part of that crate that needs the standard library, and is a fifth of the build of
/// the FMU library.
fn exponential(matrix: DMatrix<f64>) -> DMatrix<f64> {
    // Coefficients of the approximant: the numerator's, which are the denominator's with alternating signs.
    const B: [f64; 14] = [
        64764752532480000.0,
        32382376266240000.0,
        7771770303897600.0,
        1187353796428800.0,
        129060195264000.0,
        10559470521600.0,
        670442572800.0,
        33522128640.0,
        1323241920.0,
        40840800.0,
        960960.0,
        16380.0,
        182.0,
        1.0,
    ];
    /// Norm up to which the approximant is exact to rounding.
    const ACCURATE: f64 = 5.371920351148152;
    let squarings = (norm(&matrix) / ACCURATE).log2().ceil().max(0.0) as i32;
    let size = matrix.nrows();
    let a = matrix * 0.5_f64.powi(squarings);
    let a2 = product(&a, &a);
    let a4 = product(&a2, &a2);
    let a6 = product(&a4, &a2);
    // The terms of the degrees k, k + 2, k + 4 and k + 6, divided by A^k for an even k and by A^(k - 1) for an odd one.
    let four = |k: usize| {
        let constant = DMatrix::from_diagonal_element(size, size, B[k]);
        constant + &a2 * B[k + 2] + &a4 * B[k + 4] + &a6 * B[k + 6]
    };
    let three = |k: usize| product(&a6, &(&a2 * B[k] + &a4 * B[k + 2] + &a6 * B[k + 4]));
    let even = three(8) + four(0);
    let odd = product(&a, &(three(9) + four(1)));
    let solved = (&even - &odd).lu().solve(&(&even + &odd));
    let mut exponential = solved.unwrap_or_else(|| DMatrix::from_element(size, size, f64::NAN));
    for _ in 0..squarings {
        exponential = product(&exponential, &exponential);
    }
    exponential
}

/// The product of two square matrices. nalgebra's is computed by another crate where the standard library is there, with
/// other rounding: an FMU and its model would differ in the last bits.
fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let n = a.nrows();
    DMatrix::from_fn(n, n, |i, j| (0..n).map(|k| a[(i, k)] * b[(k, j)]).sum())
}

/// The 1-norm; NaN if an entry is NaN.
fn norm(matrix: &DMatrix<f64>) -> f64 {
    let columns = matrix.column_iter().map(|column| column.lp_norm(1));
    columns.fold(0.0, |a: f64, b| if b > a || b.is_nan() { b } else { a })
}

/// The matrix of the system with inputs and slopes appended to the states.
fn augmented(
    order: usize,
    inputs: usize,
    derivative: impl Fn(&[f64], &[f64], &mut [f64]),
) -> DMatrix<f64> {
    let size = order + 2 * inputs;
    let mut matrix = DMatrix::zeros(size, size);
    let mut unit = vec![0.0; order + inputs];
    let mut column = vec![0.0; order];
    for j in 0..order + inputs {
        unit.fill(0.0);
        unit[j] = 1.0;
        derivative(&unit[..order], &unit[order..], &mut column);
        matrix
            .column_mut(j)
            .rows_mut(0, order)
            .copy_from_slice(&column);
    }
    for j in order..order + inputs {
        matrix[(j, j + inputs)] = 1.0;
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]

        /// Sizes from rounding to 2^16, against nalgebra's exponential, which is another algorithm (Al-Mohy & Higham).
        #[test]
        fn exponentials_are_those_of_nalgebra(
            entries in proptest::collection::vec(-1.0..1.0_f64, 36),
            size in 1..7_usize,
            exponent in -30..16_i32,
        ) {
            let matrix = DMatrix::from_fn(size, size, |i, j| entries[6 * i + j]);
            // Stable, so that nothing overflows.
            let shift = matrix.lp_norm(1) + matrix.transpose().lp_norm(1);
            let matrix = (matrix - DMatrix::from_diagonal_element(size, size, shift)) * 2.0_f64.powi(exponent);
            let [found, expected] = [exponential(matrix.clone()), matrix.exp()];
            let off = (&found - &expected).amax();
            prop_assert!(off <= 1e-12, "{matrix}{found}{expected}");
        }
    }

    /// A nilpotent matrix, whose series ends, and a rotation by many turns.
    #[test]
    fn exponentials_in_closed_form() {
        let shift = DMatrix::from_fn(4, 4, |i, j| if j == i + 1 { 100.0 } else { 0.0 });
        let expected = [1.0, 100.0, 5000.0, 1e6 / 6.0];
        let found = exponential(shift);
        for (j, expected) in expected.into_iter().enumerate() {
            assert!((found[(0, j)] / expected - 1.0).abs() < 1e-13, "{found}");
        }
        let angle = 1000.0_f64;
        let found = exponential(DMatrix::from_row_slice(2, 2, &[0.0, angle, -angle, 0.0]));
        assert!((found[(0, 0)] - angle.cos()).abs() < 1e-11, "{found}");
        assert!((found[(0, 1)] - angle.sin()).abs() < 1e-11, "{found}");
        assert_eq!(exponential(DMatrix::zeros(0, 0)), DMatrix::zeros(0, 0));
        assert_eq!(exponential(DMatrix::zeros(2, 2)), DMatrix::identity(2, 2));
    }
}
