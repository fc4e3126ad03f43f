//! Starts of the search: the given one, and others drawn from the ranges.

use crate::posed::Posed;
use crate::posed::unknowns::Unknown;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Uniform};

/// Number of starts that are drawn together, with the given one among the first.
pub(crate) const BLOCK: usize = 8;

/// Of the drawn starts, every other one differs from the given start at most by this factor.
const NEAR: f64 = 3.0;

/// The others lie in the range, or, if it is unbounded, differ at most by this factor.
const FAR: f64 = 10.0;

/// Ratio of the ends of a range that is wide.
const WIDE: f64 = 1e4;

/// Fraction of far starts with the sign opposite to the given start, for a parameter without a lower bound.
const TURNED: f64 = 0.3;

/// A start of the search.
#[derive(Debug, Clone)]
pub struct Start {
    /// The shared parameters followed by those of the runs, in the coordinates of the search.
    pub parameters: Vec<f64>,
    /// Whether measured states start as recorded. Otherwise all states are simulated.
    pub follows: bool,
    /// Whether the parameters are those of a fit, of other equations or fewer runs.
    pub is_fitted: bool,
    /// Whether they are those of a fit of the order below.
    pub is_raised: bool,
}

/// Returns `count` starts. The first is the given one with measured states as recorded, the second is the same with all
/// states simulated, the others are drawn. Each is the same whatever the count.
pub fn starts(posed: &Posed<'_>, count: usize) -> Vec<Start> {
    starts_with(posed, count, posed.followed.is_some())
}

/// The same without the second, for a search that leads to recorded states.
pub(crate) fn recorded(posed: &Posed<'_>, count: usize) -> Vec<Start> {
    starts_with(posed, count, false)
}

fn starts_with(posed: &Posed<'_>, count: usize, simulates: bool) -> Vec<Start> {
    let follows = posed.followed.is_some();
    let two = usize::from(simulates && count > 1);
    let drawn = drawn(posed, count - two, BLOCK - 1 - two);
    let start = |parameters: &Vec<f64>| Start {
        parameters: parameters.clone(),
        follows,
        is_fitted: false,
        is_raised: false,
    };
    let mut all: Vec<Start> = drawn.iter().map(start).collect();
    if all.len() < count {
        let simulated = Start {
            follows: false,
            ..all[0].clone()
        };
        all.insert(1, simulated);
    }
    all
}

/// The given start, with all states simulated.
pub fn given(posed: &Posed<'_>) -> Start {
    Start {
        parameters: drawn(posed, 1, 1).remove(0),
        follows: false,
        is_fitted: false,
        is_raised: false,
    }
}

