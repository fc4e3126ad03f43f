//! Are residuals correlated with what drove the system? Where they are, the model lacks a path or a delay from there
//! (L. Ljung, *System Identification*, 2nd ed., section 16.6).

use crate::autoregression::Autoregression;
use crate::residuals::{centred, is_even};
use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, Normal};

/// Most lags to either side, as Matlab's `resid` has.
const MOST_LAGS: usize = 25;
/// Probability that a correlation lies outside of its band where nothing is left.
const OUTSIDE: f64 = 0.01;

/// Residuals and an input of a run, at the samples where both are known.
#[derive(Debug, Clone, Default)]
pub struct Pair {
    /// Residuals.
    pub residuals: Vec<f64>,
    /// The input.
    pub input: Vec<f64>,
    /// Their times \[s\].
    pub time: Vec<f64>,
}

/// Correlations of residuals with an input at times before and after.
#[derive(Debug, Clone, PartialEq)]
pub struct Crossed {
    /// By which time the input came before the residual \[s\]; below 0 it came after.
    pub lags: Vec<f64>,
    /// Correlation at each lag, over all runs.
    pub correlations: Vec<f64>,
    /// Half width of each one's 99 % band around 0.
    pub bands: Vec<f64>,
}

impl Crossed {
    /// Of runs with samples that are evenly apart. None where they are not, or where residuals or the input do not vary
    /// within runs.
    ///
    /// The band follows from the residuals' autoregressive process and the input as it was, so that it holds for coloured
    /// residuals and any input: the variance of `Σ_t e_t u_(t-k)` is `uᵀ Σ u` with the covariance `Σ` of the residuals.
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
        });
        let runs: Vec<Pair> = runs.collect();
        let series = runs
            .iter()
            .map(|run| (run.residuals.clone(), run.time.clone()));
        let process = Autoregression::of_series(&series.collect::<Vec<_>>());
        let (mut products, mut variances) = (vec![0.0; 2 * most + 1], vec![0.0; 2 * most + 1]);
        for run in &runs {
            let shifted = shifted(&run.input, most);
            let coloured = process.coloured(&shifted, &run.time);
            for k in 0..products.len() {
                let column = shifted.column(k);
                products[k] += column
                    .iter()
                    .zip(&run.residuals)
                    .map(|(u, e)| u * e)
                    .sum::<f64>();
                variances[k] += coloured.column(k).norm_squared();
            }
        }
        let squares = |of: fn(&Pair) -> &Vec<f64>| -> f64 {
            runs.iter().flat_map(of).map(|value| value * value).sum()
        };
        let size = (squares(|run| &run.residuals) * squares(|run| &run.input)).sqrt();
        let step = runs
            .iter()
            .find(|run| run.time.len() > 1)
            .map(|run| run.time[1] - run.time[0])?;
        let lag = |k: usize| (k as f64 - most as f64) * step;
        (size > 0.0).then(|| Self {
            lags: (0..=2 * most).map(lag).collect(),
            correlations: products.iter().map(|own| own / size).collect(),
            bands: variances
                .iter()
                .map(|own| quantile(OUTSIDE) * own.sqrt() / size)
                .collect(),
        })
    }

    /// Whether a lag lies outside of its band.
    pub fn is_outside(&self, lag: usize) -> bool {
        self.correlations[lag].abs() > self.bands[lag]
    }

    /// The lag at which an input that came before is left in the residuals most; none where that is no more than chance
    /// makes of so many correlations in all, with a probability of 1 % (Bonferroni).
    pub fn left(&self, comparisons: usize) -> Option<usize> {
        let wider = quantile(OUTSIDE / comparisons.max(1) as f64) / quantile(OUTSIDE);
        let size = |k: usize| self.correlations[k].abs() / self.bands[k];
        let before = (0..self.lags.len()).filter(|k| self.lags[*k] >= 0.0 && self.bands[*k] > 0.0);
        let most = before.max_by(|a, b| size(*a).total_cmp(&size(*b)))?;
        (size(most) > wider).then_some(most)
    }

    /// Number of lags at which the input came before.
    pub fn before(&self) -> usize {
        self.lags.iter().filter(|lag| **lag >= 0.0).count()
    }
}

/// A column for each lag from `-most` to `most`: the input that much before; 0 where there is none.
fn shifted(input: &[f64], most: usize) -> DMatrix<f64> {
    DMatrix::from_fn(input.len(), 2 * most + 1, |t, k| {
        let at = (t + most).checked_sub(k);
        at.and_then(|at| input.get(at)).copied().unwrap_or(0.0)
    })
}

/// What a standard normal number exceeds on both sides with this probability.
fn quantile(outside: f64) -> f64 {
    Normal::standard().inverse_cdf(1.0 - 0.5 * outside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Two runs of AR(1) residuals and a smooth input, with so much of the input three samples before in the residuals.
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

    /// Of coloured residuals and a coloured input one in a hundred is outside, at each lag.
    #[test]
    fn bands_hold_99_of_100() {
        let sets = 300;
        let all = (0..sets).map(|seed| Crossed::of(&runs(seed, 0.0)).expect("varies"));
        let all: Vec<Crossed> = all.collect();
        let count = |own: &Crossed| (0..own.lags.len()).filter(|k| own.is_outside(*k)).count();
        let outside: usize = all.iter().map(count).sum();
        let share = outside as f64 / (51 * sets) as f64;
        assert!(share < 0.025, "{share}");
        let left = all
            .iter()
            .filter(|own| own.left(own.before()).is_some())
            .count();
        assert!(left <= 9, "{left} of {sets}");
    }

    #[test]
    fn a_path_is_seen_at_its_delay() {
        let found = Crossed::of(&runs(1, 1.0)).expect("varies");
        let left = found.left(found.before()).expect("it is there");
        assert!(
            (found.lags[left] - 0.3).abs() < 0.21,
            "{}",
            found.lags[left]
        );
    }

    /// White residuals and one pulse: the band is that of one residual.
    #[test]
    fn the_band_of_white_residuals_is_its_formula() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let n = 2000;
        let mut gauss = || -> f64 { StandardNormal.sample(&mut random) };
        let own = Pair {
            residuals: (0..n).map(|_| gauss()).collect(),
            input: (0..n).map(|_| gauss()).collect(),
            time: (0..n).map(|t| t as f64).collect(),
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
        assert!((found.correlations[29] - product(4) / size(&e) / size(&u)).abs() < 1e-12);
        let still = Pair {
            input: vec![1.0; n],
            ..own
        };
        assert_eq!(Crossed::of(&[still]), None);
    }
}
