//! Exact steps of a linear time-invariant system `ẋ = A x + b u` whose input is a straight line in
//! time within the step: `u(τ) = u_0 + u̇ τ`.
//!
//! With the input and its slope appended to the state, the step is one matrix exponential (C. F. Van
//! Loan, "Computing integrals involving the matrix exponential", IEEE Trans. Automatic Control 23(3),
//! 1978):
//!
//! ```text
//!     ⎡A b 0⎤
//! exp ⎢0 0 1⎥ h  =  ⎡Φ Γ_0 Γ_1⎤      x(t+h) = Φ x(t) + Γ_0 u_0 + Γ_1 u̇
//!     ⎣0 0 0⎦       ⎣    ⋯    ⎦
//! ```

use nalgebra::DMatrix;

/// Largest `‖A h‖` (1-norm of the augmented matrix): beyond it the exponential has no digits left.
pub const MAX_NORM: f64 = 1e8;

/// One step of fixed size of a linear system with one input.
#[derive(Debug, Clone, PartialEq)]
pub struct Transition {
    order: usize,
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
        /// Step [s].
        step: f64,
        /// Norm of the exponent.
        norm: f64,
    },
    /// The system grows beyond what a number can hold within the step.
    #[error("the linear system overflows within a step of {step} s; take a smaller step")]
    Overflow {
        /// Step [s].
        step: f64,
    },
}

impl Transition {
    /// The transition over `h` seconds of the system of that order whose derivative `f(x, u, dx)`
    /// writes `A x + b u` into `dx`.
    ///
    /// # Errors
    /// When `A h` is too large, or its exponential not finite.
    pub fn new(
        order: usize,
        h: f64,
        derivative: impl Fn(&[f64], f64, &mut [f64]),
    ) -> Result<Self, TransitionError> {
        let exponent = augmented(order, derivative) * h;
        let norm = exponent
            .column_iter()
            .map(|column| column.lp_norm(1))
            .fold(0.0, |a: f64, b| if b > a || b.is_nan() { b } else { a });
        // Written so that NaN is refused too.
        if !matches!(norm.partial_cmp(&MAX_NORM), Some(o) if o.is_le()) {
            return Err(TransitionError::TooLarge { step: h, norm });
        }
        let exponential = exponent.exp();
        if exponential.iter().any(|v| !v.is_finite()) {
            return Err(TransitionError::Overflow { step: h });
        }
        let rows = exponential.rows(0, order).transpose();
        Ok(Self {
            order,
            rows: rows.iter().copied().collect(),
        })
    }

    /// Writes the state after the step into `next`; `x` is the state before it, `u` the input at its
    /// beginning and `slope` the input's time derivative.
    pub fn apply(&self, x: &[f64], u: f64, slope: f64, next: &mut [f64]) {
        let n = self.order;
        for (next, row) in next.iter_mut().zip(self.rows.chunks_exact(n + 2)) {
            let forced = row[n] * u + row[n + 1] * slope;
            *next = row[..n].iter().zip(x).fold(forced, |s, (a, x)| s + a * x);
        }
    }
}

/// The matrix of the system with input and slope appended to the state.
fn augmented(order: usize, derivative: impl Fn(&[f64], f64, &mut [f64])) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(order + 2, order + 2);
    let mut unit = vec![0.0; order];
    let mut column = vec![0.0; order];
    for j in 0..=order {
        unit.fill(0.0);
        if let Some(x) = unit.get_mut(j) {
            *x = 1.0;
        }
        derivative(&unit, f64::from(j == order), &mut column);
        matrix
            .column_mut(j)
            .rows_mut(0, order)
            .copy_from_slice(&column);
    }
    matrix[(order, order + 1)] = 1.0;
    matrix
}
