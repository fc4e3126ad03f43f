//! Samples that stand out: outliers, jumps, targets that flicker, runs that begin in motion.

use super::{Diagnostic, Fit, FitOptions, Trial};
use crate::simulate::at_full_stick;
use crate::statistics::{self, rms};
use crate::trials::median_step;
use crate::{InitialState, Objective, RunFit};

/// A break in a run's residuals is so many times what they change by from sample to sample nearby.
const BREAK: f64 = 10.0;
/// Samples before and after a break that say what is usual.
const NEARBY: usize = 10;
/// It is also more than this part of the spread of all residuals ...
const LARGE: f64 = 0.3;
/// ... and so many times the resolution of the recording.
const STEPS: f64 = 4.0;
/// Part of the distances between recorded values that is smaller than the resolution, by chance or by hand.
const CHANCE: f64 = 0.02;
/// Outliers come back to within this part of the largest break.
const BACK: f64 = 0.2;
/// They do so within this part of the run.
const SOON: f64 = 0.25;
/// A target that is elsewhere for no more samples is an error.
const FLICKER: usize = 2;
/// What a target may change by beside a flicker, as a part of it.
const QUIET: f64 = 0.1;
/// The first samples of a run [s], at least three, that say whether it moves.
const BEGINNING: f64 = 0.5;
/// A run is fitted far worse when its rms residual is so many times the median of all runs.
const WORSE: f64 = 3.0;
/// So many usual steps without a row are a gap.
const GAP: f64 = 10.0;
/// Standard errors that a speed is beyond what rest allows.
const SURE: f64 = 5.0;
/// Standard deviation of a normal distribution over its median magnitude.
const ROBUST: f64 = 1.4826;

/// The diagnostics.
pub fn diagnostics(fit: &Fit, options: &FitOptions, trials: &[Trial]) -> Vec<Diagnostic> {
    let unit = options.objective.unit();
    let signals = signals(fit, trials);
    let breaks = Breaks::of(&signals, fit.is_feasible());
    let all = [
        breaks.outlier(fit, unit),
        breaks.jump(unit),
        trials.iter().find_map(target_outlier),
        moving(&signals, options, trials),
        gap(trials).filter(|_| !fit.is_feasible()),
        misfit(&signals).filter(|_| fit.is_feasible()),
    ];
    all.into_iter().flatten().collect()
}

/// The median; 0 of nothing.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    statistics::median(values).unwrap_or(0.0)
}

/// A run and what is looked at: its residuals, or what was recorded where the fit has none.
struct Signal<'a> {
    trial: &'a Trial,
    values: &'a [f64],
}

fn signals<'a>(fit: &'a Fit, trials: &'a [Trial]) -> Vec<Signal<'a>> {
    let pairs = trials.iter().zip(&fit.runs);
    let signal = |(trial, run): (&'a Trial, &'a RunFit)| Signal {
        trial,
        values: match fit.is_feasible() {
            true => &run.residual,
            false => &trial.position,
        },
    };
    pairs.map(signal).collect()
}

/// Standard deviation of all values, whatever the outliers are.
fn spread(signals: &[Signal]) -> f64 {
    let all = signals.iter().flat_map(|signal| signal.values);
    ROBUST * median(all.map(|r| r.abs()).filter(|r| r.is_finite()))
}

/// What stands out of the runs.
struct Breaks<'a> {
    outliers: Vec<(&'a Signal<'a>, Vec<usize>)>,
    /// First sample after it, and how far.
    jumps: Vec<(&'a Signal<'a>, usize, f64)>,
}

