//! Autoregressive noise, estimated from the residuals of a fit without the bias that the fit causes.
//!
//! A fit removes from its residuals what its unknowns can follow, so they look less coloured than the noise is.
//! Restricted maximum likelihood is free of that bias to first order (Cheang & Reinsel, *Bias reduction of
//! autoregressive estimates in time series regression model through restricted maximum likelihood*, J. Am. Stat. Assoc.
//! 95, 2000). The process is parametrised by its partial autocorrelations; it is stationary if they are below one
//! (Barndorff-Nielsen & Schou, J. Multivar. Anal. 3, 1973). The order minimises Akaike's criterion.
//!
//! If samples are missing or not evenly spaced, the process is of first order in continuous time, with the correlation
//! `exp(-rate Δ)` over a time Δ (R. H. Jones, *Fitting a continuous time autoregression to discrete data*, Applied Time
//! Series Analysis II, 1981).

use crate::burg;
use crate::residuals::is_even;
use crate::restricted::{LARGEST, Likelihood, add, golden, of_whitened};
use nalgebra::DMatrix;
use std::borrow::Cow;

/// Highest order. White noise added to the oscillation of a loop has no finite order, and the criterion may have a
/// lower minimum beyond the first one.
const MOST: usize = 32;
/// Rows of a run required per order.
const ROWS: usize = 10;
/// Smallest distance of samples, relative to the mean one: values recorded at one time are not identical.
const LEAST: f64 = 0.01;

/// An autoregressive process.
#[derive(Debug, Clone, PartialEq)]
pub struct Autoregression {
    /// Predictors of all orders up to the process's own: `predictors[k]` has `k` coefficients, that of the nearest
    /// value first.
    pub(crate) predictors: Vec<Vec<f64>>,
    /// Prediction error variance of each order, relative to the innovations' variance.
    pub(crate) left: Vec<f64>,
    /// Variance of the innovations; in continuous time, of the values themselves.
    pub variance: f64,
    /// In continuous time: the decay rate of correlations [1/s] and the smallest distance of samples used [s].
    decay: Option<[f64; 2]>,
}

/// One signal's rows of a run: columns of the run's own unknowns, of the shared unknowns, and the residuals.
#[derive(Debug, Clone)]
pub struct Segment {
    pub own: usize,
    /// Time of each row [s].
    pub time: Vec<f64>,
    pub rows: DMatrix<f64>,
}

