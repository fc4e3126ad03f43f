//! What the measures of a study are like, and what they depend on.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::Serialize;

/// A number with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Sobol' indices of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Indices {
    /// Part of the variance that goes if this variable is known.
    pub first: Interval,
    /// Part of the variance that stays if all others are known.
    pub total: Interval,
}

/// Quantile of 1 - 0.05/2 of the standard normal distribution.
const NORMAL: f64 = 1.959_963_984_540_054;
/// Fewest base samples of which intervals are given.
pub const FEWEST: usize = 32;
/// Resamples of an interval.
const RESAMPLES: usize = 200;

/// Mean and standard deviation of finite numbers; NaN where there are too few.
pub fn moments(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    if values.len() < 2 {
        return [values.first().copied().unwrap_or(f64::NAN), f64::NAN];
    }
    let mean = values.iter().sum::<f64>() / n;
    let square: f64 = values.iter().map(|own| (own - mean).powi(2)).sum();
    [mean, (square / (n - 1.0)).sqrt()]
}

/// Ranks from 1, equal numbers with the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut from = 0;
    while from < order.len() {
        let same = order[from..]
            .iter()
            .take_while(|k| values[**k] == values[order[from]])
            .count();
        let mean = from as f64 + 0.5 * (same as f64 + 1.0);
        order[from..from + same]
            .iter()
            .for_each(|k| ranks[*k] = mean);
        from += same;
    }
    ranks
}

/// Spearman's rank correlation of two lists, with the interval of Fisher's transformation in the variance of Bonett & Wright
/// (2000). NaN where one of them does not vary.
pub fn rank_correlation(x: &[f64], y: &[f64]) -> Interval {
    let (x, y) = (ranks(x), ranks(y));
    let ([mx, sx], [my, sy]) = (moments(&x), moments(&y));
    let n = x.len() as f64;
    let product: f64 = x.iter().zip(&y).map(|(a, b)| (a - mx) * (b - my)).sum();
    let value = (product / ((n - 1.0) * sx * sy)).clamp(-1.0, 1.0);
    if 1.0 - value.abs() < 1e-12 {
        let value = value.signum();
        return Interval {
            value,
            low: value,
            high: value,
        };
    }
    let half = NORMAL * ((1.0 + 0.5 * value * value) / (n - 3.0)).sqrt();
    let end = |by: f64| (value.atanh() + by).tanh();
    Interval {
        value,
        low: if value.abs() == 1.0 {
            value
        } else {
            end(-half)
        },
        high: end(half),
    }
}

/// Sobol' indices of `k` variables from the measures of a [Saltelli](crate::Method::Saltelli) design, in its order; base samples
/// in which a measure is not finite are left out. First order by Saltelli et al. (2010), total by Jansen (1999), intervals by
/// resampling of base samples with a seed, of which there are none for fewer than [`FEWEST`].
pub fn sobol_indices(measured: &[f64], k: usize, seed: u64) -> Vec<Indices> {
    let blocks: Vec<&[f64]> = measured
        .chunks_exact(k + 2)
        .filter(|own| own.iter().all(|value| value.is_finite()))
        .collect();
    let n = blocks.len();
    let estimate = |places: &[usize]| -> Vec<[f64; 2]> {
        let both = places
            .iter()
            .flat_map(|own| blocks[*own][..2].iter().copied());
        let [mean, sd] = moments(&both.collect::<Vec<_>>());
        let count = places.len() as f64;
        let of = |d: usize| {
            let (mut first, mut total) = (0.0, 0.0);
            for own in places {
                let [a, b, mixed] = [0, 1, d + 2].map(|j| blocks[*own][j] - mean);
                first += b * (mixed - a);
                total += 0.5 * (mixed - a).powi(2);
            }
            [first, total].map(|sum| sum / count / (sd * sd))
        };
        (0..k).map(of).collect()
    };
    let all: Vec<usize> = (0..n).collect();
    let found = estimate(&all);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut place = || (((u128::from(random.next_u64())) * n as u128) >> 64) as usize;
    let again: Vec<Vec<[f64; 2]>> = (0..if n >= FEWEST { RESAMPLES } else { 0 })
        .map(|_| estimate(&(0..n).map(|_| place()).collect::<Vec<_>>()))
        .collect();
    let interval = |d: usize, which: usize| {
        let others: Vec<f64> = again.iter().map(|own| own[d][which]).collect();
        let half = NORMAL * moments(&others)[1];
        let value = found[d][which];
        Interval {
            value,
            low: value - half,
            high: value + half,
        }
    };
    (0..k)
        .map(|d| Indices {
            first: interval(d, 0),
            total: interval(d, 1),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Design, Method, Vary};

    /// Ishigami's function with a = 7, b = 0.1: its indices are known.
    #[test]
    fn indices_of_ishigami_are_known() {
        let vary = (1..=3).map(|k| {
            Vary::parse(&format!(
                "x{k}~uniform(-3.14159265358979, 3.14159265358979)"
            ))
            .unwrap()
        });
        let design = Design::new(vary.collect(), Method::Saltelli, 1 << 12, 1).unwrap();
        let measured: Vec<f64> = (0..design.count())
            .map(|k| {
                let x = design.values(k);
                x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin()
            })
            .collect();
        let found = sobol_indices(&measured, 3, 1);
        let expected = [
            (0.313_905, 0.557_589),
            (0.442_411, 0.442_411),
            (0.0, 0.243_684),
        ];
        for (own, (first, total)) in found.iter().zip(expected) {
            for (own, expected) in [(own.first, first), (own.total, total)] {
                assert!((own.value - expected).abs() < 0.02, "{own:?} {expected}");
                assert!(
                    own.low - 0.01 <= expected && expected <= own.high + 0.01,
                    "{own:?} {expected}"
                );
                assert!(own.high - own.low < 0.1, "{own:?}");
            }
        }
    }

    /// SciPy: spearmanr([1,2,3,4,5,6,7], [2,1,4,3,7,7,5]).statistic.
    #[test]
    fn rank_correlation_is_known() {
        let x = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        let found = rank_correlation(&x, &[2.0, 1.0, 4.0, 3.0, 7.0, 7.0, 5.0]);
        assert!((found.value - 0.810_843_716_4).abs() < 1e-9, "{found:?}");
        assert!(found.low < found.value && found.value < found.high && found.high < 1.0);
        assert_eq!(rank_correlation(&x, &x).low, 1.0);
    }

    #[test]
    fn too_few_numbers_have_no_moments() {
        assert!(moments(&[]).iter().all(|own| own.is_nan()) && moments(&[2.0])[1].is_nan());
    }
}
