//! Restricted maximum likelihood of autoregressive noise in the residuals of a fit.

use crate::autoregression::{Autoregression, Segment};
use nalgebra::DMatrix;
use std::borrow::Cow;

/// Part of a column that is rounding.
const ROUNDING: f64 = 1e-8;
/// Largest partial autocorrelation.
pub const LARGEST: f64 = 0.9995;
/// Rounds over all partial autocorrelations.
const ROUNDS: usize = 3;

/// The restricted likelihood of all processes up to an order, from sums of products that do not depend on them.
pub struct Likelihood<'s> {
    segments: &'s [Segment],
    most: usize,
    /// For each segment, `Σ_t x_(t-i) x_(t-j)ᵀ` for i ≤ j over the rows from `most` on.
    products: Vec<Vec<DMatrix<f64>>>,
}

impl<'s> Likelihood<'s> {
    pub fn new(segments: &'s [Segment], most: usize) -> Self {
        let of = |own: &Segment| {
            let count = own.rows.nrows().saturating_sub(most);
            let rows = |lag: usize| own.rows.rows((most - lag) * usize::from(count > 0), count);
            let pairs = (0..=most).flat_map(|i| (i..=most).map(move |j| (i, j)));
            pairs.map(|(i, j)| rows(i).tr_mul(&rows(j))).collect()
        };
        Self {
            products: segments.iter().map(of).collect(),
            segments,
            most,
        }
    }

    /// −2 log of it, but for constants, and the variance of the innovations.
    pub fn value(&self, partial: &[f64]) -> (f64, f64) {
        let process = Autoregression::new(partial);
        let whitened = self
            .segments
            .iter()
            .zip(&self.products)
            .map(|(own, products)| {
                let mut gram = self.interior(&process, products);
                let mut sum = 0.0;
                for t in 0..self.most.min(own.rows.nrows()) {
                    let order = t.min(partial.len());
                    sum += add_row(
                        &mut gram,
                        own,
                        t,
                        &process.predictors[order],
                        process.left[order],
                    );
                }
                (gram, sum)
            });
        restricted(self.segments, whitened)
    }

    /// Whitened products of the rows from `most` on.
    fn interior(&self, process: &Autoregression, products: &[DMatrix<f64>]) -> DMatrix<f64> {
        let predictor = &process.predictors[process.predictors.len() - 1];
        let a = |lag: usize| match lag {
            0 => 1.0,
            _ => predictor.get(lag - 1).map_or(0.0, |a| -a),
        };
        let size = products[0].nrows();
        let mut gram = DMatrix::zeros(size, size);
        let pairs = (0..=self.most).flat_map(|i| (i..=self.most).map(move |j| (i, j)));
        for ((i, j), product) in pairs.zip(products) {
            let factor = a(i) * a(j);
            if factor != 0.0 && i == j {
                gram += factor * product;
            } else if factor != 0.0 {
                gram += factor * (product + product.transpose());
            }
        }
        gram
    }

    /// The partial autocorrelations that make it largest, near these: one after the other along their inverse
    /// hyperbolic tangents, by golden sections.
    pub fn maximised(&self, mut partial: Vec<f64>) -> Vec<f64> {
        let mut reach = 1.5;
        for _ in 0..ROUNDS {
            for k in 0..partial.len() {
                let middle = partial[k].atanh();
                let at = |u: f64| {
                    let mut other = partial.clone();
                    other[k] = u.tanh().clamp(-LARGEST, LARGEST);
                    self.value(&other).0
                };
                let best = golden(at, middle - reach, middle + reach);
                partial[k] = best.tanh().clamp(-LARGEST, LARGEST);
            }
            reach *= 0.3;
        }
        partial
    }
}

/// Adds a whitened row to products of them; returns the logarithm of its variance.
fn add_row(gram: &mut DMatrix<f64>, of: &Segment, t: usize, predictor: &[f64], left: f64) -> f64 {
    let mut row = of.rows.row(t).into_owned();
    for (k, a) in predictor.iter().enumerate() {
        row -= *a * of.rows.row(t - 1 - k);
    }
    *gram += row.transpose() * row / left;
    left.ln()
}

/// The restricted likelihood of a process that predicts each row of a segment so, with the variance that is left: as
/// [`Likelihood::value`], row by row.
pub fn of_whitened<'p>(
    segments: &[Segment],
    step: impl Fn(&Segment, usize) -> (Cow<'p, [f64]>, f64),
) -> (f64, f64) {
    let whitened = segments.iter().map(|own| {
        let (mut gram, mut sum) = (DMatrix::zeros(own.rows.ncols(), own.rows.ncols()), 0.0);
        for t in 0..own.rows.nrows() {
            let (predictor, left) = step(own, t);
            sum += add_row(&mut gram, own, t, &predictor, left);
        }
        (gram, sum)
    });
    restricted(segments, whitened)
}

