//! Diagnostics of samples: outliers, jumps, flickering targets, runs that start in motion.

use super::{Diagnostic, Fit, FitOptions, Trial};
use crate::simulate::at_full_stick;
use crate::{InitialState, Objective, RunFit};
use pilotage_inference::outliers::{self, Breaks, Frozen, Kind, Values, median, resolution};
use pilotage_inference::sampling::{self, median_step};
use pilotage_inference::statistics::{range, rms};
use std::ops::Range;

/// Maximum number of samples by which a target differs in error.
const FLICKER: usize = 2;
/// Maximum change of a target next to such samples, relative to their deviation.
const QUIET: f64 = 0.1;
/// A signal that moves by this part of its range drives a vehicle.
const DRIVES: f64 = 0.3;
/// Duration of the first samples of a run [s], at least three, that show whether it moves.
const BEGINNING: f64 = 0.5;
/// Time within which a vehicle answers its target at once \[s\].
const ANSWER: f64 = 1.5;
/// A target differs by this multiple of its resolution at least.
const LEVELS: f64 = 2.5;
/// By how much positions must be late \[s\] to change a pilot's delay visibly.
const LATE: f64 = 0.02;
/// Number of standard errors by which a speed must exceed the possible speed from rest.
const SURE: f64 = 5.0;

/// The diagnostics of the samples that need no fit.
pub fn recorded(trials: &[Trial]) -> Vec<Diagnostic> {
    let looked_at: Vec<Values> = (trials.iter())
        .map(|trial| values(trial, trial.position.clone()))
        .collect();
    let (frozen, mut breaks) = broken(trials, &looked_at, Kind::Recorded);
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
        outlier(&breaks, &looked_at, None, trials, "m"),
        jump(&breaks, trials, "m"),
        frozen,
        trials.iter().find_map(frozen_target),
        clipped(trials),
        trials.iter().find_map(slow_sensor),
        trials.iter().find_map(target_outlier),
    ];
    all.into_iter().flatten().collect()
}

/// The diagnostics of the samples.
pub fn diagnostics(fit: &Fit, options: &FitOptions, trials: &[Trial]) -> Vec<Diagnostic> {
    let unit = options.objective.unit();
    let looked_at = looked_at(fit, trials);
    let kind = match fit.is_feasible() {
        true => Kind::Residuals,
        false => Kind::Recorded,
    };
    let (frozen, breaks) = broken(trials, &looked_at, kind);
    let all = [
        outlier(
            &breaks,
            &looked_at,
            fit.is_feasible().then_some(fit),
            trials,
            unit,
        ),
        jump(&breaks, trials, unit),
        frozen,
        trials.iter().find_map(frozen_target),
        clipped(trials),
        trials.iter().find_map(slow_sensor),
        trials.iter().find_map(target_outlier),
        moving(&looked_at, options, trials),
        gap(trials).filter(|_| !fit.is_feasible()),
        misfit(&looked_at, trials).filter(|_| fit.is_feasible()),
    ];
    all.into_iter().flatten().collect()
}

/// The residuals of each run, or the recorded positions if the fit is not feasible.
fn looked_at(fit: &Fit, trials: &[Trial]) -> Vec<Values> {
    let pairs = trials.iter().zip(&fit.runs);
    let of_run = |(trial, run): (&Trial, &RunFit)| match fit.is_feasible() {
        true => values(trial, run.residual.clone()),
        false => values(trial, trial.position.clone()),
    };
    pairs.map(of_run).collect()
}

/// Values at the samples of a run.
fn values(trial: &Trial, values: Vec<f64>) -> Values {
    Values {
        time: trial.time.clone(),
        values: outliers::of_fresh(values, &trial.position),
        resolution: resolution(&trial.position),
        modelled: Vec::new(),
    }
}

/// The largest outlier; its share of the objective if there is a fit.
fn outlier(
    breaks: &Breaks,
    looked_at: &[Values],
    fit: Option<&Fit>,
    trials: &[Trial],
    unit: &'static str,
) -> Option<Diagnostic> {
    let size = |(run, k): (usize, usize)| looked_at[run].values[k].abs();
    let (run, k) = (breaks.samples()).max_by(|a, b| size(*a).total_cmp(&size(*b)))?;
    let squares = breaks.samples().map(|sample| size(sample).powi(2));
    let share = |fit: &Fit| {
        let total = fit.residuals().filter(|r| r.is_finite()).map(|r| r * r);
        squares.sum::<f64>() / total.sum::<f64>()
    };
    Some(Diagnostic::Outlier {
        run: trials[run].name.clone(),
        time: trials[run].time[k],
        value: looked_at[run].values[k],
        unit,
        count: breaks.samples().count(),
        share: fit.map(share),
    })
}

fn jump(breaks: &Breaks, trials: &[Trial], unit: &'static str) -> Option<Diagnostic> {
    let (run, k, size) = breaks.jump()?;
    Some(Diagnostic::Jump {
        run: trials[run].name.clone(),
        time: trials[run].time[k],
        size,
        unit,
    })
}

