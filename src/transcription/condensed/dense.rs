//! Small dense kernels on row-major slices, sized at run time and free of allocation.

/// `y += a x`.
pub fn axpy(a: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

/// Scalar product.
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// LU factorisation with partial pivoting in place, `n × n`; false when a pivot is zero.
///
/// Row `k` was exchanged with row `pivots[k]`; the unit lower factor lies below the diagonal.
pub fn lu_factor(a: &mut [f64], n: usize, pivots: &mut [usize]) -> bool {
    for k in 0..n {
        let mut pivot = k;
        for i in k + 1..n {
            if a[i * n + k].abs() > a[pivot * n + k].abs() {
                pivot = i;
            }
        }
        pivots[k] = pivot;
        if pivot != k {
            for j in 0..n {
                a.swap(k * n + j, pivot * n + j);
            }
        }
        let diagonal = a[k * n + k];
        if diagonal == 0.0 || !diagonal.is_finite() {
            return false;
        }
        let (upper, lower) = a.split_at_mut((k + 1) * n);
        let row = &upper[k * n + k + 1..];
        for row_i in lower.chunks_exact_mut(n) {
            let factor = row_i[k] / diagonal;
            row_i[k] = factor;
            if factor != 0.0 {
                axpy(-factor, row, &mut row_i[k + 1..]);
            }
        }
    }
    true
}

/// Solves `A X = B` in place for the `columns` right-hand sides in `b`, `n × columns`.
pub fn lu_solve(lu: &[f64], n: usize, pivots: &[usize], b: &mut [f64], columns: usize) {
    for (k, &pivot) in pivots.iter().enumerate() {
        if pivot != k {
            for j in 0..columns {
                b.swap(k * columns + j, pivot * columns + j);
            }
        }
    }
    for k in 0..n {
        let (done, rest) = b.split_at_mut(k * columns);
        for (i, row) in done.chunks_exact(columns).enumerate() {
            let factor = lu[k * n + i];
            if factor != 0.0 {
                axpy(-factor, row, &mut rest[..columns]);
            }
        }
    }
    for k in (0..n).rev() {
        let (head, solved) = b.split_at_mut((k + 1) * columns);
        let row = &mut head[k * columns..];
        for (i, other) in solved.chunks_exact(columns).enumerate() {
            let factor = lu[k * n + k + 1 + i];
            if factor != 0.0 {
                axpy(-factor, other, row);
            }
        }
        let inverse = 1.0 / lu[k * n + k];
        row.iter_mut().for_each(|v| *v *= inverse);
    }
}

/// Solves `Aᵀ x = b` in place for one right-hand side.
pub fn lu_solve_transposed(lu: &[f64], n: usize, pivots: &[usize], b: &mut [f64]) {
    for k in 0..n {
        b[k] /= lu[k * n + k];
        let (head, tail) = b.split_at_mut(k + 1);
        axpy(-head[k], &lu[k * n + k + 1..(k + 1) * n], tail);
    }
    for k in (0..n).rev() {
        let (head, tail) = b.split_at_mut(k);
        axpy(-tail[0], &lu[k * n..k * n + k], head);
    }
    for (k, &pivot) in pivots.iter().enumerate().rev() {
        b.swap(k, pivot);
    }
}

/// Cholesky factorisation in place, lower triangle, `n × n`; false when not positive definite.
pub fn cholesky(a: &mut [f64], n: usize) -> bool {
    // A pivot that is rounding beside the diagonal it came from is not positive.
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
        fn lu_and_cholesky_agree_with_nalgebra(n in 1_usize..8, seed in prop::collection::vec(-1.0..1.0_f64, 64 + 8)) {
            let a = DMatrix::from_row_slice(n, n, &seed[..n * n]) + DMatrix::identity(n, n) * 0.1;
            let b = DVector::from_column_slice(&seed[64..64 + n]);
            prop_assume!(a.determinant().abs() > 1e-3);
            let mut lu: Vec<f64> = a.transpose().as_slice().to_vec();
            let mut pivots = vec![0; n];
            prop_assert!(lu_factor(&mut lu, n, &mut pivots));
            let mut x = b.as_slice().to_vec();
            lu_solve(&lu, n, &pivots, &mut x, 1);
            prop_assert!((&a * DVector::from_vec(x) - &b).amax() < 1e-9);
            let mut x = b.as_slice().to_vec();
            lu_solve_transposed(&lu, n, &pivots, &mut x);
            prop_assert!((a.transpose() * DVector::from_vec(x) - &b).amax() < 1e-9);
            let spd = &a * a.transpose() + DMatrix::identity(n, n) * 1e-3;
            let mut l = spd.as_slice().to_vec();
            prop_assert!(cholesky(&mut l, n));
            let mut x = b.as_slice().to_vec();
            cholesky_solve(&l, n, &mut x);
            prop_assert!((&spd * DVector::from_vec(x) - &b).amax() < 1e-9);
        }
    }

    #[test]
    fn cholesky_refuses_an_indefinite_matrix() {
        assert!(!cholesky(&mut [1.0, 2.0, 2.0, 1.0], 2));
    }
}