impl<'a> Breaks<'a> {
    /// Of every run. A break is a change from one sample to the next that is far beyond the changes nearby, and
    /// beyond the spread of all residuals; of what was recorded, far beyond.
    fn of(signals: &'a [Signal<'a>], are_residuals: bool) -> Self {
        let mut found = Self {
            outliers: Vec::new(),
            jumps: Vec::new(),
        };
        let beyond = if are_residuals { LARGE } else { BREAK };
        let least = beyond * spread(signals);
        let usual = noise(signals) * 2.0_f64.sqrt();
        for signal in signals {
            found.of_run(signal, least, usual);
        }
        found
    }

    /// Of one run: what is `least` counts, and `usual` is how all runs change from sample to sample.
    fn of_run(&mut self, run: &'a Signal<'a>, least: f64, usual: f64) {
        let finite = |k: &usize| run.values[*k].is_finite();
        let known: Vec<usize> = (0..run.values.len()).filter(finite).collect();
        let least = least.max(STEPS * resolution(&run.trial.position));
        let breaks = breaks(run, &known, least, usual);
        let soon = (SOON * known.len() as f64) as usize;
        let mut next = 0;
        while let Some(&(at, size)) = breaks.get(next) {
            let group = &breaks[next..];
            let group = &group[..group.partition_point(|(k, _)| *k <= at + soon)];
            match returns(group) {
                // From the first sample after the break to the last before the return.
                Some(last) => {
                    let samples = &known[at + 1..=group[last].0];
                    self.outliers.push((run, samples.to_vec()));
                    next += last + 1;
                }
                None if at < FLICKER => {
                    self.outliers.push((run, known[..=at].to_vec()));
                    next += 1;
                }
                None if at + 1 + FLICKER >= known.len() => {
                    self.outliers.push((run, known[at + 1..].to_vec()));
                    next += 1;
                }
                None => {
                    self.jumps.push((run, known[at + 1], size));
                    next += 1;
                }
            }
        }
    }

    fn outlier(&self, fit: &Fit, unit: &'static str) -> Option<Diagnostic> {
        let samples = || {
            (self.outliers.iter())
                .flat_map(|(run, samples)| samples.iter().map(move |&k| (*run, k)))
        };
        let size = |(run, k): &(&Signal, usize)| run.values[*k].abs();
        let (run, k) = samples().max_by(|a, b| size(a).total_cmp(&size(b)))?;
        let squares = samples().map(|sample| size(&sample).powi(2)).sum::<f64>();
        let total: f64 = fit
            .residuals()
            .filter(|r| r.is_finite())
            .map(|r| r * r)
            .sum();
        Some(Diagnostic::Outlier {
            run: run.trial.name.clone(),
            time: run.trial.time[k],
            value: run.values[k],
            unit,
            count: samples().count(),
            share: fit.is_feasible().then_some(squares / total),
        })
    }

    fn jump(&self, unit: &'static str) -> Option<Diagnostic> {
        let &(run, k, size) = (self.jumps.iter()).max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()))?;
        Some(Diagnostic::Jump {
            run: run.trial.name.clone(),
            time: run.trial.time[k],
            size,
            unit,
        })
    }
}

/// Changes that stand out: the place, in `known`, before each, and its size.
fn breaks(run: &Signal, known: &[usize], least: f64, usual: f64) -> Vec<(usize, f64)> {
    let step = median_step(&run.trial.time).unwrap_or(0.0);
    let changes: Vec<f64> = (known.windows(2))
        .map(|pair| run.values[pair[1]] - run.values[pair[0]])
        .collect();
    // Over missing samples it may change by more.
    let time = |i: usize| run.trial.time[known[i]];
    let wait = |i: usize| ((time(i + 1) - time(i)) / step).max(1.0);
    let stands_out = |&i: &usize| {
        let others =
            (i.saturating_sub(NEARBY)..changes.len().min(i + NEARBY + 1)).filter(|j| *j != i);
        let middle = median(others.clone().map(|j| changes[j]));
        let around = ROBUST * median(others.map(|j| (changes[j] - middle).abs()));
        let change = (changes[i] - middle).abs();
        change > wait(i) * least.max(BREAK * around.max(usual))
    };
    (0..changes.len())
        .filter(stands_out)
        .map(|i| (i, changes[i]))
        .collect()
}

