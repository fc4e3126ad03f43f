//! Restricted maximum likelihood of autoregressive noise in the residuals of a fit.

use crate::autoregression::{Autoregression, Segment};
use nalgebra::DMatrix;
use std::borrow::Cow;

/// Part of a column that counts as rounding.
const ROUNDING: f64 = 1e-8;
/// Largest partial autocorrelation.
pub const LARGEST: f64 = 0.9995;
/// Maximum number of passes over all partial autocorrelations, and the change of their inverse hyperbolic tangents below which
/// no other follows.
const ROUNDS: usize = 3;
const STILL: f64 = 5e-3;

/// Restricted likelihood of autoregressive processes up to an order, from sums of products that do not depend on the
/// process.
pub struct Likelihood<'s> {
    segments: &'s [Segment],
    most: usize,
    sums: Vec<Sums>,
}

/// What the likelihood takes of a segment. Symmetric matrices are kept as their upper triangles, row by row.
struct Sums {
    /// For all [`pairs`] of lags the factor of `a_i a_j` in `Σ_t w_t w_tᵀ` with `w_t = Σ_i a_i x_(t-i)`, over the rows from `most` on:
    /// `Σ_t x_(t-i) x_(t-j)ᵀ`, plus its transpose if i ≠ j.
    products: Vec<f64>,
    /// The rows before these, one after the other.
    early: Vec<f64>,
}

/// Upper triangle of the Gram matrix of the whitened rows of a segment, and the log determinant of their covariance.
type Whitened = (Vec<f64>, f64);

impl<'s> Likelihood<'s> {
    pub fn new(segments: &'s [Segment], most: usize) -> Self {
        Self {
            sums: segments.iter().map(|own| Sums::of(own, most)).collect(),
            segments,
            most,
        }
    }

    /// −2 log likelihood up to a constant, and the variance of the innovations.
    pub fn value(&self, partial: &[f64]) -> (f64, f64) {
        restricted(self.segments, self.whitened(partial).into_iter())
    }

    fn whitened(&self, partial: &[f64]) -> Vec<Whitened> {
        let process = Autoregression::new(partial);
        let of = |(own, sums): (&Segment, &Sums)| {
            let size = own.rows.ncols();
            let mut gram = self.interior(&process, (&sums.products, triangle(size)));
            let mut sum = 0.0;
            for t in 0..self.most.min(own.rows.nrows()) {
                let order = t.min(partial.len());
                let (predictor, left) = (&process.predictors[order], process.left[order]);
                sum += add_row(&mut gram, (&sums.early, size), t, predictor, left);
            }
            (gram, sum)
        };
        self.segments.iter().zip(&self.sums).map(of).collect()
    }

    /// Gram matrix of the whitened rows from `most` on, from the products of a segment.
    fn interior(&self, process: &Autoregression, (products, size): (&[f64], usize)) -> Vec<f64> {
        let predictor = &process.predictors[process.predictors.len() - 1];
        let a = |lag: usize| match lag {
            0 => 1.0,
            _ => predictor.get(lag - 1).map_or(0.0, |a| -a),
        };
        let mut gram = vec![0.0; size];
        for ((i, j), product) in pairs(self.most).zip(products.chunks_exact(size)) {
            let factor = a(i) * a(j);
            if factor != 0.0 {
                add(&mut gram, factor, product);
            }
        }
        gram
    }

    /// The whitened products as functions of one partial autocorrelation `p`, from those at its present value. They are quadratic
    /// in it, since predictors are linear in it; the error variances of lower orders are proportional to `1/(1 - p²)`.
    fn along(&self, partial: &[f64], k: usize, here: Vec<Whitened>) -> Along {
        let own = partial[k];
        // Two more places, away from this one.
        let others = match own.abs() < 0.25 {
            true => [-0.5, 0.5],
            false => [0.0, -0.5f64.copysign(own)],
        };
        let [one, two] = others.map(|p| {
            let mut other = partial.to_vec();
            other[k] = p;
            self.whitened(&other)
        });
        let [p, q] = others;
        // Newton's divided differences.
        let slope = |from: &[f64], to: &[f64], by: f64| -> Vec<f64> {
            let pairs = from.iter().zip(to);
            pairs.map(|(from, to)| (to - from) / by).collect()
        };
        let polynomials = here
            .into_iter()
            .zip(one.iter().zip(&two))
            .zip(self.segments);
        let polynomials = polynomials.map(|(((gram, sum), (one, two)), segment)| {
            let first = slope(&gram, &one.0, p - own);
            let second = slope(&first, &slope(&one.0, &two.0, q - p), q - own);
            let early = segment.rows.nrows().min(k + 1) as f64;
            Polynomial {
                terms: [gram, first, second],
                places: [own, p],
                early,
                determinant: sum + early * (1.0 - own * own).ln(),
            }
        });
        Along {
            polynomials: polynomials.collect(),
        }
    }

