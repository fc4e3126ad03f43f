//! Cross-correlation of residuals with the inputs of the system. If they are correlated, the model lacks a path or a
//! delay from that input (L. Ljung, *System Identification*, 2nd ed., section 16.6).

use crate::autoregression::Autoregression;
use crate::residuals::{centred, is_even};
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

/// Maximum number of lags on either side, as in Matlab's `resid`.
const MOST_LAGS: usize = 25;
/// Probability that a correlation lies outside of its band if no path is missing.
const OUTSIDE: f64 = 0.01;

/// Minimum share of the residuals' squares that an input must explain to be reported.
const MATTERS: f64 = 0.2;
/// Directions of the input's lags with less than this part of the largest variance are dropped.
const DIRECTION: f64 = 1e-6;

/// Residuals and an input of a run, at the samples where both are known.
#[derive(Debug, Clone, Default)]
pub struct Pair {
    /// Residuals.
    pub residuals: Vec<f64>,
    /// The input.
    pub input: Vec<f64>,
    /// Times of the samples \[s\].
    pub time: Vec<f64>,
    /// Derivatives of the predictions with respect to the shared parameters and to the run's own unknowns, one row per
    /// residual; empty if not known.
    pub gradients: [DMatrix<f64>; 2],
}

/// Correlations of residuals with an input at earlier and later times.
#[derive(Debug, Clone, PartialEq)]
pub struct Crossed {
    /// Time by which the input precedes the residual \[s\]; negative if it follows.
    pub lags: Vec<f64>,
    /// Correlation at each lag over all runs, both series whitened by the residuals' process.
    pub correlations: Vec<f64>,
    /// Half width of the 99 % band around 0 at each lag.
    pub bands: Vec<f64>,
    /// Probability that the input at all lags from 0 on explains as much of the residuals if no path is missing: the
    /// score test, chi squared with as many degrees of freedom as these inputs have directions.
    pub p: f64,
    /// Share of the squares of the unwhitened residuals that the input at these lags explains.
    pub share: f64,
}

impl Crossed {
    /// Computed from runs with evenly spaced samples. `None` if they are not, or if residuals or input do not vary
    /// within runs.
    ///
    /// Both are first whitened by the residuals' autoregressive process. For residuals with the covariance `Σ` this is
    /// the score test of a path with this lag, `uᵀ Σ⁻¹ e` with the variance `uᵀ Σ⁻¹ u`, the most powerful test of a
    /// weak path (Rao). Whitening also removes trends, which hide the residuals of a missing delay if the input drifts.
    /// The span of the unknowns is projected out of both, since errors of estimates are not a path.
    pub fn of(runs: &[Pair]) -> Option<Self> {
        let longest = runs.iter().map(|run| run.time.len()).max()?;
        let most = MOST_LAGS.min(longest / 5);
        if most == 0 || !is_even(runs.iter().map(|run| &run.time[..])) {
            return None;
        }
        let runs = runs.iter().map(|run| Pair {
            residuals: centred(&run.residuals),
            input: centred(&run.input),
            time: run.time.clone(),
            gradients: run.gradients.clone(),
        });
        let runs: Vec<Pair> = runs.collect();
        let series = runs
            .iter()
            .map(|run| (run.residuals.clone(), run.time.clone()));
        let process = Autoregression::of_series(&series.collect::<Vec<_>>());
        let lags = 2 * most + 1;
        let gram = gram(&runs, most, &process);
        let plain = self::gram(&runs, most, &process.white());
        // If the unknowns can explain all of a lag, nothing remains to be tested.
        let least = DIRECTION * (0..lags).map(|k| gram[(k, k)]).fold(0.0, f64::max);
        let squares = gram[(lags, lags)];
        let correlation = |k: usize| match gram[(k, k)] > least {
            true => gram[(k, lags)] / (gram[(k, k)] * squares).sqrt(),
            false => 0.0,
        };
        let (explained, directions) = explained_before(&gram, most);
        let chance = ChiSquared::new(directions as f64);
        let step = runs
            .iter()
            .find(|run| run.time.len() > 1)
            .map(|run| run.time[1] - run.time[0])?;
        let lag = |k: usize| (k as f64 - most as f64) * step;
        (least > 0.0 && squares > 0.0 && squares.is_finite()).then(|| Self {
            lags: (0..=2 * most).map(lag).collect(),
            correlations: (0..lags).map(correlation).collect(),
            bands: vec![quantile(OUTSIDE) / squares.sqrt(); lags],
            p: chance.map_or(1.0, |chance| chance.sf(explained)),
            share: explained_before(&plain, most).0 / plain[(lags, lags)],
        })
    }

