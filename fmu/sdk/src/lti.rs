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
        let mut exponential = exponent.exp();
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
