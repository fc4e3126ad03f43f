//! Linear systems of jets.

use crate::jet::Jet;
use crate::matrix::Matrix;

/// The solution `x` of `A x = b`, by Gaussian elimination with partial pivoting (Golub & Van Loan, *Matrix
/// Computations*, section 3.4); not finite if `A` is singular.
pub fn solved<const N: usize>(mut a: Matrix<N>, mut b: Vec<Jet<N>>) -> Vec<Jet<N>> {
    let n = b.len();
    for k in 0..n {
        let size = |i: &usize| a.row(*i)[k].value.abs();
        let pivot = (k..n).max_by(|i, j| size(i).total_cmp(&size(j)));
        let pivot = pivot.unwrap_or(k);
        b.swap(k, pivot);
        for j in k..n {
            let (own, other) = (a.row(k)[j], a.row(pivot)[j]);
            *a.at(k, j) = other;
            *a.at(pivot, j) = own;
        }
        for i in k + 1..n {
            let factor = a.row(i)[k] / a.row(k)[k];
            for j in k..n {
                let part = factor * a.row(k)[j];
                *a.at(i, j) -= part;
            }
            let part = factor * b[k];
            b[i] -= part;
        }
    }
    for k in (0..n).rev() {
        for j in k + 1..n {
            let part = a.row(k)[j] * b[j];
            b[k] -= part;
        }
        b[k] = b[k] / a.row(k)[k];
    }
    b
}