/// The longest stretch in which a position stands still while the vehicle moves, and the breaks that are none of these.
fn broken(trials: &[Trial], looked_at: &[Values], kind: Kind) -> (Option<Diagnostic>, Breaks) {
    let mut breaks = Breaks::of(looked_at, kind);
    let mut all: Vec<(&Trial, Frozen)> = Vec::new();
    for (run, trial) in trials.iter().enumerate() {
        let mut frozen = outliers::frozen(&trial.position);
        frozen.retain(|own| !own.is_end || is_driven(trial, own.samples.clone()));
        breaks.forget_after(run, &frozen);
        all.extend(frozen.into_iter().map(|own| (trial, own)));
    }
    let count = all.len();
    let longest = all.into_iter().max_by_key(|(_, own)| own.samples.len());
    let diagnostic = longest.map(|(trial, own)| {
        let (first, last) = (own.samples.start, own.samples.end - 1);
        Diagnostic::Frozen {
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
    (diagnostic, breaks)
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
fn frozen_target(trial: &Trial) -> Option<Diagnostic> {
    let mut frozen = outliers::frozen(&trial.target);
    frozen.retain(|own| !own.is_end);
    let count = frozen.len();
    let own = frozen.into_iter().max_by_key(|own| own.samples.len())?;
    let value = trial.target[own.samples.start];
    Some(Diagnostic::Frozen {
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
fn clipped(trials: &[Trial]) -> Option<Diagnostic> {
    let all =
        (trials.iter()).filter_map(|own| Some((own, outliers::clipped(&own.position, None)?)));
    let (trial, (part, value)) = all.max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    Some(Diagnostic::Clipped {
        run: trial.name.clone(),
        value,
        part,
    })
}

/// Positions that most rows repeat.
fn slow_sensor(trial: &Trial) -> Option<Diagnostic> {
    let rows = outliers::rows_per_value(&trial.position)?;
    let late = 0.5 * (rows - 1) as f64 * median_step(&trial.time)?;
    (late >= LATE).then(|| Diagnostic::SlowSensor {
        run: trial.name.clone(),
        rows,
        late,
    })
}

/// A target that leaves its value for a few samples and returns to it, constant before and after.
fn target_outlier(trial: &Trial) -> Option<Diagnostic> {
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
                return Some(Diagnostic::TargetOutlier {
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

/// The run with the worst fit, if it is far worse than the others both in metres and relative to its task.
fn misfit(looked_at: &[Values], trials: &[Trial]) -> Option<Diagnostic> {
    let sizes: Vec<f64> = looked_at.iter().map(|own| rms(&own.values)).collect();
    let tasks: Vec<f64> = trials.iter().map(Trial::forcing).collect();
    let (run, ratio) = outliers::misfit(&sizes, &tasks)?;
    Some(Diagnostic::Misfit {
        run: trials[run].name.clone(),
        ratio,
    })
}

/// The longest time without rows. If the samples are the mesh's nodes, it is a single interval, over which no scheme is
/// accurate.
fn gap(trials: &[Trial]) -> Option<Diagnostic> {
    let of_run = |trial: &Trial| {
        let [from, to] = sampling::gap(&trial.time)?;
        let run = trial.name.clone();
        Some((to - from, Diagnostic::Gap { run, from, to }))
    };
    let all = trials.iter().filter_map(of_run);
    all.max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, diagnostic)| diagnostic)
}

/// A run that is fitted from rest but moves faster at its start than any vehicle from rest.
fn moving(looked_at: &[Values], options: &FitOptions, trials: &[Trial]) -> Option<Diagnostic> {
    if options.initial_state == InitialState::Free || options.objective == Objective::Stick {
        return None;
    }
    let noise = outliers::noise(looked_at);
    let of_run = |trial: &Trial| {
        let samples = beginning(trial);
        let count = samples.len() as f64;
        let (speed, time) = (slope(&samples)?, samples.iter().map(|(t, _)| t));
        let mean = time.clone().sum::<f64>() / count;
        let error = noise / time.map(|t| (t - mean).powi(2)).sum::<f64>().sqrt();
        let (first, last) = (samples[0].0, samples[samples.len() - 1].0);
        let most =
            at_full_stick(&options.vehicle, options.stick_limit, last - first) / (last - first);
        let run = trial.name.clone();
        let excess = speed.abs() - most - SURE * error;
        Some((excess, Diagnostic::Moving { run, speed, most }))
    };
    let all = trials.iter().filter_map(of_run);
    let (excess, diagnostic) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (excess > 0.0).then_some(diagnostic)
}

/// Times and positions of the first samples.
fn beginning(trial: &Trial) -> Vec<(f64, f64)> {
    let all = trial
        .time
        .iter()
        .copied()
        .zip(trial.position.iter().copied());
    let known: Vec<(f64, f64)> = all.filter(|(_, z)| z.is_finite()).collect();
    let end = known.first().map_or(0.0, |(t, _)| t + BEGINNING);
    let count = known.partition_point(|(t, _)| *t <= end).max(3);
    known.into_iter().take(count).collect()
}

/// The median slope between two samples (P. K. Sen, "Estimates of the regression coefficient based on Kendall's tau",
/// J. Am. Stat. Assoc. 63, 1968), robust to a few wrong samples.
fn slope(samples: &[(f64, f64)]) -> Option<f64> {
    let after = |i: usize| samples[i + 1..].iter().map(move |b| (samples[i], b));
    let pairs = (0..samples.len()).flat_map(after);
    let slopes = pairs.map(|(a, b)| (b.1 - a.1) / (b.0 - a.0));
    median(slopes).filter(|_| samples.len() >= 3)
}
