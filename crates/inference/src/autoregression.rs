//! Autoregressive noise, estimated from residuals with the bias that the fit leaves in them taken off.
//!
//! A fit takes from its residuals what its unknowns can follow, so that they look less coloured than the noise is.
//! Restricted maximum likelihood is free of that bias to first order (Cheang & Reinsel, *Bias reduction of
//! autoregressive estimates in time series regression model through restricted maximum likelihood*, J. Am. Stat. Assoc.
//! 95, 2000). The process is told by its partial autocorrelations, which are stationary below one (Barndorff-Nielsen &
//! Schou, J. Multivar. Anal. 3, 1973); the order is that of Akaike's criterion.

use nalgebra::DMatrix;

/// Highest order.
const MOST: usize = 8;
/// Rows of a run for each order.
const ROWS: usize = 10;
/// Largest partial autocorrelation.
const LARGEST: f64 = 0.9995;
/// Rounds over all partial autocorrelations.
const ROUNDS: usize = 3;
/// Part of a column that is rounding.
const ROUNDING: f64 = 1e-8;

/// An autoregressive process.
#[derive(Debug, Clone, PartialEq)]
pub struct Autoregression {
    /// Predictors of all orders up to its own: `predictors[k]` has `k` coefficients, the nearest value's first.
    predictors: Vec<Vec<f64>>,
    /// Variances of what each order leaves, per innovation.
    left: Vec<f64>,
    /// Variance of the innovations.
    pub variance: f64,
}

/// A run's rows of one signal: columns of the run's own unknowns, of the shared ones, and the residuals.
#[derive(Debug, Clone)]
pub struct Segment {
    pub own: usize,
    pub rows: DMatrix<f64>,
}

impl Autoregression {
    /// Of these partial autocorrelations; innovations of unit variance (Durbin and Levinson).
    pub fn new(partial: &[f64]) -> Self {
        let mut predictors = vec![Vec::new()];
        for k in partial {
            let last: &Vec<f64> = &predictors[predictors.len() - 1];
            let reversed = last.iter().rev();
            let mut next: Vec<f64> = last.iter().zip(reversed).map(|(a, b)| a - k * b).collect();
            next.push(*k);
            predictors.push(next);
        }
        let mut left = vec![1.0];
        for k in partial.iter().rev() {
            left.push(left[left.len() - 1] / (1.0 - k * k));
        }
        left.reverse();
        Self {
            predictors,
            left,
            variance: 1.0,
        }
    }

    /// The process in the residuals of a signal.
    pub fn estimated(segments: &[Segment]) -> Self {
        let shortest = segments
            .iter()
            .map(|own| own.rows.nrows())
            .max()
            .unwrap_or(0);
        let most = MOST.min(shortest / ROWS);
        let likelihood = Likelihood::new(segments, most);
        let first = partial(segments, most);
        let count: usize = segments.iter().map(|own| own.rows.nrows()).sum();
        // Hurvich & Tsai, Biometrika 76, 1989.
        let criterion = |order: usize| {
            let (n, k) = (count as f64, order as f64 + 1.0);
            let penalty = 2.0 * k * n / (n - k - 1.0).max(1.0);
            likelihood.value(&first[..order]).0 + penalty
        };
        let orders = (0..=most).map(|order| (order, criterion(order)));
        let best = orders.min_by(|a, b| a.1.total_cmp(&b.1));
        let order = best.map_or(0, |(order, _)| order);
        let partial = likelihood.maximised(first[..order].to_vec());
        Self {
            variance: likelihood.value(&partial).1,
            ..Self::new(&partial)
        }
    }

    /// `√Σ Wᵀ`-transformed rows: `C` with `CᵀC = JᵀΣJ`, for rows `J` in the order of time and the covariance `Σ` of as
    /// many values.
    pub fn coloured(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let order = self.predictors.len() - 1;
        let mut out = rows.clone();
        for t in (0..rows.nrows()).rev() {
            let own = out.row(t).into_owned();
            for (k, a) in self.predictors[t.min(order)].iter().enumerate() {
                let mut before = out.row_mut(t - 1 - k);
                before += *a * &own;
            }
            let scale = (self.variance * self.left[t.min(order)]).sqrt();
            out.set_row(t, &(scale * own));
        }
        out
    }

    /// So many values of the process, from innovations of unit variance: stationary from the first on.
    pub fn simulated(&self, count: usize, mut innovation: impl FnMut() -> f64) -> Vec<f64> {
        let order = self.predictors.len() - 1;
        let mut values: Vec<f64> = Vec::with_capacity(count);
        for t in 0..count {
            let predictor = &self.predictors[t.min(order)];
            let before = predictor.iter().zip(values.iter().rev());
            let expected: f64 = before.map(|(a, x)| a * x).sum();
            let sd = (self.variance * self.left[t.min(order)]).sqrt();
            values.push(expected + sd * innovation());
        }
        values
    }

