//! Bootstraps: refits of the problem to other data (Efron & Tibshirani, *An Introduction to the Bootstrap*, 1993).

use crate::refit::{Data, Found, Resample};
use crate::solved::Watch;
use pilotage_inference::sample::quantile;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;

/// A refit.
#[derive(Debug, Clone, PartialEq)]
pub struct Replicate {
    /// Number of the replicate, from 0.
    pub number: u64,
    /// Values of the unknowns; `None` if the refit did not converge, NaN where its runs do not determine the value.
    pub values: Option<Vec<f64>>,
}

/// Random numbers of a replicate, independent of the other replicates.
pub fn random(seed: u64, number: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    random
}

/// How often each run is drawn in as many draws with replacement as there are runs.
pub fn counts(runs: usize, random: &mut ChaCha8Rng) -> Vec<usize> {
    let mut counts = vec![0; runs];
    for _ in 0..runs {
        counts[below(runs as u64, random) as usize] += 1;
    }
    counts
}

/// A uniformly distributed integer below `end`: draws that would bias the result are rejected.
fn below(end: u64, random: &mut ChaCha8Rng) -> u64 {
    let least = end.wrapping_neg() % end;
    loop {
        let product = u128::from(random.next_u64()) * u128::from(end);
        if product as u64 >= least {
            return (product >> 64) as u64;
        }
    }
}

/// Values to report for a refit.
pub type Values<'a> = dyn Fn(&Found) -> Vec<f64> + Sync + 'a;

/// Refits to the data that `draw` returns for each of these numbers, in parallel; the results do not depend on the
/// number of threads. `see` receives each replicate as soon as it is solved, in any order. Stopped refits are left out.
pub fn resampled(
    problem: &dyn Resample,
    numbers: &[u64],
    draw: &(dyn Fn(u64) -> Data + Sync),
    values: &Values<'_>,
    (see, watch): (&(dyn Fn(&Replicate) + Sync), &Watch<'_>),
) -> Vec<Replicate> {
    let replicate = |number: &u64| {
        if (watch.stops)() {
            return None;
        }
        let found = problem.refitted(draw(*number), watch);
        if found.is_none() && (watch.stops)() {
            return None;
        }
        let replicate = Replicate {
            number: *number,
            values: found.map(|own| values(&own)),
        };
        see(&replicate);
        (watch.done)();
        Some(replicate)
    };
    // One refit per job, since a refit may take ten times as long as another.
    let found = numbers.par_iter().with_max_len(1).map(replicate);
    found.collect::<Vec<_>>().into_iter().flatten().collect()
}

/// Spread of values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Standard deviation.
    pub sd: f64,
    /// Lower end of the percentile interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Number of values.
    pub count: usize,
}

/// The spread of values other than NaN: a central interval that contains the share `level` of them (the percentile
/// interval; quantiles are interpolated linearly: Hyndman & Fan, Am. Stat. 50, 1996, number 7). `None` for fewer than
/// two values.
pub fn spread(values: impl Iterator<Item = f64>, level: f64) -> Option<Spread> {
    let mut all: Vec<f64> = values.filter(|value| !value.is_nan()).collect();
    all.sort_by(f64::total_cmp);
    let count = all.len();
    if count < 2 {
        return None;
    }
    let mean = all.iter().sum::<f64>() / count as f64;
    let squares: f64 = all.iter().map(|value| (value - mean).powi(2)).sum();
    Some(Spread {
        sd: (squares / (count - 1) as f64).sqrt(),
        low: quantile(&all, 0.5 * (1.0 - level)),
        high: quantile(&all, 0.5 * (1.0 + level)),
        count,
    })
}