impl Autoregression {
    /// The process with these partial autocorrelations and innovations of unit variance (Durbin and Levinson).
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
            decay: None,
        }
    }

    /// Estimates the process from the residuals of a signal.
    pub fn estimated(segments: &[Segment]) -> Self {
        match is_even(segments.iter().map(|own| &own.time[..])) {
            true => Self::even(segments),
            false => Self::uneven(segments),
        }
    }

    /// Estimates the process from series of values and their times \[s\] that are not residuals of a fit.
    ///
    /// # Panics
    /// If there are no series, or if the values and times of a series differ in number.
    pub fn of_series(all: &[(Vec<f64>, Vec<f64>)]) -> Self {
        assert!(!all.is_empty(), "a series at least");
        let segment = |(values, time): &(Vec<f64>, Vec<f64>)| {
            assert_eq!(values.len(), time.len(), "a time for each value");
            Segment {
                own: 0,
                time: time.clone(),
                rows: DMatrix::from_column_slice(values.len(), 1, values),
            }
        };
        Self::estimated(&all.iter().map(segment).collect::<Vec<_>>())
    }

    /// For samples that are not evenly spaced: first order in continuous time, or white.
    fn uneven(segments: &[Segment]) -> Self {
        let gaps = segments.iter().flat_map(|own| own.time.windows(2));
        let (span, count) = gaps.fold((0.0, 0.0), |(span, count), pair| {
            (span + pair[1] - pair[0], count + 1.0)
        });
        let mean = span / f64::max(count, 1.0);
        let of = |rate: f64| Self {
            decay: Some([rate, LEAST * mean]),
            ..Self::new(&[])
        };
        let value = |process: &Self| of_whitened(segments, |own, t| process.step(t, &own.time));
        let at = |log: f64| value(&of(log.exp() / mean)).0;
        let [slow, fast] = [-f64::ln(LARGEST), 10.0].map(f64::ln);
        let best = golden(at, slow, fast);
        let white = value(&Self::new(&[]));
        // The rate counts as one more unknown, as in Akaike's criterion.
        let (process, variance) = match at(best) + 2.0 < white.0 {
            true => (of(best.exp() / mean), value(&of(best.exp() / mean)).1),
            false => (Self::new(&[]), white.1),
        };
        Self {
            variance,
            ..process
        }
    }

    /// Predictor of value `t` from the values before it, the nearest first, and its error variance relative to
    /// [`Self::variance`].
    fn step(&self, t: usize, time: &[f64]) -> (Cow<'_, [f64]>, f64) {
        match self.decay {
            None => {
                let order = t.min(self.predictors.len() - 1);
                (Cow::Borrowed(&self.predictors[order]), self.left[order])
            }
            Some(_) if t == 0 => (Cow::Owned(Vec::new()), 1.0),
            Some([rate, least]) => {
                let a = (-rate * (time[t] - time[t - 1]).max(least)).exp();
                (Cow::Owned(vec![a]), 1.0 - a * a)
            }
        }
    }

    /// One-step predictions: each value predicted from those before it, 0 for the first. `time` holds the time of each
    /// value \[s\].
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn one_step(&self, values: &[f64], time: &[f64]) -> Vec<f64> {
        assert_eq!(values.len(), time.len(), "a time for each value");
        let expected = |t: usize| {
            let (predictor, _) = self.step(t, time);
            let before = predictor.iter().zip(values[..t].iter().rev());
            before.map(|(a, x)| a * x).sum()
        };
        (0..values.len()).map(expected).collect()
    }

    /// The order: how many previous values predict the next one.
    pub fn order(&self) -> usize {
        match self.decay {
            Some(_) => 1,
            None => self.predictors.len() - 1,
        }
    }

    /// Whether the estimate is at the limit of what is stationary: values that wander, whose variance is not determined.
    pub fn wanders(&self) -> bool {
        let at_limit = |partial: f64| partial.abs() >= 2.0 * LARGEST - 1.0;
        let slow = |[rate, least]: [f64; 2]| at_limit((-rate * least / LEAST).exp());
        let last = self.predictors.iter().filter_map(|own| own.last());
        last.copied().any(at_limit) || self.decay.is_some_and(slow)
    }

    /// Estimates the process from evenly spaced residuals.
    fn even(segments: &[Segment]) -> Self {
        let longest = segments
            .iter()
            .map(|own| own.rows.nrows())
            .max()
            .unwrap_or(0);
        let most = MOST.min(longest / ROWS);
        let likelihood = Likelihood::new(segments, most);
        let residuals = |own: &Segment| {
            own.rows
                .column(own.rows.ncols() - 1)
                .iter()
                .copied()
                .collect()
        };
        let first = burg::partial(segments.iter().map(residuals).collect(), most);
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

    /// `C` with `CᵀC = JᵀΣJ` for rows `J` at these times \[s\], where `Σ` is the covariance of as many values of the
    /// process.
    pub fn coloured(&self, rows: &DMatrix<f64>, time: &[f64]) -> DMatrix<f64> {
        let size = rows.ncols();
        // One row after the other.
        let mut out = rows.transpose();
        for t in (0..rows.nrows()).rev() {
            let (before, own) = out.as_mut_slice().split_at_mut(t * size);
            let own = &mut own[..size];
            let (predictor, left) = self.step(t, time);
            for (k, a) in predictor.iter().enumerate() {
                add(&mut before[(t - 1 - k) * size..][..size], *a, own);
            }
            let deviation = (self.variance * left).sqrt();
            own.iter_mut().for_each(|own| *own *= deviation);
        }
        out.transpose()
    }

    /// `L⁻¹ J` for rows `J` at these times \[s\], where `LLᵀ` is the covariance of as many values: each entry is the
    /// one-step prediction error over its standard deviation.
    pub fn whitened(&self, rows: &DMatrix<f64>, time: &[f64]) -> DMatrix<f64> {
        let size = rows.ncols();
        let by_row = rows.transpose();
        let mut out = by_row.clone();
        for t in 0..rows.nrows() {
            let own = &mut out.as_mut_slice()[t * size..][..size];
            let (predictor, left) = self.step(t, time);
            for (k, a) in predictor.iter().enumerate() {
                add(own, -a, &by_row.as_slice()[(t - 1 - k) * size..][..size]);
            }
            let deviation = (self.variance * left).sqrt();
            own.iter_mut().for_each(|own| *own /= deviation);
        }
        out.transpose()
    }

    /// Simulates the process at these times \[s\] from innovations of unit variance, stationary from the first value
    /// on.
    pub fn simulated(&self, time: &[f64], mut innovation: impl FnMut() -> f64) -> Vec<f64> {
        let mut values: Vec<f64> = Vec::with_capacity(time.len());
        for t in 0..time.len() {
            let (predictor, left) = self.step(t, time);
            let before = predictor.iter().zip(values.iter().rev());
            let expected: f64 = before.map(|(a, x)| a * x).sum();
            values.push(expected + (self.variance * left).sqrt() * innovation());
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

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use nalgebra::DVector;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal, Uniform};

    /// Autocovariances of `x_t = a x_(t-1) + b x_(t-2) + e`, by Yule and Walker's equations.
    pub(crate) fn autocovariances(a: f64, b: f64, n: usize) -> Vec<f64> {
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
        let coloured = process.coloured(&rows, &[0.0; 12]);
        let expected = rows.transpose() * sigma * &rows;
        assert!((coloured.tr_mul(&coloured) - &expected).amax() < 1e-10 * expected.amax());
    }

    /// Simulated values are linear in the innovations; their covariance is that of the process.
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
            DVector::from_vec(process.simulated(&[0.0; 12], unit))
        };
        let columns: Vec<DVector<f64>> = (0..n).map(column).collect();
        let factor = DMatrix::from_columns(&columns);
        let expected = DMatrix::from_fn(n, n, |i, j| r[i.abs_diff(j)]);
        assert!((&factor * factor.transpose() - &expected).amax() < 1e-10 * expected.amax());
    }

    const TIMES: [f64; 8] = [0.0, 0.1, 0.15, 0.4, 0.5, 1.1, 1.2, 1.3];

    /// In continuous time the covariance over a time Δ is `exp(-rate Δ)`.
    #[test]
    fn uneven_rows_have_the_products_of_the_covariance() {
        let process = Autoregression {
            decay: Some([2.0, 0.0]),
            ..Autoregression::new(&[])
        };
        let sigma = DMatrix::from_fn(8, 8, |i, j| (-2.0 * (TIMES[i] - TIMES[j]).abs()).exp());
        let rows = DMatrix::from_fn(8, 2, |t, i| (0.7 * t as f64 + i as f64).sin());
        let coloured = process.coloured(&rows, &TIMES);
        let expected = rows.transpose() * &sigma * &rows;
        assert!((coloured.tr_mul(&coloured) - &expected).amax() < 1e-12 * expected.amax());
        // The best linear prediction of the last value follows from the Yule–Walker equations.
        let values: Vec<f64> = (0..8).map(|t| (t as f64).cos()).collect();
        let before = sigma.view((0, 0), (7, 7)).into_owned();
        let weights = before.try_inverse().expect("regular") * sigma.view((0, 7), (7, 1));
        let best: f64 = (0..7).map(|k| weights[k] * values[k]).sum();
        let found = process.one_step(&values, &TIMES);
        assert!((found[7] - best).abs() < 1e-12 && found[0] == 0.0);
    }

    /// The rate of a process sampled at random times is estimated, and white noise is recognised as white.
    #[test]
    fn the_rate_of_an_uneven_process_is_found() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut uniform = || {
            Uniform::new(0.01, 0.3)
                .expect("not empty")
                .sample(&mut random)
        };
        let mut now = 0.0;
        let time = (0..4000).map(|_| {
            now += uniform();
            now
        });
        let time: Vec<f64> = time.collect();
        for (rate, is_white) in [(1.5, false), (1e6, true)] {
            let process = Autoregression {
                decay: Some([rate, 0.0]),
                ..Autoregression::new(&[])
            };
            let mut random = ChaCha8Rng::seed_from_u64(6);
            let values = process.simulated(&time, || StandardNormal.sample(&mut random));
            let found = Autoregression::of_series(&[(values, time.clone())]);
            assert!((found.variance - 1.0).abs() < 0.15, "{found:?}");
            assert_eq!(found.decay.is_none(), is_white);
            let is_near = |[found, _]: [f64; 2]| (found / rate - 1.0).abs() < 0.15;
            assert!(found.decay.is_none_or(is_near), "{found:?}");
        }
    }
}
