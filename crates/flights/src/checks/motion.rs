//! Checks of whole flights: whether they move, and as their targets do.

use super::Check;
use crate::Trial;
use pilotage_inference::sampling::{self, median_step};
use pilotage_inference::statistics::range;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Range of the positions below which a run does not move [m].
const STILL: f64 = 1e-6;
/// A run is driven if its target is at least this part of its largest error away from its start; outliers are excluded
/// by the quantile below.
const DRIVEN: f64 = 0.5;
const NEARLY_ALL: f64 = 0.85;
/// Longest delay \[s\] between targets and positions, and number of delays tried.
const LONGEST_DELAY: f64 = 1.5;
const DELAYS: u32 = 15;
/// Minimum correlation of positions with targets for a meaningful slope.
const FOLLOWS: f64 = 0.7;
/// Slopes of positions over targets that humans produce; initially they are small. Slopes outside indicate another
/// unit: feet give 3.28.
const SLOPES: std::ops::RangeInclusive<f64> = -0.1..=2.5;
/// Slope of positions that follow targets closely, with a larger correlation, below which the targets have another unit:
/// centimetres give 0.01.
const SMALL: f64 = 0.05;
const CLOSELY: f64 = 0.8;
/// Positions follow targets from another origin if they do so with a larger correlation and one of these slopes, and are
/// beside them by this part of the targets' range.
const FOLLOWED: f64 = 0.9;
const NEAR_ONE: std::ops::RangeInclusive<f64> = 0.5..=1.5;
const BESIDE: f64 = 0.5;

/// The checks of whole flights.
pub(super) fn of_motion(trials: &[Trial]) -> Vec<Check> {
    let all = [
        movement(trials),
        origin(trials),
        time_scale(trials),
        dead_stick(trials),
        copy(trials),
    ];
    all.into_iter().flatten().collect()
}

/// Flights with bitwise identical samples.
fn copy(trials: &[Trial]) -> Option<Check> {
    let bits = |trial: &Trial| -> Vec<u64> {
        let columns = [&trial.time, &trial.target, &trial.position];
        let values = columns.into_iter().chain(&trial.stick).flatten();
        values.map(|value| value.to_bits()).collect()
    };
    let mut known: HashMap<Vec<u64>, &Trial> = HashMap::new();
    let mut copies: Vec<(&Trial, &Trial)> = Vec::new();
    for trial in trials {
        match known.entry(bits(trial)) {
            Entry::Occupied(first) => copies.push((trial, first.get())),
            Entry::Vacant(place) => _ = place.insert(trial),
        }
    }
    let (copy, first) = copies.first()?;
    Some(Check::Copy {
        run: copy.name.clone(),
        of: first.name.clone(),
        count: copies.len(),
    })
}

fn finite(values: &[f64]) -> impl Iterator<Item = f64> {
    values.iter().copied().filter(|value| value.is_finite())
}

fn is_still(trial: &Trial) -> bool {
    let [least, most] = range(&trial.position);
    most - least <= STILL
}

/// Diagnoses the motion of one or all runs.
fn movement(trials: &[Trial]) -> Option<Check> {
    if trials.iter().all(is_still) {
        return Some(Check::ConstantData);
    }
    let largest =
        |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |m: f64, v| m.max(v.abs()));
    let of_run = |trial: &Trial| {
        let errors = trial
            .target
            .iter()
            .zip(&trial.position)
            .map(|(w, z)| (w - z).abs());
        let mut errors: Vec<f64> = errors.filter(|e| e.is_finite()).collect();
        errors.sort_by(f64::total_cmp);
        // Without outliers.
        let last = (NEARLY_ALL * errors.len() as f64) as usize;
        // A target that moves forces, wherever the run begins.
        let [low, high] = range(&trial.target);
        let forcing = trial.forcing().max(high - low);
        (forcing, errors.get(last).copied().unwrap_or(0.0))
    };
    let all: Vec<(f64, f64)> = trials.iter().map(of_run).collect();
    let is_driven = |&(forcing, error): &(f64, f64)| forcing >= DRIVEN * error && forcing > STILL;
    if let Some(factor) = wrong_scale(trials) {
        return Some(Check::WrongScale { factor, run: None });
    }
    let of_one = |trial: &Trial| {
        let factor = wrong_scale(std::slice::from_ref(trial))?;
        let run = Some(trial.name.clone());
        Some(Check::WrongScale { factor, run })
    };
    if let Some(one) = trials.iter().find_map(of_one).filter(|_| trials.len() > 1) {
        return Some(one);
    }
    let none = Check::NoForcing {
        forcing: largest(&mut all.iter().map(|run| run.0)),
        error: largest(&mut all.iter().map(|run| run.1)),
    };
    (!all.iter().any(is_driven)).then_some(none)
}