/// Parameters of `count` starts. The first are the given ones. The others fill the ranges evenly, so many at a time (Latin
/// hypercubes: McKay, Beckman & Conover, Technometrics 21, 1979).
fn drawn(posed: &Posed<'_>, count: usize, block: usize) -> Vec<Vec<f64>> {
    let size = posed.shared + (posed.states.len() - posed.joint.model.states.len());
    let mut given = vec![0.0; size];
    for (unknown, stands) in &posed.unknowns {
        let value = unknown.searched(unknown.start);
        (posed.places(stands).iter()).for_each(|k| given[*k] = value);
    }
    let mut starts = vec![given.clone()];
    for seed in 0.. {
        if starts.len() >= count {
            break;
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut others = vec![given.clone(); block];
        for (unknown, stands) in &posed.unknowns {
            let places = posed.places(stands);
            let is_far = seed > 0 && unknown.is_wide();
            let values = column(unknown, (block, is_far), &mut random);
            for (start, value) in others.iter_mut().zip(values) {
                places.iter().for_each(|k| start[*k] = value);
            }
        }
        others
            .iter_mut()
            .for_each(|own| keep_constraints(posed, &given, own));
        starts.append(&mut others);
    }
    starts.truncate(count);
    starts
}

/// Moves a start towards the given one until its parameters satisfy the constraints on parameters that the given ones do, such as
/// stability: from others a search rarely leads anywhere.
fn keep_constraints(posed: &Posed<'_>, given: &[f64], start: &mut [f64]) {
    const HALVINGS: usize = 20;
    let values = |start: &[f64]| -> Vec<f64> { posed.constraints.values(&start[..posed.shared]) };
    let asked = values(given);
    let holds = |start: &[f64]| {
        let mut pairs = values(start).into_iter().zip(&asked);
        pairs.all(|(own, asked)| own > 0.0 || *asked <= 0.0)
    };
    for _ in 0..HALVINGS {
        if holds(start) {
            return;
        }
        let pairs = start.iter_mut().zip(given);
        pairs.for_each(|(own, given)| *own = 0.5 * (*own + given));
    }
    start.copy_from_slice(given);
}

/// Values of one unknown: one from each of several equal parts of its range, in random order. Every other one is near the start
/// unless all are asked to be far.
fn column(unknown: &Unknown, (count, is_far): (usize, bool), random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut parts: Vec<usize> = (0..count).collect();
    let unit = Uniform::new(0.0, 1.0).expect("not empty");
    // Fisher–Yates shuffle.
    for k in (1..parts.len()).rev() {
        let other = (unit.sample(random) * (k + 1) as f64) as usize;
        parts.swap(k, other.min(k));
    }
    let share = |part: usize| (part as f64 + unit.sample(random)) / count as f64;
    let mut shares: Vec<f64> = parts.into_iter().map(share).collect();
    turn_one(unknown, &mut shares);
    let values = shares
        .into_iter()
        .enumerate()
        .map(|(k, share)| match is_far || k % 2 == 1 {
            true => far(unknown, share),
            false => near(unknown, share),
        });
    values.map(|value| unknown.searched(value)).collect()
}

/// Ensures that one of the far starts has the opposite sign: a search near a wrong sign does not leave it.
fn turn_one(unknown: &Unknown, shares: &mut [f64]) {
    let far = shares.iter_mut().skip(1).step_by(2);
    if let Some(least) = far
        .min_by(|a, b| a.total_cmp(b))
        .filter(|_| unknown.may_turn())
        && *least >= TURNED
    {
        *least *= TURNED;
    }
}

/// The quantile `share` of the neighbourhood of the start.
fn near(unknown: &Unknown, share: f64) -> f64 {
    let start = unknown.start;
    let value = match start == 0.0 {
        true => (2.0 * share - 1.0) * unknown.nominal.unwrap_or(1.0),
        false => start * NEAR.powf(2.0 * share - 1.0),
    };
    unknown.kept(value)
}

/// The quantile `share` of the range. The scale is logarithmic if the range spans much more than its lower bound, or than the
/// start where it begins at 0, or is unbounded.
fn far(unknown: &Unknown, share: f64) -> f64 {
    match (unknown.min, unknown.max) {
        (Some(min), Some(max)) if min > 0.0 && max > FAR * min => min * (max / min).powf(share),
        (Some(0.0), Some(max)) if unknown.start > 0.0 && max > FAR * unknown.start => {
            let min = unknown.start / FAR;
            min * (max / min).powf(share)
        }
        (Some(min), Some(max)) => min + share * (max - min),
        _ if unknown.start == 0.0 => near(unknown, share),
        _ if unknown.may_turn() && share < TURNED => {
            unknown.kept(-unknown.start * FAR.powf(2.0 * share / TURNED - 1.0))
        }
        _ => unknown.kept(unknown.start * FAR.powf(2.0 * share - 1.0)),
    }
}

impl Unknown {
    /// Whether the range spans so many decades that few starts come near any place in it.
    pub(crate) fn is_wide(&self) -> bool {
        let range = self.min.zip(self.max);
        range.is_some_and(|(min, max)| min > 0.0 && max >= WIDE * min)
    }

    /// Whether far starts may have the opposite sign.
    fn may_turn(&self) -> bool {
        let has_room = self.start > 0.0 || self.max.is_none_or(|max| max > 0.0);
        self.min.is_none() && has_room && !self.log && self.start != 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::file::Per;

    #[test]
    fn of_eight_starts_one_has_the_other_sign() {
        let unknown = Unknown {
            name: "gain".into(),
            unit: None,
            start: -0.03,
            min: None,
            max: None,
            nominal: None,
            log: false,
            prior: None,
            per: Per::All,
            unless_needed: None,
            place: None,
        };
        let mut random = ChaCha8Rng::seed_from_u64(0);
        for _ in 0..50 {
            let values = column(&unknown, (7, false), &mut random);
            assert!(values.iter().any(|value| *value > 0.0), "{values:?}");
        }
        let kept = Unknown {
            max: Some(0.0),
            ..unknown
        };
        let values = column(&kept, (7, false), &mut random);
        assert!(values.iter().all(|value| *value < 0.0), "{values:?}");
    }
}
