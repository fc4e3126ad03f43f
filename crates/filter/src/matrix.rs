//! Small dense matrices of jets.

use crate::jet::Jet;

/// A matrix, stored by rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix<const N: usize> {
    columns: usize,
    entries: Vec<Jet<N>>,
}

impl<const N: usize> Matrix<N> {
    /// The zero matrix.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            columns,
            entries: vec![Jet::constant(0.0); rows * columns],
        }
    }

    /// The identity.
    pub fn identity(size: usize) -> Self {
        let mut own = Self::zeros(size, size);
        (0..size).for_each(|k| own.entries[k * size + k] = Jet::constant(1.0));
        own
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.entries.len().checked_div(self.columns).unwrap_or(0)
    }

    /// A row.
    pub fn row(&self, i: usize) -> &[Jet<N>] {
        &self.entries[i * self.columns..][..self.columns]
    }

    /// An entry.
    pub fn at(&mut self, i: usize, j: usize) -> &mut Jet<N> {
        &mut self.entries[i * self.columns + j]
    }

    /// The product with another.
    pub fn times(&self, other: &Self) -> Self {
        let mut product = Self::zeros(self.rows(), other.columns);
        for (i, row) in product.entries.chunks_exact_mut(other.columns).enumerate() {
            for (k, factor) in self.row(i).iter().enumerate() {
                let pairs = row.iter_mut().zip(other.row(k));
                pairs.for_each(|(sum, entry)| *sum += *factor * *entry);
            }
        }
        product
    }

    /// The product with a vector.
    pub fn apply(&self, vector: &[Jet<N>]) -> Vec<Jet<N>> {
        (0..self.rows()).map(|i| dot(self.row(i), vector)).collect()
    }

    /// The transpose.
    pub fn transposed(&self) -> Self {
        let mut own = Self::zeros(self.columns, self.rows());
        for i in 0..self.rows() {
            (0..self.columns).for_each(|j| *own.at(j, i) = self.row(i)[j]);
        }
        own
    }

    /// `A B Aᵀ` with `A = self` and a symmetric `B`.
    pub fn around(&self, inner: &Self) -> Self {
        self.times(inner).times(&self.transposed())
    }

    /// The product with a number.
    pub fn scaled(&self, factor: f64) -> Self {
        let entries = self.entries.iter().map(|own| own.scaled(factor));
        Self {
            columns: self.columns,
            entries: entries.collect(),
        }
    }

    /// Adds a matrix of the same size.
    pub fn add(&mut self, other: &Self) {
        let pairs = self.entries.iter_mut().zip(&other.entries);
        pairs.for_each(|(own, other)| *own += *other);
    }

    /// Subtracts `v vᵀ / s`.
    pub fn subtract_square(&mut self, v: &[Jet<N>], s: Jet<N>) {
        for (row, a) in self.entries.chunks_exact_mut(v.len().max(1)).zip(v) {
            let gain = *a / s;
            row.iter_mut().zip(v).for_each(|(own, b)| *own -= gain * *b);
        }
    }

    /// Maximum row sum of the magnitudes of the values.
    pub fn norm(&self) -> f64 {
        let sum = |i: usize| self.row(i).iter().map(|own| own.value.abs()).sum::<f64>();
        let sums = (0..self.rows()).map(sum);
        sums.fold(0.0, f64::max)
    }
}

/// The scalar product of two vectors.
pub fn dot<const N: usize>(a: &[Jet<N>], b: &[Jet<N>]) -> Jet<N> {
    let products = a.iter().zip(b).map(|(a, b)| *a * *b);
    products.fold(Jet::constant(0.0), |sum, own| sum + own)
}
