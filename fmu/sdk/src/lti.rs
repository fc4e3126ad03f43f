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
//! Only the rows of the states are computed. A is balanced first: in a canonical form with poles of magnitude
//! ρ, each state is ρ times as large as the one before it, and the norm would be of order ρⁿ (B. N. Parlett, C. Reinsch,
//! "Balancing a matrix for calculation of eigenvalues and eigenvectors", Numerische Mathematik 13, 1969).

use nalgebra::DMatrix;
use nalgebra::linalg::balancing::{balance_parlett_reinsch, unbalance};
use std::ops::Add;

/// Largest `‖A h‖` (1-norm, balanced): above it the exponential has no correct digits.
pub const MAX_NORM: f64 = 1e8;

/// Largest `‖A h‖` before balancing, and `‖B h‖`: the squares of norms must not overflow.
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
    /// Coefficients that are NaN or infinite.
    #[error("coefficients of the linear system are NaN or infinite; look at its parameters")]
    NotFinite,
    /// The exponent is too large.
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
        let (mut states, mut forced) = matrices(order, inputs, derivative);
        states *= h;
        forced *= h;
        let within = |norm: f64, limit| match norm <= limit {
            true => Ok(()),
            false if !norm.is_finite() => Err(TransitionError::NotFinite),
            false => Err(TransitionError::TooLarge { step: h, norm }),
        };
        within(norm(&states), MAX_UNBALANCED)?;
        within(norm(&forced), MAX_UNBALANCED)?;
        let scales = balance_parlett_reinsch(&mut states);
        within(norm(&states), MAX_NORM)?;
        for (mut row, scale) in forced.row_iter_mut().zip(&scales) {
            row /= *scale;
        }
        let mut found = Rows::exponential(Rows {
            slopes: DMatrix::zeros(order, inputs),
            states,
            forced,
            diagonal: 0.0,
            above: h,
        });
        unbalance(&mut found.states, &scales);
        for matrix in [&mut found.forced, &mut found.slopes] {
            for (mut row, scale) in matrix.row_iter_mut().zip(&scales) {
                row *= *scale;
            }
        }
        let blocks = [&found.states, &found.forced, &found.slopes];
        if blocks.iter().any(|own| own.iter().any(|v| !v.is_finite())) {
            return Err(TransitionError::Overflow { step: h });
        }
        let of_row = |i: usize| blocks.map(|own| own.row(i).iter().copied().collect::<Vec<_>>());
        Ok(Self {
            order,
            inputs,
            rows: (0..order).flat_map(of_row).flatten().collect(),
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

/// The rows of the states in a matrix of the form of the one above, and the rest of it, which is diagonal in blocks:
///
/// ```text
/// ⎡states forced     slopes    ⎤
/// ⎢0      diagonal·I above·I   ⎥
/// ⎣0      0          diagonal·I⎦
/// ```
///
/// Sums, products and inverses have that form too.
#[derive(Debug, Clone)]
struct Rows {
    states: DMatrix<f64>,
    forced: DMatrix<f64>,
    slopes: DMatrix<f64>,
    diagonal: f64,
    above: f64,
}

impl Rows {
    /// The exponential by scaling and squaring: a Padé approximant of degree 13 of the matrix divided by a power of 2 (N. J.
    /// Higham, "The scaling and squaring method for the matrix exponential revisited", SIAM J. Matrix Anal. Appl. 26(4),
    /// 2005, Algorithm 2.3, without its lower degrees). The power follows from the states alone, since the rest is linear
    /// in the inputs. NaN if the approximant's denominator is singular.
    fn exponential(matrix: Self) -> Self {
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
        let squarings = (norm(&matrix.states) / ACCURATE).log2().ceil().max(0.0) as i32;
        let a = matrix.times(0.5_f64.powi(squarings));
        let a2 = a.product(&a);
        let a4 = a2.product(&a2);
        let a6 = a4.product(&a2);
        // The terms of the degrees k, k + 2 and k + 4, and those and a constant.
        let three = |k: usize| a2.times(B[k]) + a4.times(B[k + 2]) + a6.times(B[k + 4]);
        let four = |k: usize| three(k + 2).plus_identity(B[k]);
        let even = a6.product(&three(8)) + four(0);
        let odd = a.product(&(a6.product(&three(9)) + four(1)));
        let mut exponential = (even.clone() + odd.times(-1.0)).solve(even + odd);
        for _ in 0..squarings {
            exponential = exponential.product(&exponential);
        }
        exponential
    }

    fn times(&self, factor: f64) -> Self {
        Self {
            states: &self.states * factor,
            forced: &self.forced * factor,
            slopes: &self.slopes * factor,
            diagonal: self.diagonal * factor,
            above: self.above * factor,
        }
    }

    fn plus_identity(mut self, factor: f64) -> Self {
        let n = self.states.nrows();
        (0..n).for_each(|i| self.states[(i, i)] += factor);
        self.diagonal += factor;
        self
    }

    fn product(&self, other: &Self) -> Self {
        let forced = &self.forced * other.diagonal;
        let slopes = &self.forced * other.above + &self.slopes * other.diagonal;
        Self {
            states: product(&self.states, &other.states),
            forced: product(&self.states, &other.forced) + forced,
            slopes: product(&self.states, &other.slopes) + slopes,
            diagonal: self.diagonal * other.diagonal,
            above: self.diagonal * other.above + self.above * other.diagonal,
        }
    }

    /// The solution `X` of `self X = right`.
    fn solve(self, right: Self) -> Self {
        let diagonal = right.diagonal / self.diagonal;
        let above = (right.above - self.above * diagonal) / self.diagonal;
        let factors = self.states.lu();
        let solved = |mut right: DMatrix<f64>| {
            if !factors.solve_mut(&mut right) {
                right.fill(f64::NAN);
            }
            right
        };
        Self {
            states: solved(right.states),
            forced: solved(right.forced - &self.forced * diagonal),
            slopes: solved(right.slopes - &self.forced * above - &self.slopes * diagonal),
            diagonal,
            above,
        }
    }
}

impl Add for Rows {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            states: self.states + other.states,
            forced: self.forced + other.forced,
            slopes: self.slopes + other.slopes,
            diagonal: self.diagonal + other.diagonal,
            above: self.above + other.above,
        }
    }
}