    /// White noise with the variance of this process.
    pub fn white(&self) -> Self {
        Self {
            variance: self.variance * self.left[0],
            ..Self::new(&[])
        }
    }
}

/// Partial autocorrelations of the residuals as they are (Levinson).
fn partial(segments: &[Segment], order: usize) -> Vec<f64> {
    let lag = |k: usize| -> f64 {
        let of = |own: &Segment| {
            let e = own.rows.column(own.rows.ncols() - 1);
            (k..e.len()).map(|t| e[t] * e[t - k]).sum::<f64>()
        };
        segments.iter().map(of).sum()
    };
    let r: Vec<f64> = (0..=order).map(lag).collect();
    let mut found: Vec<f64> = Vec::new();
    for k in 1..=order {
        let so_far = Autoregression::new(&found);
        let a = &so_far.predictors[k - 1];
        let error = r[0] - a.iter().zip(&r[1..]).map(|(a, r)| a * r).sum::<f64>();
        let next = r[k]
            - a.iter()
                .zip(r[1..k].iter().rev())
                .map(|(a, r)| a * r)
                .sum::<f64>();
        let partial = if error > 0.0 { next / error } else { 0.0 };
        found.push(partial.clamp(-LARGEST, LARGEST));
    }
    found
}

/// The restricted likelihood of all processes up to an order, from sums of products that do not depend on them.
struct Likelihood<'s> {
    segments: &'s [Segment],
    most: usize,
    /// For each segment, `Σ_t x_(t-i) x_(t-j)ᵀ` for i ≤ j over the rows from `most` on.
    products: Vec<Vec<DMatrix<f64>>>,
}

impl<'s> Likelihood<'s> {
    fn new(segments: &'s [Segment], most: usize) -> Self {
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
    fn value(&self, partial: &[f64]) -> (f64, f64) {
        let process = Autoregression::new(partial);
        let columns = self.segments[0].rows.ncols();
        let (mut sum, mut rank, mut count) = (0.0, 0, 0);
        let shared = columns - self.segments[0].own;
        let mut rest = DMatrix::zeros(shared, shared);
        for (own, products) in self.segments.iter().zip(&self.products) {
            let mut gram = self.interior(&process, products);
            for t in 0..self.most.min(own.rows.nrows()) {
                let order = t.min(partial.len());
                let mut row = own.rows.row(t).into_owned();
                for (k, a) in process.predictors[order].iter().enumerate() {
                    row -= *a * own.rows.row(t - 1 - k);
                }
                sum += process.left[order].ln();
                gram += row.transpose() * row / process.left[order];
            }
            let (log, own_rank) = eliminate(&mut gram, own.own);
            sum += log;
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
    fn maximised(&self, mut partial: Vec<f64>) -> Vec<f64> {
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
fn golden(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
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
    use nalgebra::DVector;

    /// Autocovariances of `x_t = a x_(t-1) + b x_(t-2) + e`, by Yule and Walker's equations.
    fn autocovariances(a: f64, b: f64, n: usize) -> Vec<f64> {
        let first = a / (1.0 - b);
        let variance = 1.0 / (1.0 - a * first - b * (a * first + b));
        let mut all = vec![variance, first * variance];
        for k in 2..n {
            all.push(a * all[k - 1] + b * all[k - 2]);
        }
        all
    }

    #[test]
    fn coloured_rows_have_the_products_of_the_covariance() {
        let (a, b, n) = (1.5, -0.7, 12);
        let process = Autoregression::new(&[a / (1.0 - b), b]);
        let r = autocovariances(a, b, n);
        let sigma = DMatrix::from_fn(n, n, |i, j| r[i.abs_diff(j)]);
        let rows = DMatrix::from_fn(n, 2, |t, i| (0.7 * t as f64 + i as f64).sin());
        let coloured = process.coloured(&rows);
        let expected = rows.transpose() * sigma * &rows;
        assert!((coloured.tr_mul(&coloured) - &expected).amax() < 1e-10 * expected.amax());
    }

    /// The covariance of simulated values is that of the process, since they are linear in the innovations.
    #[test]
    fn simulated_values_have_the_covariance_of_the_process() {
        let (a, b, n) = (1.5, -0.7, 12);
        let process = Autoregression::new(&[a / (1.0 - b), b]);
        let r = autocovariances(a, b, n);
        let column = |k: usize| {
            let mut t = 0;
            let unit = || {
                t += 1;
                f64::from(u8::from(t == k + 1))
            };
            DVector::from_vec(process.simulated(n, unit))
        };
        let columns: Vec<DVector<f64>> = (0..n).map(column).collect();
        let factor = DMatrix::from_columns(&columns);
        let expected = DMatrix::from_fn(n, n, |i, j| r[i.abs_diff(j)]);
        assert!((&factor * factor.transpose() - &expected).amax() < 1e-10 * expected.amax());
    }

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
        let segments = [Segment { own: 1, rows }];
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
    }
}
