//! Small dense matrices, row by row.

use pilotage_collocation::condensed::dense::axpy;
pub(crate) use pilotage_collocation::condensed::dense::dot;
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

    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.columns..(i + 1) * self.columns]
    }

    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.values[i * self.columns..(i + 1) * self.columns]
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
                axpy(-factor, &own[k + 1..], &mut row[k + 1..]);
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
                axpy(-self.factors[(i, j)], before, &mut own[..m]);
            }
        }
        for i in (0..n).rev() {
            let (own, after) = x.values.split_at_mut((i + 1) * m);
            let own = &mut own[i * m..];
            for (j, after) in after.chunks_exact(m.max(1)).enumerate() {
                axpy(-self.factors[(i, i + 1 + j)], after, own);
            }
            let pivot = self.factors[(i, i)];
            own.iter_mut().for_each(|own| *own /= pivot);
        }
        *b = x;
    }
}