/// The step in which values were recorded: the least distance between two of them, but for a few [m].
fn resolution(values: &[f64]) -> f64 {
    let mut values: Vec<f64> = values.iter().copied().filter(|z| z.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let distances = values.windows(2).map(|pair| pair[1] - pair[0]);
    let mut distances: Vec<f64> = distances.filter(|distance| *distance > 0.0).collect();
    distances.sort_by(f64::total_cmp);
    let few = (CHANCE * distances.len() as f64) as usize;
    distances.get(few).copied().unwrap_or(0.0)
}

/// Which break of a group brings it back to where it was before the first.
fn returns(group: &[(usize, f64)]) -> Option<usize> {
    let (mut sum, mut largest) = (0.0, 0.0_f64);
    for (i, (_, size)) in group.iter().enumerate() {
        sum += size;
        largest = largest.max(size.abs());
        if i > 0 && f64::abs(sum) <= BACK * largest {
            return Some(i);
        }
    }
    None
}

/// A target that leaves its value for some samples and comes back to it, quiet before and after.
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
            if size > 0.0 && changes.iter().all(|change| change.abs() <= QUIET * size) {
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

/// The run that is fitted worst, where it is far worse than the others in metres and by the size of its task.
fn misfit(signals: &[Signal]) -> Option<Diagnostic> {
    let sizes: Vec<f64> = (signals.iter().map(|signal| rms(signal.values))).collect();
    let parts: Vec<f64> = (signals.iter().zip(&sizes))
        .map(|(signal, rms)| rms / signal.trial.forcing())
        .collect();
    let worst = (0..sizes.len()).max_by(|a, b| sizes[*a].total_cmp(&sizes[*b]))?;
    let others = |values: &[f64]| median(values.iter().copied());
    let is_worse = |values: &[f64]| values[worst] > WORSE * others(values);
    (signals.len() > 2 && is_worse(&sizes) && is_worse(&parts)).then(|| Diagnostic::Misfit {
        run: signals[worst].trial.name.clone(),
        ratio: sizes[worst] / others(&sizes),
    })
}

/// The longest time without a row, where the samples are the mesh's nodes: one interval, over which no scheme is right.
fn gap(trials: &[Trial]) -> Option<Diagnostic> {
    let of_run = |trial: &Trial| {
        let usual = median_step(&trial.time)?;
        let longest =
            (trial.time.windows(2)).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))?;
        let (from, to) = (longest[0], longest[1]);
        let gap = Diagnostic::Gap {
            run: trial.name.clone(),
            from,
            to,
        };
        (to - from > GAP * usual).then_some((to - from, gap))
    };
    let all = trials.iter().filter_map(of_run);
    all.max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, diagnostic)| diagnostic)
}

/// A run that is fitted from rest and moves faster at once than any vehicle from rest.
fn moving(signals: &[Signal], options: &FitOptions, trials: &[Trial]) -> Option<Diagnostic> {
    if options.initial_state == InitialState::Free || options.objective == Objective::Stick {
        return None;
    }
    let noise = noise(signals);
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

/// Standard deviation of the measurement noise: what a value differs by from the one before.
fn noise(signals: &[Signal]) -> f64 {
    let pairs = signals.iter().flat_map(|signal| signal.values.windows(2));
    let changes = pairs.map(|pair| (pair[1] - pair[0]).abs());
    ROBUST * median(changes.filter(|change| change.is_finite())) / 2.0_f64.sqrt()
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

/// The median slope between two samples (P. K. Sen, "Estimates of the regression coefficient based on Kendall's
/// tau", J. Am. Stat. Assoc. 63, 1968): a wrong sample or two do not move it.
fn slope(samples: &[(f64, f64)]) -> Option<f64> {
    let after = |i: usize| samples[i + 1..].iter().map(move |b| (samples[i], b));
    let pairs = (0..samples.len()).flat_map(after);
    let slopes = pairs.map(|(a, b)| (b.1 - a.1) / (b.0 - a.0));
    (samples.len() >= 3).then(|| median(slopes))
}