    /// Whether a lag lies outside of its band.
    pub fn is_outside(&self, lag: usize) -> bool {
        self.correlations[lag].abs() > self.bands[lag]
    }

    /// The lag from 0 on with the largest correlation. `None` if the input explains no more than chance does with a
    /// probability of 1 % over this many pairs (Bonferroni), or less than a fifth of the residuals.
    pub fn left(&self, pairs: usize) -> Option<usize> {
        let size = |k: usize| self.correlations[k].abs();
        let before = (0..self.lags.len()).filter(|k| self.lags[*k] >= 0.0);
        let most = before.max_by(|a, b| size(*a).total_cmp(&size(*b)));
        most.filter(|_| self.p < OUTSIDE / pairs.max(1) as f64 && self.share > MATTERS)
    }
}

/// Gram matrix of the columns before `first`, with the columns from `first` on projected out. Their directions are judged in
/// units in which all have the same length, since those of parameters differ by many orders of magnitude.
fn without(gram: DMatrix<f64>, first: usize) -> DMatrix<f64> {
    let count = gram.ncols() - first;
    let unit = |i: usize| match gram[(first + i, first + i)].sqrt() {
        size if size > 0.0 => 1.0 / size,
        _ => 0.0,
    };
    let units = DMatrix::from_diagonal(&DVector::from_fn(count, |i, _| unit(i)));
    let others = &units * gram.view((first, first), (count, count)) * &units;
    let shares = &units * gram.view((first, 0), (count, first));
    let mut left = gram.view((0, 0), (first, first)).into_owned();
    if count == 0 {
        return left;
    }
    let own = others.symmetric_eigen();
    let least = DIRECTION.powi(2) * own.eigenvalues.max();
    for (value, vector) in own.eigenvalues.iter().zip(own.eigenvectors.column_iter()) {
        if *value > least {
            let share = shares.tr_mul(&vector);
            left -= &share * share.transpose() / *value;
        }
    }
    left
}

/// Gram matrix of the input at each lag and the residuals (last column), whitened by a process and with the span of the
/// unknowns projected out.
fn gram(runs: &[Pair], most: usize, process: &Autoregression) -> DMatrix<f64> {
    let shared = runs.iter().map(|run| run.gradients[0].ncols()).max();
    let all = 2 * most + 2 + shared.unwrap_or(0);
    let mut gram = DMatrix::zeros(all, all);
    for run in runs {
        let left = DMatrix::from_column_slice(run.time.len(), 1, &run.residuals);
        let [of_all, own] = &run.gradients;
        let columns = [&shifted(&run.input, most), &left, of_all, own];
        let columns = columns.iter().flat_map(|own| own.column_iter());
        let columns = DMatrix::from_columns(&columns.collect::<Vec<_>>());
        let columns = process.whitened(&columns, &run.time);
        gram += without(columns.transpose() * &columns, all);
    }
    without(gram, 2 * most + 2)
}

/// What the input at all lags from 0 on explains of the residuals' squares, `sᵀ N⁻¹ s`, and the number of its
/// directions.
fn explained_before(gram: &DMatrix<f64>, most: usize) -> (f64, usize) {
    let normal = gram.view((most, most), (most + 1, most + 1)).into_owned();
    let score = gram.column(2 * most + 1).rows(most, most + 1).into_owned();
    let own = normal.symmetric_eigen();
    let least = DIRECTION * own.eigenvalues.max();
    let directions = own.eigenvalues.iter().zip(own.eigenvectors.column_iter());
    let directions = directions.filter(|(value, _)| **value > least);
    let squares: Vec<f64> = directions
        .map(|(value, vector)| vector.dot(&score).powi(2) / value)
        .collect();
    (squares.iter().sum(), squares.len())
}