/// Slope of positions over targets, both relative to the start, at the delay with the highest correlation, if no human
/// produces it. A negative slope is used only if no delay gives a positive correlation.
fn wrong_scale(trials: &[Trial]) -> Option<f64> {
    let all =
        (0..=DELAYS).map(|k| followed(trials, LONGEST_DELAY * f64::from(k) / f64::from(DELAYS)));
    let all: Vec<[f64; 2]> = all.collect();
    let best = |sign: f64| {
        let all = all.iter().filter(move |own| sign * own[0] > FOLLOWS);
        all.max_by(|a, b| (sign * a[0]).total_cmp(&(sign * b[0])))
    };
    let [correlation, slope] = *best(1.0).or_else(|| best(-1.0))?;
    let is_small = slope.abs() < SMALL && correlation.abs() > CLOSELY;
    (!SLOPES.contains(&slope) || is_small).then_some(slope)
}

/// The first run whose positions follow a moving target beside it.
fn origin(trials: &[Trial]) -> Option<Check> {
    let of_run = |trial: &Trial| {
        let [low, high] = range(&trial.target);
        let step = median_step(&trial.time)?;
        let beside = |k: u32| {
            let late = LONGEST_DELAY * f64::from(k) / f64::from(DELAYS) / step;
            let late = late.round() as usize;
            let pairs = trial.target.iter().zip(trial.position.iter().skip(late));
            let pairs = pairs.filter(|(_, z)| z.is_finite()).map(|(w, z)| (*w, *z));
            line(&pairs.collect::<Vec<_>>())
        };
        let all = (0..=DELAYS).map(beside);
        let best = all.max_by(|a, b| a.correlation.total_cmp(&b.correlation))?;
        let is_beside = best.offset.abs() > BESIDE * (high - low)
            && best.correlation > FOLLOWED
            && NEAR_ONE.contains(&best.slope);
        is_beside.then(|| Check::Origin {
            run: trial.name.clone(),
            offset: best.offset,
        })
    };
    trials.iter().find_map(of_run)
}

/// Second values over first ones.
struct Line {
    correlation: f64,
    slope: f64,
    /// Difference of the means.
    offset: f64,
}

fn line(pairs: &[(f64, f64)]) -> Line {
    let count = pairs.len() as f64;
    let sum = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>();
    let (a, b) = (sum(&|own| own.0) / count, sum(&|own| own.1) / count);
    let product = sum(&|own| (own.0 - a) * (own.1 - b));
    let first = sum(&|own| (own.0 - a).powi(2));
    let second = sum(&|own| (own.1 - b).powi(2));
    Line {
        correlation: product / (first * second).sqrt(),
        slope: product / first,
        offset: b - a,
    }
}

/// Correlation of positions with the targets `delay` seconds earlier, and the slope between them.
fn followed(trials: &[Trial], delay: f64) -> [f64; 2] {
    let (mut product, mut targets, mut positions) = (0.0, 0.0, 0.0);
    for trial in trials {
        let origin = trial.origin();
        let step = median_step(&trial.time).unwrap_or(f64::INFINITY);
        let late = (delay / step).round() as usize;
        let pairs = trial.target.iter().zip(trial.position.iter().skip(late));
        for (target, z) in pairs.filter(|(_, z)| z.is_finite()) {
            let (target, z) = (target - origin, z - origin);
            product += target * z;
            targets += target * target;
            positions += z * z;
        }
    }
    [product / (targets * positions).sqrt(), product / targets]
}

fn time_scale(trials: &[Trial]) -> Option<Check> {
    let runs = trials.iter().map(|trial| trial.time.as_slice());
    let [duration, step] = sampling::time_scale(runs)?;
    Some(Check::TimeScale { duration, step })
}

fn dead_stick(trials: &[Trial]) -> Option<Check> {
    let is_dead = |trial: &&Trial| {
        let stick = trial.stick.as_deref().unwrap_or_default();
        let known = finite(stick).count();
        let [low, high] = range(stick);
        known > 1 && low == high && !is_still(trial)
    };
    let trial = trials.iter().find(is_dead)?;
    Some(Check::DeadStick {
        run: trial.name.clone(),
        value: range(trial.stick.as_deref()?)[0],
    })
}