    /// Maximises the likelihood, starting from these partial autocorrelations: one after the other along their inverse
    /// hyperbolic tangents, by golden section, until they move no more.
    pub fn maximised(&self, mut partial: Vec<f64>) -> Vec<f64> {
        let within = |u: f64| u.tanh().clamp(-LARGEST, LARGEST);
        let mut reach = 1.5;
        let mut here = self.whitened(&partial);
        for _ in 0..ROUNDS {
            let mut moved = 0.0f64;
            for k in 0..partial.len() {
                let middle = partial[k].atanh();
                let along = self.along(&partial, k, here);
                let value = |u: f64| restricted(self.segments, along.at(within(u))).0;
                let best = golden(value, middle - reach, middle + reach);
                moved = moved.max((best - middle).abs());
                partial[k] = within(best);
                here = along.at(partial[k]).collect();
            }
            if moved < STILL {
                break;
            }
            reach *= 0.3;
        }
        partial
    }
}

/// The whitened products of all segments along one partial autocorrelation.
struct Along {
    polynomials: Vec<Polynomial>,
}

/// Those of a segment, in Newton's form.
struct Polynomial {
    terms: [Vec<f64>; 3],
    places: [f64; 2],
    /// Number of rows that are predicted by fewer values than the partial autocorrelation's order.
    early: f64,
    /// The log determinant where it is 0.
    determinant: f64,
}

impl Along {
    fn at(&self, p: f64) -> impl Iterator<Item = Whitened> {
        self.polynomials.iter().map(move |own| {
            let [constant, first, second] = &own.terms;
            let [a, b] = own.places.map(|place| p - place);
            let terms = constant.iter().zip(first).zip(second);
            let gram = terms.map(|((c, f), s)| c + a * (f + b * s)).collect();
            (gram, own.determinant - own.early * (1.0 - p * p).ln())
        })
    }
}

/// Pairs of lags i ≤ j up to the largest lag.
fn pairs(most: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..=most).flat_map(move |i| (i..=most).map(move |j| (i, j)))
}

/// Number of entries of the upper triangle of a matrix.
fn triangle(size: usize) -> usize {
    size * (size + 1) / 2
}

/// Adds a multiple.
pub fn add(sum: &mut [f64], factor: f64, own: &[f64]) {
    let pairs = sum.iter_mut().zip(own);
    pairs.for_each(|(sum, own)| *sum += factor * own);
}

impl Sums {
    /// Products at `i + 1, j + 1` differ from those at `i, j` only in their first and last rows.
    fn of(of: &Segment, most: usize) -> Self {
        let (rows, size) = (&of.rows, of.rows.ncols());
        let by_row = rows.transpose();
        let early = rows.nrows().min(most) * size;
        let early = by_row.as_slice()[..early].to_vec();
        let count = rows.nrows().saturating_sub(most);
        if count == 0 {
            return Self {
                products: vec![0.0; pairs(most).count() * triangle(size)],
                early,
            };
        }
        let lagged = |lag: usize| rows.rows(most - lag, count);
        let mut diagonals: Vec<DMatrix<f64>> =
            (0..=most).map(|j| lagged(0).tr_mul(&lagged(j))).collect();
        let mut products = Vec::with_capacity(pairs(most).count() * triangle(size));
        for i in 0..=most {
            for (apart, product) in diagonals[..=most - i].iter_mut().enumerate() {
                let j = i + apart;
                if i > 0 {
                    for (sign, t) in [(1.0, most), (-1.0, rows.nrows())] {
                        product.ger(sign, &by_row.column(t - i), &by_row.column(t - j), 1.0);
                    }
                }
                let twice = |(k, l): (usize, usize)| match apart {
                    0 => product[(k, l)],
                    _ => product[(k, l)] + product[(l, k)],
                };
                products.extend(pairs(size - 1).map(twice));
            }
        }
        Self { products, early }
    }
}

