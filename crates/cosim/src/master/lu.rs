//! A dense matrix factored in place, so that it can be updated in the stepping loop without allocation.

use serde::{Deserialize, Serialize};

/// Pivots below this part of the largest entry are noise of finite differences.
pub(super) const SINGULAR: f64 = 1e-8;

/// A square matrix in row-major order; after [`factor`](Self::factor) its LU decomposition with partial pivoting, of rows and
/// columns scaled to entries of at most about one: outputs have units of any size.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Lu {
    n: usize,
    entries: Vec<f64>,
    pivots: Vec<usize>,
    rows: Vec<f64>,
    columns: Vec<f64>,
}

impl Lu {
    pub(super) fn new(n: usize) -> Self {
        Self {
            n,
            entries: vec![0.0; n * n],
            pivots: vec![0; n],
            rows: vec![1.0; n],
            columns: vec![1.0; n],
        }
    }

    /// Whether it is of the size of another one.
    pub(super) fn fits(&self, other: &Self) -> bool {
        let sizes = |own: &Self| {
            let (entries, pivots) = (own.entries.len(), own.pivots.len());
            (own.n, entries, pivots, own.rows.len(), own.columns.len())
        };
        sizes(self) == sizes(other) && self.pivots.iter().all(|own| *own < self.n)
    }

    pub(super) fn set_identity(&mut self) {
        self.entries.fill(0.0);
        for i in 0..self.n {
            self.entries[i * self.n + i] = 1.0;
        }
    }

    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        self.entries[row * self.n + column] += value;
    }

    /// Factors the matrix; `false` if a pivot of the scaled matrix is not finite or below `singular` times its largest entry
    /// (entries from finite differences are never exactly singular).
    #[must_use]
    pub(super) fn factor(&mut self, singular: f64) -> bool {
        let n = self.n;
        self.scale();
        let largest = self.entries.iter().fold(0.0_f64, |max, v| max.max(v.abs()));
        for k in 0..n {
            let size = |&i: &usize| self.entries[i * n + k].abs();
            let best = (k..n).max_by(|a, b| size(a).total_cmp(&size(b)));
            let pivot = best.unwrap_or(k);
            self.pivots[k] = pivot;
            for j in 0..n {
                self.entries.swap(k * n + j, pivot * n + j);
            }
            let diagonal = self.entries[k * n + k];
            if diagonal.abs() <= singular * largest || !diagonal.is_finite() {
                return false;
            }
            let (above, below) = self.entries.split_at_mut((k + 1) * n);
            let row = &above[k * n..];
            for other in below.chunks_exact_mut(n) {
                let factor = other[k] / diagonal;
                other[k] = factor;
                if factor != 0.0 {
                    let pairs = other[k + 1..].iter_mut().zip(&row[k + 1..]);
                    pairs.for_each(|(a, b)| *a -= factor * b);
                }
            }
        }
        true
    }

    /// Scales rows, then columns, by powers of two, which round nothing.
    fn scale(&mut self) {
        let n = self.n;
        let power = |largest: f64| match largest > 0.0 && largest.is_finite() {
            true => largest.log2().round().exp2().recip(),
            false => 1.0,
        };
        for (row, scale) in self.entries.chunks_exact_mut(n.max(1)).zip(&mut self.rows) {
            *scale = power(row.iter().fold(0.0, |max, v| max.max(v.abs())));
            row.iter_mut().for_each(|v| *v *= *scale);
        }
        for (j, scale) in self.columns.iter_mut().enumerate() {
            let column = self.entries[j..].iter().step_by(n);
            *scale = power(column.fold(0.0, |max, v| max.max(v.abs())));
            let column = self.entries[j..].iter_mut().step_by(n);
            column.for_each(|v| *v *= *scale);
        }
    }

    /// Solves with the factored matrix, in place.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let n = self.n;
        x.iter_mut()
            .zip(&self.rows)
            .for_each(|(x, scale)| *x *= scale);
        for k in 0..n {
            x.swap(k, self.pivots[k]);
        }
        for i in 0..n {
            let row = &self.entries[i * n..(i + 1) * n];
            let known: f64 = row[..i].iter().zip(&x[..i]).map(|(a, b)| a * b).sum();
            x[i] -= known;
        }
        for i in (0..n).rev() {
            let row = &self.entries[i * n..(i + 1) * n];
            let (_, later) = x.split_at(i + 1);
            let known: f64 = row[i + 1..].iter().zip(later).map(|(a, b)| a * b).sum();
            x[i] = (x[i] - known) / row[i];
        }
        x.iter_mut()
            .zip(&self.columns)
            .for_each(|(x, scale)| *x *= scale);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_what_needs_pivots() {
        // Row sums of [[0, 2, 1], [1, 0, 3], [2, 4, 0]] for x = (1, 2, 3).
        let mut lu = Lu::new(3);
        for (i, row) in [[0.0, 2.0, 1.0], [1.0, 0.0, 3.0], [2.0, 4.0, 0.0]]
            .iter()
            .enumerate()
        {
            for (j, &value) in row.iter().enumerate() {
                lu.add(i, j, value);
            }
        }
        assert!(lu.factor(1e-14));
        let mut x = [7.0, 10.0, 10.0];
        lu.solve(&mut x);
        for (found, expected) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-14, "{x:?}");
        }
    }

    /// `x = 3e10 y`, `y = -1e-10 x + 4`: outputs in small and in large units.
    #[test]
    fn units_of_any_size_are_no_singularity() {
        let mut lu = Lu::new(2);
        for (k, value) in [1.0, -3e10, 1e-10, 1.0].into_iter().enumerate() {
            lu.add(k / 2, k % 2, value);
        }
        assert!(lu.factor(1e-8));
        let mut x = [0.0, 4.0];
        lu.solve(&mut x);
        assert!(
            (x[0] / 3e10 - 1.0).abs() < 1e-14 && (x[1] - 1.0).abs() < 1e-14,
            "{x:?}"
        );
    }

    #[test]
    fn singular_is_said() {
        for entries in [[1.0, 2.0, 2.0, 4.0], [f64::NAN, 1.0, 1.0, 1.0], [0.0; 4]] {
            let mut lu = Lu::new(2);
            for (k, value) in entries.into_iter().enumerate() {
                lu.add(k / 2, k % 2, value);
            }
            assert!(!lu.factor(1e-14), "{entries:?}");
        }
    }
}