/// One column per lag from `-most` to `most`: the input earlier by the lag; 0 outside of the record.
fn shifted(input: &[f64], most: usize) -> DMatrix<f64> {
    DMatrix::from_fn(input.len(), 2 * most + 1, |t, k| {
        let at = (t + most).checked_sub(k);
        at.and_then(|at| input.get(at)).copied().unwrap_or(0.0)
    })
}

/// Two-sided quantile of the standard normal distribution for this probability outside.
fn quantile(outside: f64) -> f64 {
    Normal::standard().inverse_cdf(1.0 - 0.5 * outside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Two runs of AR(1) residuals and a smooth input; `path` times the input three samples earlier is added to the
    /// residuals.
    fn runs(seed: u64, path: f64) -> Vec<Pair> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut run = |n: usize| {
            let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
            let (mut e, mut u) = (0.0, 0.0);
            let mut own = Pair::default();
            for t in 0..n {
                (e, u) = (0.9 * e + gauss(), 0.95 * u + gauss());
                own.input.push(u);
                own.residuals
                    .push(e + if t < 3 { 0.0 } else { path * own.input[t - 3] });
                own.time.push(0.1 * t as f64);
            }
            own
        };
        vec![run(400), run(300)]
    }

    /// With coloured residuals and a coloured input one correlation in a hundred is outside, at each lag.
    #[test]
    fn bands_hold_99_of_100() {
        let sets = 300;
        let all = (0..sets).map(|seed| Crossed::of(&runs(seed, 0.0)).expect("varies"));
        let all: Vec<Crossed> = all.collect();
        let count = |own: &Crossed| (0..own.lags.len()).filter(|k| own.is_outside(*k)).count();
        let outside: usize = all.iter().map(count).sum();
        let share = outside as f64 / (51 * sets) as f64;
        assert!(share < 0.025, "{share}");
        let left = all.iter().filter(|own| own.left(1).is_some()).count();
        assert!(left <= 9, "{left} of {sets}");
    }

    #[test]
    fn a_path_is_seen_at_its_delay() {
        let found = Crossed::of(&runs(1, 1.0)).expect("varies");
        let left = found.left(1).expect("it is there");
        assert!(
            (found.lags[left] - 0.3).abs() < 1e-9,
            "{}",
            found.lags[left]
        );
    }

    /// If a delayed, drifting input is fitted without the delay, its residual drifts too: the raw correlation with the
    /// input is no larger than chance.
    #[test]
    fn a_delay_behind_an_input_that_wanders_is_seen() {
        let is_seen = |seed: u64| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
            let (mut u, mut own) = (0.0, Pair::default());
            for t in 0..600 {
                u += gauss();
                own.input.push(u);
                own.time.push(0.1 * t as f64);
                // The input six samples late, minus an instantaneous fit.
                let late = if t < 6 { 0.0 } else { own.input[t - 6] };
                own.residuals.push(0.3 * (late - u) + 0.3 * gauss());
            }
            let found = Crossed::of(&[own]).expect("varies");
            found.left(1).is_some()
        };
        let seen = (0..20).filter(|seed| is_seen(*seed)).count();
        assert!(seen >= 18, "{seen} of 20");
    }

    /// White residuals and a white input: the band is that of independent values.
    #[test]
    fn the_band_of_white_residuals_is_its_formula() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let n = 2000;
        let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
        let own = Pair {
            residuals: (0..n).map(|_| gauss()).collect(),
            input: (0..n).map(|_| gauss()).collect(),
            time: (0..n).map(|t| t as f64).collect(),
            ..Pair::default()
        };
        let found = Crossed::of(std::slice::from_ref(&own)).expect("varies");
        let plain = 2.575_829 / f64::sqrt(n as f64);
        assert!(
            (found.bands[25] / plain - 1.0).abs() < 0.1,
            "{} {plain}",
            found.bands[25]
        );
        let (e, u) = (centred(&own.residuals), centred(&own.input));
        let product = |lag: usize| -> f64 { e[lag..].iter().zip(&u).map(|(e, u)| e * u).sum() };

        let size = |all: &[f64]| all.iter().map(|v| v * v).sum::<f64>().sqrt();
        let expected = product(4) / size(&e) / size(&u[..n - 4]);
        assert!((found.correlations[29] - expected).abs() < 1e-12);
        let still = Pair {
            input: vec![1.0; n],
            ..own
        };
        assert_eq!(Crossed::of(&[still]), None);
    }
}
