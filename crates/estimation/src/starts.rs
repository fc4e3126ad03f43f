//! Where the search begins: at the given start, and elsewhere in the ranges.

use crate::posed::{Posed, Stands};
use crate::unknowns::Unknown;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Uniform};

/// Part of the starts of a parameter without a lower end that have the other sign than its given one.
const TURNED: f64 = 0.3;

/// Seed of the starts.
const SEED: u64 = 0;

/// A start away from the given one, where a range has no end, is at most this many times larger or smaller.
const REACH: f64 = 10.0;

/// So many starts, each with the shared parameters and then those of the runs, as the search sees them. The first is
/// the given one; the others fill the ranges evenly (Latin hypercube: McKay, Beckman & Conover, Technometrics 21, 1979).
pub fn drawn(posed: &Posed<'_>, count: usize) -> Vec<Vec<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let size = posed.shared + (posed.states.len() - posed.joint.model.states.len());
    let mut starts = vec![vec![0.0; size]; count];
    let mut state = posed.shared;
    for (unknown, stands) in &posed.unknowns {
        let places: Vec<usize> = match stands {
            Stands::Shared(k) => vec![*k],
            Stands::Subjects(all) => all.iter().map(|(_, k)| *k).collect(),
            Stands::State(_) => {
                state += 1;
                vec![state - 1]
            }
        };
        let values = column(unknown, count, &mut random);
        for (start, value) in starts.iter_mut().zip(values) {
            places.iter().for_each(|k| start[*k] = value);
        }
    }
    starts
}

/// Values of one unknown: the given start, then one from each of equal parts of its range, in random order.
fn column(unknown: &Unknown, count: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut parts: Vec<usize> = (1..count).collect();
    let unit = Uniform::new(0.0, 1.0).expect("not empty");
    // Fisher and Yates.
    for k in (1..parts.len()).rev() {
        let other = (unit.sample(random) * (k + 1) as f64) as usize;
        parts.swap(k, other.min(k));
    }
    let mut values = vec![unknown.searched(unknown.start)];
    for part in parts {
        let share = ((part - 1) as f64 + unit.sample(random)) / (count - 1) as f64;
        values.push(unknown.searched(at_share(unknown, share)));
    }
    values
}

/// The value that has this share of the range below it: of the logarithm where the range spans much more than its
/// lower end, or has none.
fn at_share(unknown: &Unknown, share: f64) -> f64 {
    let start = unknown.start;
    let between = |low: f64, high: f64| low + share * (high - low);
    let ratio = |low: f64, high: f64| low * (high / low).powf(share);
    match (unknown.min, unknown.max) {
        (Some(min), Some(max)) if min > 0.0 && max > REACH * min => ratio(min, max),
        (Some(min), Some(max)) => between(min, max),
        _ if start == 0.0 => {
            let size = unknown.nominal.unwrap_or(1.0);
            between(-size, size)
        }
        _ => {
            let is_turned = unknown.min.is_none() && !unknown.log && share < TURNED;
            let value = match is_turned {
                true => -start * (1.0 / REACH) * REACH.powf(2.0 * share / TURNED),
                false => start * ratio(1.0 / REACH, REACH),
            };
            value.clamp(
                unknown.min.unwrap_or(f64::NEG_INFINITY),
                unknown.max.unwrap_or(f64::INFINITY),
            )
        }
    }
}
