//! Bootstraps: the problem solved again with other data (Efron & Tibshirani, *An Introduction to the Bootstrap*, 1993).

use crate::solved::{Coordinate, Solved, Watch, solve_from_afar};
use pilotage_collocation::{Collocation, Run};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;

/// Data of a refit.
#[derive(Debug, Clone)]
pub struct Sample {
    /// Its runs.
    pub runs: Vec<Run>,
    /// Of which run of the solved problem each of them is.
    pub from: Vec<usize>,
}

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

/// What is told of a refit: of its sample, its problem and its variables.
pub type Values<'a> = dyn Fn(&Sample, &Collocation, &[f64]) -> Vec<f64> + Sync + 'a;

/// Refits with these numbers to what `draw` gives each, in parallel: the same for any number of threads. `see` gets each
/// as soon as it is there, in any order. Stopped ones are left out.
pub fn resampled(
    solved: &Solved,
    numbers: &[u64],
    draw: &(dyn Fn(u64) -> Sample + Sync),
    values: &Values<'_>,
    (see, watch): (&(dyn Fn(&Replicate) + Sync), &Watch<'_>),
) -> Vec<Replicate> {
    let replicate = |number: &u64| {
        if (watch.stops)() {
            return None;
        }
        let sample = draw(*number);
        let (problem, z) = posed(solved, &sample);
        let found = solve_from_afar(&problem, z, &solved.options, watch);
        if found.is_none() && (watch.stops)() {
            return None;
        }
        let replicate = Replicate {
            number: *number,
            values: found.map(|iterate| values(&sample, &problem, &iterate.z)),
        };
        see(&replicate);
        (watch.done)();
        Some(replicate)
    };
    // One at a time: a refit may take ten times as long as another.
    let found = numbers.par_iter().with_max_len(1).map(replicate);
    found.collect::<Vec<_>>().into_iter().flatten().collect()
}

/// The problem of other data, and its variables where the solved one has come to.
fn posed(solved: &Solved, sample: &Sample) -> (Collocation, Vec<f64>) {
    let whole = &solved.problem;
    let problem = Collocation::new(
        whole.model.tapes.clone(),
        whole.constraints.clone(),
        whole.scheme,
        sample.runs.clone(),
        whole.model.scales.clone(),
        &whole.bounds,
    );
    let own = sample
        .from
        .iter()
        .flat_map(|run| whole.coefficients(&solved.at.z, *run));
    let z = own.chain(whole.theta(&solved.at.z)).copied().collect();
    (problem, z)
}

impl Sample {
    /// The value of a coordinate of the solved problem; not a number where its run is not there.
    pub fn value(&self, at: Coordinate, problem: &Collocation, z: &[f64]) -> f64 {
        let own = match at {
            Coordinate::Shared(_) => Some(at),
            Coordinate::Initial { run, state } => {
                let place = self.from.iter().position(|from| *from == run);
                place.map(|run| Coordinate::Initial { run, state })
            }
        };
        own.map_or(f64::NAN, |own| own.value(problem, z))
    }
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