/// Adds a whitened row, of rows one after the other, to the triangle of the Gram matrix; returns the logarithm of its variance.
fn add_row(
    gram: &mut [f64],
    (rows, size): (&[f64], usize),
    t: usize,
    predictor: &[f64],
    left: f64,
) -> f64 {
    let row = |t: usize| &rows[t * size..(t + 1) * size];
    let mut own = row(t).to_vec();
    for (k, a) in predictor.iter().enumerate() {
        add(&mut own, -a, row(t - 1 - k));
    }
    let mut gram = gram;
    for k in 0..size {
        let (first, rest) = gram.split_at_mut(size - k);
        add(first, own[k] / left, &own[k..]);
        gram = rest;
    }
    left.ln()
}

/// The restricted likelihood for a process given by the predictor and error variance of each row of a segment: as
/// [`Likelihood::value`], row by row.
pub fn of_whitened<'p>(
    segments: &[Segment],
    step: impl Fn(&Segment, usize) -> (Cow<'p, [f64]>, f64),
) -> (f64, f64) {
    let whitened = segments.iter().map(|own| {
        let (by_row, size) = (own.rows.transpose(), own.rows.ncols());
        let (mut gram, mut sum) = (vec![0.0; triangle(size)], 0.0);
        for t in 0..own.rows.nrows() {
            let (predictor, left) = step(own, t);
            let rows = (by_row.as_slice(), size);
            sum += add_row(&mut gram, rows, t, &predictor, left);
        }
        (gram, sum)
    });
    restricted(segments, whitened)
}

/// −2 log restricted likelihood up to a constant, and the variance, from the whitened products of each segment.
fn restricted(segments: &[Segment], whitened: impl Iterator<Item = Whitened>) -> (f64, f64) {
    let shared = segments[0].rows.ncols() - segments[0].own;
    let (mut sum, mut rank, mut count) = (0.0, 0, 0);
    let mut rest = vec![0.0; triangle(shared)];
    for (own, (mut gram, determinant)) in segments.iter().zip(whitened) {
        let (log, own_rank) = eliminate(&mut gram, own.rows.ncols(), own.own);
        sum += log + determinant;
        rank += own_rank;
        count += own.rows.nrows();
        let first = gram.len() - rest.len();
        add(&mut rest, 1.0, &gram[first..]);
    }
    let (log, own_rank) = eliminate(&mut rest, shared, shared - 1);
    let degrees = count.saturating_sub(rank + own_rank).max(1) as f64;
    let variance = (rest[rest.len() - 1] / degrees).max(f64::MIN_POSITIVE);
    (sum + log + degrees * variance.ln(), variance)
}

/// Eliminates the first columns of a matrix of this size, given as its upper triangle. Returns the sum of the logarithms of the pivots
/// and their number; the last rows become the Schur complement.
fn eliminate(gram: &mut [f64], size: usize, count: usize) -> (f64, usize) {
    let first = |k: usize| triangle(size) - triangle(size - k);
    let diagonal: Vec<f64> = (0..count).map(|k| gram[first(k)]).collect();
    let (mut log, mut rank) = (0.0, 0);
    for (k, whole) in diagonal.into_iter().enumerate() {
        let (own, mut rest) = gram[first(k)..].split_at_mut(size - k);
        let pivot = own[0];
        if pivot <= ROUNDING * whole || pivot <= 0.0 {
            continue;
        }
        log += pivot.ln();
        rank += 1;
        for i in 1..own.len() {
            let (row, others) = rest.split_at_mut(own.len() - i);
            add(row, -own[i] / pivot, &own[i..]);
            rest = others;
        }
    }
    (log, rank)
}

/// Minimiser of a function between two numbers, by golden section.
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

    /// The restricted likelihood computed with dense matrices.
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
        // The likelihood along each of the two coordinates is the same.
        let likelihood = Likelihood::new(&segments, 4);
        for k in 0..2 {
            for p in [-0.9, 0.3, 0.98] {
                let mut partial = [a / (1.0 - b), b];
                partial[k] = p;
                let (whole, _) = likelihood.value(&partial);
                let from = [a / (1.0 - b), b];
                let along = likelihood.along(&from, k, likelihood.whitened(&from));
                let (along, _) = restricted(&segments, along.at(p));
                assert!((whole - along).abs() < 1e-9, "{whole} {along}");
            }
        }
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
