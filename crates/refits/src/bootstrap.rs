//! Bootstraps: the problem solved again with other data (Efron & Tibshirani, *An Introduction to the Bootstrap*, 1993).

use crate::refit::{Data, Found, Resample};
use crate::solved::Watch;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;

/// A refit.
#[derive(Debug, Clone, PartialEq)]
pub struct Replicate {
    /// Which, from 0.
    pub number: u64,
    /// The values of what is sought; none where it did not converge, and not a number where its runs do not tell.
    pub values: Option<Vec<f64>>,
}

/// Random numbers of a replicate: the same whoever else draws.
pub fn random(seed: u64, number: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    random
}

/// How often each of so many runs is drawn in as many draws with replacement.
pub fn counts(runs: usize, random: &mut ChaCha8Rng) -> Vec<usize> {
    let mut counts = vec![0; runs];
    for _ in 0..runs {
        counts[below(runs as u64, random) as usize] += 1;
    }
    counts
}

/// A whole number below another, each with the same probability: draws that would favour some are drawn again.
fn below(end: u64, random: &mut ChaCha8Rng) -> u64 {
    let least = end.wrapping_neg() % end;
    loop {
        let product = u128::from(random.next_u64()) * u128::from(end);
        if product as u64 >= least {
            return (product >> 64) as u64;
        }
    }
}

/// What is told of a refit with other data.
pub type Values<'a> = dyn Fn(&Found) -> Vec<f64> + Sync + 'a;

/// Refits with these numbers to what `draw` gives each, in parallel: the same for any number of threads. `see` gets each
/// as soon as it is there, in any order. Stopped ones are left out.
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
    // One at a time: a refit may take ten times as long as another.
    let found = numbers.par_iter().with_max_len(1).map(replicate);
    found.collect::<Vec<_>>().into_iter().flatten().collect()
}

/// What values spread over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Standard deviation.
    pub sd: f64,
    /// Lower end of the percentile interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// How many there are.
    pub count: usize,
}

/// The spread of values, without those that are no numbers: an interval that holds this part of them, with as many
/// below as above (the percentile interval; quantiles between two values are on the line through them: Hyndman & Fan,
/// Am. Stat. 50, 1996, number 7). None of fewer than two.
pub fn spread(values: impl Iterator<Item = f64>, level: f64) -> Option<Spread> {
    let mut all: Vec<f64> = values.filter(|value| !value.is_nan()).collect();
    all.sort_by(f64::total_cmp);
    let count = all.len();
    if count < 2 {
        return None;
    }
    let mean = all.iter().sum::<f64>() / count as f64;
    let squares: f64 = all.iter().map(|value| (value - mean).powi(2)).sum();
    let quantile = |part: f64| {
        let place = part * (count - 1) as f64;
        let (k, rest) = (place as usize, place.fract());
        all[k] + rest * (all[(k + 1).min(count - 1)] - all[k])
    };
    Some(Spread {
        sd: (squares / (count - 1) as f64).sqrt(),
        low: quantile(0.5 * (1.0 - level)),
        high: quantile(0.5 * (1.0 + level)),
        count,
    })
}
