//! Residual statistics of a model: how much it explains, and whether residuals are white.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Autocorrelations of a series with about evenly spaced samples, at lags 0 to `most`. Products with missing values
/// (NaN) are left out. Empty if the series is constant.
pub fn autocorrelation(values: &[f64], most: usize) -> Vec<f64> {
    let e = centred(values);
    let product = |lag: usize| -> f64 { e.iter().zip(&e[lag..]).map(|(a, b)| a * b).sum() };
    let size = product(0);
    let lags = 0..=most.min(e.len().saturating_sub(1));
    match size > 0.0 {
        true => lags.map(|lag| product(lag) / size).collect(),
        false => Vec::new(),
    }
}

/// Relative deviation of a sample distance from the mean one up to which samples are evenly spaced.
const EVEN: f64 = 0.01;

/// Whether the samples of all series are evenly spaced, with the same distance.
pub fn is_even<'t>(all: impl IntoIterator<Item = &'t [f64]>) -> bool {
    let gaps = all.into_iter().flat_map(|time| time.windows(2));
    let gaps: Vec<f64> = gaps.map(|pair| pair[1] - pair[0]).collect();
    let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
    gaps.iter().all(|gap| (gap - mean).abs() <= EVEN * mean)
}

/// A series minus its mean; zero where a value is missing.
pub fn centred(values: &[f64]) -> Vec<f64> {
    let known: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
    let one = |v: &f64| if v.is_finite() { v - mean } else { 0.0 };
    values.iter().map(one).collect()
}

/// The test of Ljung & Box (*On a measure of lack of fit in time series models*, Biometrika 65, 1978) whether the first
/// autocorrelations are those of white noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LjungBox {
    /// Number of lags.
    pub lags: usize,
    /// `Q = n (n + 2) Σ r_k²/(n - k)`.
    pub statistic: f64,
    /// Probability of a Q as large or larger if the residuals are white.
    pub p: f64,
}

impl LjungBox {
    /// Tests residuals (NaN if missing) over ten lags or a fifth of their number. `None` if there are too few, or if
    /// they are constant.
    pub fn of(residuals: &[f64]) -> Option<Self> {
        let n = residuals.iter().filter(|v| v.is_finite()).count();
        let lags = MOST_LAGS.min(n / 5);
        let r = autocorrelation(residuals, lags);
        if lags == 0 || r.len() <= lags {
            return None;
        }
        let n = n as f64;
        let terms = (1..=lags).map(|k| r[k] * r[k] / (n - k as f64));
        let statistic = n * (n + 2.0) * terms.sum::<f64>();
        let law = ChiSquared::new(lags as f64).ok()?;
        Some(Self {
            lags,
            statistic,
            p: law.sf(statistic),
        })
    }
}

/// Maximum number of lags of a test (Hyndman & Athanasopoulos, *Forecasting: Principles and Practice*, section 5.4).
const MOST_LAGS: usize = 10;

/// Share of the recorded signal that a model explains, in percent; both are 100 for a perfect model and may be
/// negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Explained {
    /// Variance accounted for, `1 - var(y - h)/var(y)`.
    pub vaf: f64,
    /// Normalised root mean square, `1 - |y - h|/|y - ȳ|`.
    pub fit: f64,
}

impl Explained {
    /// For recorded values (NaN if missing) and those of a model. `None` if fewer than two were recorded, or if they
    /// are constant.
    pub fn of(recorded: &[f64], predicted: &[f64]) -> Option<Self> {
        let pairs = recorded.iter().zip(predicted);
        let pairs: Vec<(f64, f64)> = pairs
            .filter(|(y, _)| y.is_finite())
            .map(|(y, h)| (*y, y - h))
            .collect();
        let n = pairs.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
        let (level, bias) = (mean(|p| p.0), mean(|p| p.1));
        let squares = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(|p| of(p).powi(2)).sum();
        let total: f64 = squares(&|p| p.0 - level);
        let (around, left): (f64, f64) = (squares(&|p| p.1 - bias), squares(&|p| p.1));
        (n > 1.0 && total > 0.0).then(|| Self {
            vaf: 100.0 * (1.0 - around / total),
            fit: 100.0 * (1.0 - (left / total).sqrt()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn the_statistic_is_the_formula() {
        let values = [1.0, -1.0, 2.0, 0.0, 1.0, -2.0, 0.5, 1.5, -1.0, 0.0];
        let test = LjungBox::of(&values).expect("enough");
        let mean = values.iter().sum::<f64>() / 10.0;
        let c = |k: usize| -> f64 {
            (k..10)
                .map(|i| (values[i] - mean) * (values[i - k] - mean))
                .sum()
        };
        let (r1, r2) = (c(1) / c(0), c(2) / c(0));
        let q = 10.0 * 12.0 * (r1 * r1 / 9.0 + r2 * r2 / 8.0);
        assert_eq!(test.lags, 2);
        assert!((test.statistic - q).abs() < 1e-12);
        // With two degrees of freedom the distribution is exponential.
        assert!((test.p - (-0.5 * q).exp()).abs() < 1e-12);
    }

    /// AR(1): the autocorrelations are powers of the coefficient.
    #[test]
    fn autocorrelations_are_those_of_the_process() {
        let mut generator = ChaCha8Rng::seed_from_u64(11);
        let mut value = 0.0;
        let values: Vec<f64> = (0..100_000)
            .map(|_| {
                let draw: f64 = StandardNormal.sample(&mut generator);
                value = 0.8 * value + draw;
                value
            })
            .collect();
        for (lag, r) in autocorrelation(&values, 5).into_iter().enumerate() {
            assert!((r - 0.8_f64.powi(lag as i32)).abs() < 0.02, "{lag}: {r}");
        }
    }

    #[test]
    fn missing_values_are_left_out() {
        let r = autocorrelation(&[1.0, f64::NAN, -1.0, 1.0, -1.0], 1);
        assert!((r[1] + 0.5).abs() < 1e-12, "{r:?}");
        assert!(autocorrelation(&[2.0; 5], 2).is_empty());
        assert_eq!(LjungBox::of(&[1.0, 2.0]), None);
    }

    #[test]
    fn a_perfect_model_explains_all_and_a_bias_no_variance() {
        let y = [1.0, 2.0, f64::NAN, 4.0];
        let all = Explained::of(&y, &[1.0, 2.0, 3.0, 4.0]).expect("varies");
        assert_eq!((all.vaf, all.fit), (100.0, 100.0));
        let biased = Explained::of(&y, &[2.0, 3.0, 0.0, 5.0]).expect("varies");
        assert!((biased.vaf - 100.0).abs() < 1e-12 && biased.fit < 100.0);
        assert_eq!(Explained::of(&[3.0, 3.0], &[3.0, 3.0]), None);
    }
}
