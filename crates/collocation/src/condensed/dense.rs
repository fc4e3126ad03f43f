//! Small dense kernels on row-major slices, sized at run time and without allocation.

/// Relative size below which pivots count as rounding, as for equal rows.
pub(super) const RANK: f64 = 1e-14;

/// `y += a x`.
#[inline(always)]
pub fn axpy(a: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

/// Scalar product.
#[inline(always)]
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// In-place Cholesky factorisation of the lower triangle, `n × n`; false if not positive definite.
pub fn cholesky(a: &mut [f64], n: usize) -> bool {
    // A pivot within rounding of the original diagonal does not count as positive.
    let largest = (0..n).fold(0.0_f64, |m, i| m.max(a[i * n + i].abs()));
    for k in 0..n {
        let mut pivot = a[k * n + k];
        for j in 0..k {
            pivot -= a[k * n + j] * a[k * n + j];
        }
        if pivot.is_nan() || pivot <= 1e-15 * largest.max(f64::MIN_POSITIVE) * 1e-3 {
            return false;
        }
        let root = pivot.sqrt();
        a[k * n + k] = root;
        for i in k + 1..n {
            let (above, below) = a.split_at(i * n);
            let value = below[k] - dot(&above[k * n..k * n + k], &below[..k]);
            a[i * n + k] = value / root;
        }
    }
    true
}

/// Cholesky factorisation of the linearly independent rows and columns of a positive semidefinite `n × n` matrix: those
/// whose pivots are above `rank` times their diagonal entry. Returns their indices and their factor. For a matrix of low
/// rank, few entries are evaluated.
pub fn independent_cholesky(
    n: usize,
    rank: f64,
    entry: impl Fn(usize, usize) -> f64,
) -> (Vec<usize>, Vec<f64>) {
    let mut kept: Vec<usize> = Vec::new();
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for i in 0..n {
        let mut row: Vec<f64> = Vec::with_capacity(kept.len() + 1);
        for (k, above) in kept.iter().zip(&rows) {
            let place = row.len();
            row.push((entry(i, *k) - dot(&above[..place], &row)) / above[place]);
        }
        let diagonal = entry(i, i);
        let pivot = diagonal - dot(&row, &row);
        if pivot > rank * diagonal {
            row.push(pivot.sqrt());
            rows.push(row);
            kept.push(i);
        }
    }
    rows.iter_mut().for_each(|row| row.resize(kept.len(), 0.0));
    (kept, rows.concat())
}

/// Solves `L Lᵀ x = b` in place.
pub fn cholesky_solve(l: &[f64], n: usize, b: &mut [f64]) {
    for k in 0..n {
        b[k] = (b[k] - dot(&l[k * n..k * n + k], &b[..k])) / l[k * n + k];
    }
    for k in (0..n).rev() {
        b[k] /= l[k * n + k];
        let (head, tail) = b.split_at_mut(k);
        axpy(-tail[0], &l[k * n..k * n + k], head);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn cholesky_agrees_with_nalgebra(n in 1_usize..8, seed in prop::collection::vec(-1.0..1.0_f64, 64 + 8)) {
            let a = DMatrix::from_row_slice(n, n, &seed[..n * n]) + DMatrix::identity(n, n) * 0.1;
            let b = DVector::from_column_slice(&seed[64..64 + n]);
            let spd = &a * a.transpose() + DMatrix::identity(n, n) * 1e-3;
            let mut l = spd.as_slice().to_vec();
            prop_assert!(cholesky(&mut l, n));
            let mut x = b.as_slice().to_vec();
            cholesky_solve(&l, n, &mut x);
            prop_assert!((&spd * DVector::from_vec(x) - &b).amax() < 1e-9);
        }
    }

    #[test]
    fn dependent_rows_are_left_out() {
        // Rows 1 and 3 are row 0 and the sum of rows 0 and 2, over [1, 2, 0], [0, 1, 1].
        let rows = [
            [1.0, 2.0, 0.0],
            [1.0, 2.0, 0.0],
            [0.0, 1.0, 1.0],
            [1.0, 3.0, 1.0],
        ];
        let gram: Vec<f64> = (rows.iter())
            .flat_map(|r| rows.iter().map(move |s| dot(r, s)))
            .collect();
        let (kept, factor) = independent_cholesky(4, 1e-14, |i, j| gram[i * 4 + j]);
        assert_eq!(kept, [0, 2]);
        let mut x = [7.0, 4.0];
        cholesky_solve(&factor, 2, &mut x);
        // [5 2; 2 2] x = [7; 4]
        assert!(
            (x[0] - 1.0).abs() < 1e-14 && (x[1] - 1.0).abs() < 1e-14,
            "{x:?}"
        );
    }

    #[test]
    fn cholesky_refuses_an_indefinite_matrix() {
        assert!(!cholesky(&mut [1.0, 2.0, 2.0, 1.0], 2));
    }
}
