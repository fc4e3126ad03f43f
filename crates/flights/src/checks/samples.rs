//! Checks of samples: outliers, jumps, stretches that stand still, flickering targets.

use super::Check;
use crate::Trial;
use pilotage_inference::outliers::{self, Breaks, Frozen, Kind, Values, resolution};
use pilotage_inference::sampling::median_step;
use pilotage_inference::statistics::range;
use std::ops::Range;

/// Maximum number of samples by which a target differs in error.
const FLICKER: usize = 2;
/// Maximum change of a target next to such samples, relative to their deviation.
const QUIET: f64 = 0.1;
/// A signal that moves by this part of its range drives a vehicle.
const DRIVES: f64 = 0.3;
/// Time within which a vehicle answers its target at once \[s\].
const ANSWER: f64 = 1.5;
/// A target differs by this multiple of its resolution at least.
const LEVELS: f64 = 2.5;
/// By how much positions must be late \[s\] to change a pilot's delay visibly.
const LATE: f64 = 0.02;

/// The checks of the samples.
pub(super) fn of_samples(trials: &[Trial]) -> Vec<Check> {
    let looked_at: Vec<Values> = (trials.iter())
        .map(|trial| values(trial, trial.position.clone()))
        .collect();
    let (frozen, mut breaks) = broken(trials, &looked_at);
    // A vehicle may follow a target that jumps at once.
    let is_led = |run: usize, k: usize, size: f64| {
        let trial = &trials[run];
        let first = trial
            .time
            .partition_point(|time| *time < trial.time[k] - ANSWER);
        let steps = trial.target[first..=k].windows(2);
        let largest = steps
            .map(|pair| (pair[1] - pair[0]).abs())
            .fold(0.0, f64::max);
        largest > 0.5 * size.abs()
    };
    (breaks.jumps).retain(|&(run, k, size)| !is_led(run, k, size));
    let all = [
        outlier(&breaks, &looked_at, trials),
        jump(&breaks, trials),
        frozen,
    ];
    let all = all.into_iter().chain(of_columns(trials));
    all.flatten().collect()
}

/// The checks of columns, each by itself.
fn of_columns(trials: &[Trial]) -> [Option<Check>; 4] {
    [
        trials.iter().find_map(frozen_target),
        clipped(trials),
        trials.iter().find_map(slow_sensor),
        trials.iter().find_map(target_outlier),
    ]
}

/// Values at the samples of a run.
pub(super) fn values(trial: &Trial, values: Vec<f64>) -> Values {
    Values {
        time: trial.time.clone(),
        values: outliers::of_fresh(values, &trial.position),
        resolution: resolution(&trial.position),
        modelled: Vec::new(),
    }
}

/// The largest position among the outliers.
fn outlier(breaks: &Breaks, looked_at: &[Values], trials: &[Trial]) -> Option<Check> {
    let size = |(run, k): (usize, usize)| looked_at[run].values[k].abs();
    let (run, k) = (breaks.samples()).max_by(|a, b| size(*a).total_cmp(&size(*b)))?;
    Some(Check::Outlier {
        run: trials[run].name.clone(),
        time: trials[run].time[k],
        value: looked_at[run].values[k],
        count: breaks.samples().count(),
    })
}

/// The largest jump of a position.
fn jump(breaks: &Breaks, trials: &[Trial]) -> Option<Check> {
    let (run, k, size) = breaks.jump()?;
    Some(Check::Jump {
        run: trials[run].name.clone(),
        time: trials[run].time[k],
        size,
    })
}

/// The longest stretch in which a position stands still while the vehicle moves, and the breaks that are none of these.
fn broken(trials: &[Trial], looked_at: &[Values]) -> (Option<Check>, Breaks) {
    let mut breaks = Breaks::of(looked_at, Kind::Recorded);
    let mut all: Vec<(&Trial, Frozen)> = Vec::new();
    for (run, trial) in trials.iter().enumerate() {
        let mut frozen = outliers::frozen(&trial.position);
        frozen.retain(|own| !own.is_end || is_driven(trial, own.samples.clone()));
        breaks.forget_after(run, &frozen);
        all.extend(frozen.into_iter().map(|own| (trial, own)));
    }
    let count = all.len();
    let longest = all.into_iter().max_by_key(|(_, own)| own.samples.len());
    let check = longest.map(|(trial, own)| {
        let (first, last) = (own.samples.start, own.samples.end - 1);
        Check::Frozen {
            of: "position",
            run: trial.name.clone(),
            value: trial.position[first],
            from: trial.time[first],
            to: trial.time[last],
            size: own
                .next
                .map(|next| trial.position[next] - trial.position[first]),
            count,
        }
    });
    (check, breaks)
}

/// Whether the target or the stick moves within these samples: a vehicle does not rest then.
fn is_driven(trial: &Trial, samples: Range<usize>) -> bool {
    let moves = |signal: &[f64]| {
        let part = |own: &[f64]| {
            let [low, high] = range(own);
            high - low
        };
        part(&signal[samples.clone()]) > DRIVES * part(signal)
    };
    moves(&trial.target) || trial.stick.as_deref().is_some_and(moves)
}

/// The longest stretch in which a target stands still that moves before and afterwards.
fn frozen_target(trial: &Trial) -> Option<Check> {
    let mut frozen = outliers::frozen(&trial.target);
    frozen.retain(|own| !own.is_end);
    let count = frozen.len();
    let own = frozen.into_iter().max_by_key(|own| own.samples.len())?;
    let value = trial.target[own.samples.start];
    Some(Check::Frozen {
        of: "target",
        run: trial.name.clone(),
        value,
        from: trial.time[own.samples.start],
        to: trial.time[own.samples.end - 1],
        size: own.next.map(|next| trial.target[next] - value),
        count,
    })
}

/// The run most of whose positions stay at an end of their range.
fn clipped(trials: &[Trial]) -> Option<Check> {
    let all =
        (trials.iter()).filter_map(|own| Some((own, outliers::clipped(&own.position, None)?)));
    let (trial, (part, value)) = all.max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    Some(Check::Clipped {
        run: trial.name.clone(),
        value,
        part,
    })
}

/// Positions that most rows repeat.
fn slow_sensor(trial: &Trial) -> Option<Check> {
    let rows = outliers::rows_per_value(&trial.position)?;
    let late = 0.5 * (rows - 1) as f64 * median_step(&trial.time)?;
    (late >= LATE).then(|| Check::SlowSensor {
        run: trial.name.clone(),
        rows,
        late,
    })
}

/// A target that leaves its value for a few samples and returns to it, constant before and after.
pub(super) fn target_outlier(trial: &Trial) -> Option<Check> {
    let target = &trial.target;
    for count in 1..=FLICKER {
        for k in 2..target.len().saturating_sub(count + 1) {
            let (before, after) = (target[k - 1], target[k + count]);
            let inside = &target[k..k + count];
            let size = inside
                .iter()
                .fold(f64::INFINITY, |least: f64, w| least.min((w - before).abs()));
            let changes = [
                after - before,
                before - target[k - 2],
                target[k + count + 1] - after,
            ];
            let is_quiet = || changes.iter().all(|change| change.abs() <= QUIET * size);
            let is_seen = || {
                let others = [&target[..k], &target[k + count..]].concat();
                size > LEVELS * resolution(&others)
            };
            if size > 0.0 && is_quiet() && is_seen() {
                return Some(Check::TargetOutlier {
                    run: trial.name.clone(),
                    time: trial.time[k],
                    target: target[k],
                    around: before,
                });
            }
        }
    }
    None
}