/// −2 log of the restricted likelihood, but for constants, and the variance, from the whitened products of each segment and
/// the logarithm of the determinant of its covariance.
fn restricted(
    segments: &[Segment],
    whitened: impl Iterator<Item = (DMatrix<f64>, f64)>,
) -> (f64, f64) {
    let shared = segments[0].rows.ncols() - segments[0].own;
    let (mut sum, mut rank, mut count) = (0.0, 0, 0);
    let mut rest = DMatrix::zeros(shared, shared);
    for (own, (mut gram, determinant)) in segments.iter().zip(whitened) {
        let (log, own_rank) = eliminate(&mut gram, own.own);
        sum += log + determinant;
        rank += own_rank;
        count += own.rows.nrows();
        let first = own.own;
        rest += gram.view((first, first), (gram.nrows() - first, gram.nrows() - first));
    }
    let last = rest.nrows() - 1;
    let (log, own_rank) = eliminate(&mut rest, last);
    let degrees = count.saturating_sub(rank + own_rank).max(1) as f64;
    let variance = (rest[(last, last)] / degrees).max(f64::MIN_POSITIVE);
    (sum + log + degrees * variance.ln(), variance)
}

/// Sum of logarithms of the pivots of the first columns, and their number; the matrix becomes what they leave.
fn eliminate(gram: &mut DMatrix<f64>, count: usize) -> (f64, usize) {
    let (n, diagonal) = (gram.nrows(), gram.diagonal());
    let (mut log, mut rank) = (0.0, 0);
    for k in 0..count {
        let pivot = gram[(k, k)];
        if pivot <= ROUNDING * diagonal[k] || pivot <= 0.0 {
            continue;
        }
        log += pivot.ln();
        rank += 1;
        for i in k + 1..n {
            let factor = gram[(i, k)] / pivot;
            for j in k + 1..n {
                let change = factor * gram[(k, j)];
                gram[(i, j)] -= change;
            }
        }
    }
    (log, rank)
}

/// Where a function is least between two numbers.
pub fn golden(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const PART: f64 = 0.381_966_011_250_105;
    let inner = |low: f64, high: f64| (low + PART * (high - low), high - PART * (high - low));
    let (mut a, mut b) = inner(low, high);
    let (mut of_a, mut of_b) = (f(a), f(b));
    while high - low > 1e-3 {
        if of_a < of_b {
            (high, b, of_b) = (b, a, of_a);
            a = inner(low, high).0;
            of_a = f(a);
        } else {
            (low, a, of_a) = (a, b, of_b);
            b = inner(low, high).1;
            of_b = f(b);
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::autoregression::tests::autocovariances;
    use nalgebra::DVector;

    /// The restricted likelihood, written out with dense matrices.
    #[test]
    fn the_likelihood_is_that_of_dense_matrices() {
        let (a, b, n) = (0.6, 0.2, 15);
        let r = autocovariances(a, b, n);
        let sigma = DMatrix::from_fn(n, n, |i, j| r[i.abs_diff(j)]);
        let x = DMatrix::from_fn(n, 3, |t, i| (0.3 * t as f64 * (i + 1) as f64).cos());
        let e = DVector::from_fn(n, |t, _| (1.3 * t as f64).sin() + 0.1 * t as f64);
        let mut rows = x.clone().resize_horizontally(4, 0.0);
        rows.set_column(3, &e);
        let segments = [Segment {
            own: 1,
            rows,
            time: (0..n).map(|t| t as f64).collect(),
        }];
        let (value, variance) = Likelihood::new(&segments, 4).value(&[a / (1.0 - b), b]);
        let inverse = sigma.clone().try_inverse().expect("regular");
        let h = x.transpose() * &inverse * &x;
        let rest = e.transpose()
            * (&inverse
                - &inverse
                    * &x
                    * h.clone().try_inverse().expect("regular")
                    * x.transpose()
                    * &inverse)
            * &e;
        let s2 = rest[0] / 12.0;
        let expected = 12.0 * s2.ln() + sigma.determinant().ln() + h.determinant().ln();
        assert!((variance - s2).abs() < 1e-10 * s2, "{variance} {s2}");
        assert!((value - expected).abs() < 1e-8, "{value} {expected}");
        // Row by row it is the same.
        let process = Autoregression::new(&[a / (1.0 - b), b]);
        let step = |_: &Segment, t: usize| {
            let order = t.min(2);
            (
                Cow::Borrowed(&process.predictors[order][..]),
                process.left[order],
            )
        };
        let (again, _) = of_whitened(&segments, step);
        assert!((again - expected).abs() < 1e-8, "{again} {expected}");
    }
}
