//! The pilot: an n-th order linear system in controllable canonical form (paper, section "Quadcopter
//! Pilot Model").
//!
//! ```text
//! ẋ_1 = x_2, ..., ẋ_{n-1} = x_n
//! ẋ_n = -θ_1 x_1 - ... - θ_n x_n + u_p         u_p = ŷ - y_v, the error seen [m]
//! y_p = θ_{n+1} x_1 + ... + θ_{2n} x_n         the stick [-1, 1]
//! ```
//!
//! that is `y_p/u_p = (θ_{2n} s^{n-1} + ... + θ_{n+1}) / (s^n + θ_n s^{n-1} + ... + θ_1)`. With the
//! error in metres, state `x_i` has unit `m·s^(n-i+1)`, `θ_i` (i ≤ n) `1/s^(n-i+1)` and `θ_{n+i}`
//! `1/(m·s^(n-i+1))`.

use crate::Scalar;
use nalgebra::{Complex, DMatrix, Schur};

/// The published θ (paper, section "Pilot Model Estimation"), as printed: four decimals.
///
/// Started from rest with an ideal attitude loop, it reaches about 5 m for a 10 m target and has a slowly growing mode,
/// so the paper's figure cannot be reproduced from these digits (docs/method.md).
pub const PAPER_THETA: [f64; 6] = [0.2454, 1.2477, 1.0164, -0.0005, 0.0052, -0.0575];

/// Structure of a linear pilot: its order. The parameters θ are arguments of each method, since they are identified.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pilot {
    /// Order `n`, the number of states, at least 1.
    pub order: usize,
}

impl Default for Pilot {
    /// The paper's third-order pilot.
    fn default() -> Self {
        Self { order: 3 }
    }
}

impl Pilot {
    /// Number of parameters, `2n`.
    pub fn n_parameters(&self) -> usize {
        2 * self.order
    }

    /// Writes `f_p(x, u; θ)` into `dx`; `u` is the error `ŷ - y_v` \[m\].
    #[inline(always)]
    pub fn derivative<T: Scalar>(&self, x: &[T], u: T, theta: &[T], dx: &mut [T]) {
        let n = self.order;
        dx[..n - 1].copy_from_slice(&x[1..n]);
        let mut sum = u;
        for (theta, x) in theta[..n].iter().zip(x) {
            sum -= *theta * *x;
        }
        dx[n - 1] = sum;
    }

    /// The stick `y_p = h_p(x; θ)`, dimensionless; *not* clipped to the stick's limits.
    #[inline(always)]
    pub fn output<T: Scalar>(&self, x: &[T], theta: &[T]) -> T {
        let n = self.order;
        let mut sum = theta[n] * x[0];
        for (theta, x) in theta[n + 1..2 * n].iter().zip(&x[1..n]) {
            sum += *theta * *x;
        }
        sum
    }

    /// The poles: roots of `s^n + θ_n s^{n-1} + ... + θ_1` [1/s], sorted by real, then imaginary part. Infinite
    /// where θ is not finite, see [`roots`].
    pub fn poles(&self, theta: &[f64]) -> Vec<Complex<f64>> {
        roots(&theta[..self.order])
    }
}

/// Roots of the monic polynomial `s^n + c[n-1] s^{n-1} + ... + c[0]`: eigenvalues of its companion
/// matrix, sorted by real, then imaginary part.
///
/// If they cannot be computed because a coefficient is not finite or too large, all are `+∞`, so that an unknown system
/// never counts as stable.
pub fn roots(c: &[f64]) -> Vec<Complex<f64>> {
    let mut roots = iterate(c).unwrap_or(vec![Complex::new(f64::INFINITY, 0.0); c.len()]);
    roots.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
    roots
}

/// The unsorted roots; `None` if the iteration does not converge or a root is not finite.
fn iterate(c: &[f64]) -> Option<Vec<Complex<f64>>> {
    /// Per root; LAPACK allows 30 (`dhseqr`).
    const MAX_ITERATIONS: usize = 100;
    let n = c.len();
    if n == 0 {
        return Some(Vec::new());
    }
    // The iteration does not terminate for coefficients that are not finite.
    if c.iter().any(|c| !c.is_finite()) {
        return None;
    }
    let companion = DMatrix::from_fn(n, n, |i, j| match i + 1 == n {
        true => -c[j],
        false => f64::from(i + 1 == j),
    });
    let schur = Schur::try_new(companion, f64::EPSILON, MAX_ITERATIONS * n)?;
    let roots: Vec<_> = schur.complex_eigenvalues().iter().copied().collect();
    let are_finite = roots.iter().all(|s| s.re.is_finite() && s.im.is_finite());
    are_finite.then_some(roots)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The iteration would not terminate.
    #[test]
    fn poles_of_what_is_no_number_are_unstable() {
        let pilot = Pilot::default();
        let infinite = [Complex::new(f64::INFINITY, 0.0); 3];
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for place in 0..3 {
                let mut theta = PAPER_THETA;
                theta[place] = value;
                assert_eq!(pilot.poles(&theta), infinite);
            }
        }
        // Converged or not, it terminates.
        for value in [1e150, -1e250, f64::MAX, f64::MIN_POSITIVE] {
            assert_eq!(roots(&[value, -value, value]).len(), 3);
        }
        assert_eq!(roots(&[]), []);
        assert_eq!(roots(&[2.0]), [Complex::new(-2.0, 0.0)]);
    }
}