/// The product of two matrices. nalgebra's is computed by another crate where the standard library is there, with other
/// rounding: an FMU and its model would differ in the last bits.
fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let n = a.nrows().max(1);
    let mut out = DMatrix::zeros(a.nrows(), b.ncols());
    for (sums, factors) in out.as_mut_slice().chunks_mut(n).zip(b.column_iter()) {
        for (column, factor) in a.as_slice().chunks(n).zip(&factors) {
            for (sum, a) in sums.iter_mut().zip(column) {
                *sum += factor * a;
            }
        }
    }
    out
}

/// The 1-norm; NaN if an entry is NaN.
fn norm(matrix: &DMatrix<f64>) -> f64 {
    let columns = matrix.column_iter().map(|column| column.lp_norm(1));
    columns.fold(0.0, |a: f64, b| if b > a || b.is_nan() { b } else { a })
}

/// The matrices A and B.
fn matrices(
    order: usize,
    inputs: usize,
    derivative: impl Fn(&[f64], &[f64], &mut [f64]),
) -> (DMatrix<f64>, DMatrix<f64>) {
    let (mut states, mut forced) = (DMatrix::zeros(order, order), DMatrix::zeros(order, inputs));
    let mut unit = vec![0.0; order + inputs];
    let mut column = vec![0.0; order];
    for j in 0..order + inputs {
        unit.fill(0.0);
        unit[j] = 1.0;
        derivative(&unit[..order], &unit[order..], &mut column);
        let mut place = match j.checked_sub(order) {
            None => states.column_mut(j),
            Some(input) => forced.column_mut(input),
        };
        place.copy_from_slice(&column);
    }
    (states, forced)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The matrix whose rows these are.
    fn whole(of: &Rows) -> DMatrix<f64> {
        let (n, m) = of.forced.shape();
        DMatrix::from_fn(n + 2 * m, n + 2 * m, |i, j| match (i < n, j) {
            (true, j) if j < n => of.states[(i, j)],
            (true, j) if j < n + m => of.forced[(i, j - n)],
            (true, j) => of.slopes[(i, j - n - m)],
            (false, j) if i == j => of.diagonal,
            (false, j) if j == i + m && i < n + m => of.above,
            _ => 0.0,
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]

        /// Sizes from rounding to 2^16, against nalgebra's exponential of the whole matrix, which is another algorithm
        /// (Al-Mohy & Higham).
        #[test]
        fn exponentials_are_those_of_nalgebra(
            entries in proptest::collection::vec(-1.0..1.0_f64, 60),
            size in 1..6_usize,
            inputs in 0..3_usize,
            exponent in -30..16_i32,
        ) {
            let states = DMatrix::from_fn(size, size, |i, j| entries[6 * i + j]);
            let forced = DMatrix::from_fn(size, inputs, |i, j| entries[36 + 2 * i + j]);
            // Stable, so that nothing overflows.
            let shift = states.lp_norm(1) + states.transpose().lp_norm(1);
            let states = (states - DMatrix::from_diagonal_element(size, size, shift)) * 2.0_f64.powi(exponent);
            let rows = Rows { slopes: DMatrix::zeros(size, inputs), states, forced, diagonal: 0.0, above: 1.0 };
            let [found, expected] = [whole(&Rows::exponential(rows.clone())), whole(&rows).exp()];
            let off = (&found - &expected).amax();
            prop_assert!(off <= 1e-12, "{found}{expected}");
        }
    }

    /// A nilpotent matrix, whose series ends, a rotation by many turns, and no states at all.
    #[test]
    fn exponentials_in_closed_form() {
        let exponential = |states: DMatrix<f64>| {
            let none = DMatrix::zeros(states.nrows(), 0);
            let (forced, slopes) = (none.clone(), none);
            Rows::exponential(Rows {
                states,
                forced,
                slopes,
                diagonal: 0.0,
                above: 1.0,
            })
            .states
        };
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
