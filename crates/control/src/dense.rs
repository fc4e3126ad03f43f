//! Small dense matrices, row by row.

use std::ops::{Index, IndexMut};

/// A matrix.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Matrix {
    pub columns: usize,
    pub values: Vec<f64>,
}

impl Matrix {
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            columns,
            values: vec![0.0; rows * columns],
        }
    }

    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.columns..(i + 1) * self.columns]
    }

    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.values[i * self.columns..(i + 1) * self.columns]
    }

    /// `out += self v`, over the rows that `out` has.
    pub fn add_times(&self, v: &[f64], out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out += dot(self.row(i), v);
        }
    }

    /// `out += selfᵀ v`.
    pub fn add_transposed_times(&self, v: &[f64], out: &mut [f64]) {
        for (i, v) in v.iter().enumerate() {
            add(*v, self.row(i), out);
        }
    }
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;

    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        &self.values[i * self.columns + j]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        &mut self.values[i * self.columns + j]
    }
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `out += factor v`.
#[inline]
pub(crate) fn add(factor: f64, v: &[f64], out: &mut [f64]) {
    if factor != 0.0 {
        out.iter_mut()
            .zip(v)
            .for_each(|(out, v)| *out += factor * v);
    }
}

/// LU factors with row exchanges.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lu {
    factors: Matrix,
    rows: Vec<usize>,
}

impl Lu {
    /// Factors a square matrix; `None` if it is singular.
    pub fn of(mut a: Matrix) -> Option<Self> {
        let n = a.columns;
        let mut rows: Vec<usize> = (0..n).collect();
        for k in 0..n {
            let largest = |i: &usize, j: &usize| a[(*i, k)].abs().total_cmp(&a[(*j, k)].abs());
            let pivot = (k..n).max_by(largest)?;
            if a[(pivot, k)] == 0.0 || a[(pivot, k)].is_nan() {
                return None;
            }
            if pivot != k {
                rows.swap(pivot, k);
                let (upper, lower) = a.values.split_at_mut(pivot * n);
                upper[k * n..(k + 1) * n].swap_with_slice(&mut lower[..n]);
            }
            let (upper, lower) = a.values.split_at_mut((k + 1) * n);
            let own = &upper[k * n..];
            for row in lower.chunks_exact_mut(n) {
                let factor = row[k] / own[k];
                row[k] = factor;
                add(-factor, &own[k + 1..], &mut row[k + 1..]);
            }
        }
        Some(Self { factors: a, rows })
    }

    /// Solves for all columns of `b`, which become the solution.
    pub fn solve(&self, b: &mut Matrix) {
        let (n, m) = (self.rows.len(), b.columns);
        let mut x = Matrix::zeros(n, m);
        for (i, row) in self.rows.iter().enumerate() {
            x.row_mut(i).copy_from_slice(b.row(*row));
            let (before, own) = x.values.split_at_mut(i * m);
            for (j, before) in before.chunks_exact(m.max(1)).enumerate() {
                add(-self.factors[(i, j)], before, &mut own[..m]);
            }
        }
        for i in (0..n).rev() {
            let (own, after) = x.values.split_at_mut((i + 1) * m);
            let own = &mut own[i * m..];
            for (j, after) in after.chunks_exact(m.max(1)).enumerate() {
                add(-self.factors[(i, i + 1 + j)], after, own);
            }
            let pivot = self.factors[(i, i)];
            own.iter_mut().for_each(|own| *own /= pivot);
        }
        *b = x;
    }

    /// Solves `selfᵀ x = b`.
    pub fn solve_transposed(&self, b: &[f64]) -> Vec<f64> {
        let n = self.rows.len();
        let mut y = b.to_vec();
        for i in 0..n {
            y[i] /= self.factors[(i, i)];
            let (own, after) = y.split_at_mut(i + 1);
            add(-own[i], &self.factors.row(i)[i + 1..], after);
        }
        for i in (0..n).rev() {
            let (before, own) = y.split_at_mut(i);
            add(-own[0], &self.factors.row(i)[..i], before);
        }
        let mut x = vec![0.0; n];
        for (value, row) in y.iter().zip(&self.rows) {
            x[*row] = *value;
        }
        x
    }
}

/// The Cholesky factor of a symmetric positive definite matrix.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cholesky {
    factor: Matrix,
}

impl Cholesky {
    /// `None` if the matrix is not positive definite beyond rounding.
    pub fn of(mut a: Matrix) -> Option<Self> {
        const ROUNDING: f64 = 1e-14;
        let n = a.columns;
        for i in 0..n {
            for j in 0..=i {
                let sum = a[(i, j)] - dot(&a.row(i)[..j], &a.row(j)[..j]);
                if i == j {
                    let least = ROUNDING * a[(i, i)].abs();
                    if sum <= least || !sum.is_finite() {
                        return None;
                    }
                    a[(i, i)] = sum.sqrt();
                } else {
                    a[(i, j)] = sum / a[(j, j)];
                }
            }
        }
        Some(Self { factor: a })
    }

    pub fn solve(&self, b: &mut [f64]) {
        let n = self.factor.columns;
        for i in 0..n {
            b[i] = (b[i] - dot(&self.factor.row(i)[..i], &b[..i])) / self.factor[(i, i)];
        }
        for i in (0..n).rev() {
            b[i] /= self.factor[(i, i)];
            let (before, own) = b.split_at_mut(i);
            add(-own[0], &self.factor.row(i)[..i], before);
        }
    }
}
