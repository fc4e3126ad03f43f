//! Outliers in a set of runs: samples that differ from their neighbours, and runs with a far worse fit.

mod tail;

use crate::statistics::{range, rms};
use std::ops::Range;

/// Neighbouring changes in its direction are below this part of a jump: else it is a movement. So are those of outliers that are
/// more than a few.
const ALONE: f64 = 0.3;
/// A jump of residuals keeps this part of its size for as long as this number of samples, in which noise that has a memory forgets.
const STAYS_AWAY: f64 = 0.5;
const LONG: usize = 30;
/// A break exceeds the usual change between neighbouring samples by this factor.
const BREAK: f64 = 10.0;
/// Number of samples before and after a break that define the usual change.
const NEARBY: usize = 10;
/// It also exceeds this part of the spread of all residuals, or of all recorded values, ...
const LARGE: f64 = 0.3;
const LARGE_RECORDED: f64 = 0.1;
/// ... and this multiple of the recording's resolution.
const STEPS: f64 = 4.0;
/// Share of distances between recorded values that may be below the resolution, by chance or by manual edits.
const CHANCE: f64 = 0.02;
/// A break of the model larger than this part of the residuals' break explains it.
const OWN: f64 = 0.2;
/// Outliers return to within this part of the largest break.
const BACK: f64 = 0.2;
/// They return within this part of the run.
const SOON: f64 = 0.25;
/// Up to this many samples before or after a break at the end of a run are outliers too.
const FEW: usize = 2;
/// Number of samples before and after a break whose medians are the levels there.
const BESIDE: usize = 5;
/// A recording stands still if it keeps a value for this multiple of the usual number of samples, ...
const KEPT: f64 = 8.0;
/// ... and makes up for it by this multiple of the usual change.
const CAUGHT_UP: f64 = 5.0;
/// Before, it moves at this part of the speed that it makes up for, or of the usual one at the end of a run, or more: else it
/// was at rest.
const MOVED: f64 = 0.2;
/// Number of changes on either side without which a recording does not move.
const MOVES: usize = 3;
/// A sensor is slow if it keeps each value for this many rows or more, and for as many within this part of it or one row, for
/// this part of its values.
const SLOW: f64 = 3.0;
const REGULAR: f64 = 0.1;
const MOSTLY: f64 = 0.8;
/// Part of the samples at the ends of their range from which on a recording is clipped, ...
const CLIPPED: f64 = 0.05;
/// ... of stretches of this many samples or more, ...
const STAYS: usize = 5;
/// ... if its range has this many steps of its resolution (a coarser recording is constant anywhere), ...
const LEVELS: f64 = 20.0;
/// ... if a model moves by this part of the range meanwhile, ...
const GOES_ON: f64 = 0.05;
/// ... or, without a model, this many steps of the resolution are passed within this number of samples before and after.
const ABRUPT: f64 = 4.0;
const ARRIVAL: usize = 2;
/// Number of samples from which on a run of one value can be judged.
const ALWAYS: usize = 20;
/// Values of which more than one in this number breaks away have no usual change. Recorded values that break away more
/// often than one in the second number may be the motion itself.
const FEWER: usize = 4;
const FEWER_RECORDED: usize = 25;
/// Recorded values that come back later than after this number of samples have moved.
const FEW_RECORDED: usize = 3;
/// Ratio of a run's rms residual to the median of all runs above which its fit is far worse.
const WORSE: f64 = 3.0;
/// Ratio of the standard deviation of a normal distribution to its median magnitude.
const ROBUST: f64 = 1.4826;

/// Residuals or recorded values of a run. NaN where there is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Values {
    /// Times of the samples \[s\].
    pub time: Vec<f64>,
    /// The values.
    pub values: Vec<f64>,
    /// Step in which the values were recorded, in their unit ([`resolution`]).
    pub resolution: f64,
    /// For residuals, the model's values in their unit: if they break too, the model is wrong there, as the
    /// approximation of a delay is after a step. Empty to skip this check.
    pub modelled: Vec<f64>,
}

/// Kind of the values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Recorded minus modelled values: their size is compared with the spread of all.
    Residuals,
    /// Recorded values: their changes include the vehicle's motion.
    Recorded,
}

/// Breaks found in runs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Breaks {
    /// Run, and samples that break away and return.
    pub outliers: Vec<(usize, Vec<usize>)>,
    /// Run, first sample after a break that does not return, and its size.
    pub jumps: Vec<(usize, usize, f64)>,
}

/// A stretch in which a recording stands still.
#[derive(Debug, Clone, PartialEq)]
pub struct Frozen {
    /// The samples, which all have one value or none.
    pub samples: Range<usize>,
    /// The next sample with a value; `None` at the end of the run.
    pub next: Option<usize>,
    /// Whether the run begins or ends with it. A vehicle may rest there: it takes an input that moves, or a model, to
    /// tell.
    pub is_end: bool,
}

impl Values {
    /// The samples next to a break that are away from their neighbours on both sides, if these have the same level: few
    /// outliers, also if the change to or from them is too small for a break. Indices in `known`.
    fn few_beside(&self, known: &[usize], at: usize, size: f64) -> Option<Range<usize>> {
        let value = |i: usize| self.values[known[i]];
        let (first, end) = ((at + 1).checked_sub(BESIDE)?, at + 1 + BESIDE);
        let level = |all: Range<usize>| median(all.map(value));
        let (before, after) = (level(first..at + 1)?, level(at + 1..end.min(known.len()))?);
        if end > known.len() || (after - before).abs() > BACK * size.abs() {
            return None;
        }
        let is_away = |i: usize| (value(i) - 0.5 * (before + after)).abs() > 0.5 * size.abs();
        let mut few = at + 1..at + 1;
        while few.start > first && is_away(few.start - 1) {
            few.start -= 1;
        }
        while few.end < end && is_away(few.end) {
            few.end += 1;
        }
        (!few.is_empty() && few.len() <= BESIDE / 2).then_some(few)
    }
}

impl Values {
    /// Whether a change is one from one sample to the next, and no part of a movement.
    fn is_alone(&self, known: &[usize], at: usize, size: f64) -> bool {
        let change = |i: usize| self.values[known[i + 1]] - self.values[known[i]];
        let beside = [
            at.checked_sub(1),
            Some(at + 1).filter(|i| i + 1 < known.len()),
        ];
        let mut beside = beside.into_iter().flatten().map(change);
        beside.all(|own| own * size.signum() < ALONE * size.abs())
    }

    /// Whether samples that break away and return are few, or do so from one sample to the next. Recorded values are not looked
    /// at: few of them are outliers at all.
    fn is_sudden(&self, known: &[usize], group: &[(usize, f64)], last: usize, kind: Kind) -> bool {
        let is_alone = |(at, size): (usize, f64)| self.is_alone(known, at, size);
        let few = group[last].0 - group[0].0 <= BESIDE;
        kind == Kind::Recorded || few || (is_alone(group[0]) && is_alone(group[last]))
    }

    /// Whether the values stay away after a jump from one sample to the next.
    fn stays(&self, known: &[usize], at: usize, size: f64) -> bool {
        let level = |all: Range<usize>| median(all.map(|i| self.values[known[i]]));
        let before = level((at + 1).saturating_sub(NEARBY)..at + 1);
        let after = (at + 1 + LONG).min(known.len());
        let after = level(after - NEARBY.min(after - at - 1)..after);
        let is_away = before.zip(after).is_some_and(|(before, after)| {
            (after - before) * size.signum() > STAYS_AWAY * size.abs()
        });
        is_away && self.is_alone(known, at, size)
    }
}

impl Breaks {
    /// Finds the breaks of these runs. A break is a change between samples that is far beyond the changes nearby and
    /// beyond a part of the spread of all values.
    pub fn of(runs: &[Values], kind: Kind) -> Self {
        let mut found = Self::default();
        let (part, fewer) = match kind {
            Kind::Residuals => (LARGE, FEWER),
            Kind::Recorded => (LARGE_RECORDED, FEWER_RECORDED),
        };
        let mut least = part * spread(runs);
        if kind == Kind::Residuals {
            least = least.max(tail::end(runs));
        }
        let usual = noise(runs) * 2.0_f64.sqrt();
        for (run, own) in runs.iter().enumerate() {
            found.of_run((run, own), (least, usual), fewer, kind);
        }
        if kind == Kind::Recorded {
            (found.outliers).retain(|(_, samples)| samples.len() <= FEW_RECORDED);
        }
        found
    }

    /// Adds the breaks of one run. If they are more than one in `fewer` samples, they are motion but for samples that are away
    /// from the same level before and after them. `least` is the smallest break, `usual` the typical change between samples of
    /// all runs.
    fn of_run(
        &mut self,
        (run, own): (usize, &Values),
        (least, usual): (f64, f64),
        fewer: usize,
        kind: Kind,
    ) {
        let finite = |k: &usize| own.values[*k].is_finite();
        let known: Vec<usize> = (0..own.values.len()).filter(finite).collect();
        let least = least.max(STEPS * own.resolution);
        let breaks = breaks(own, &known, least, usual);
        if breaks.len() * FEWER > known.len() {
            return;
        }
        let is_motion = breaks.len() * fewer > known.len();
        let soon = (SOON * known.len() as f64) as usize;
        let mut next = 0;
        while let Some(&(at, size)) = breaks.get(next) {
            if let Some(few) = own.few_beside(&known, at, size) {
                self.outliers.push((run, known[few.clone()].to_vec()));
                next += breaks[next..].partition_point(|(k, _)| *k < few.end);
                continue;
            }
            if is_motion {
                next += 1;
                continue;
            }
            let group = &breaks[next..];
            let group = &group[..group.partition_point(|(k, _)| *k <= at + soon)];
            match returns(group) {
                Some(last) if !own.is_sudden(&known, group, last, kind) => next += last + 1,
                // From the first sample after the break to the last one before the return.
                Some(last) => {
                    let samples = &known[at + 1..=group[last].0];
                    self.outliers.push((run, samples.to_vec()));
                    next += last + 1;
                }
                None if at < FEW => {
                    self.outliers.push((run, known[..=at].to_vec()));
                    next += 1;
                }
                None if at + 1 + FEW >= known.len() => {
                    self.outliers.push((run, known[at + 1..].to_vec()));
                    next += 1;
                }
                None if kind == Kind::Residuals && !own.stays(&known, at, size) => next += 1,
                None => {
                    self.jumps.push((run, known[at + 1], size));
                    next += 1;
                }
            }
        }
    }

    /// All outliers as pairs of run and sample.
    pub fn samples(&self) -> impl Iterator<Item = (usize, usize)> + Clone {
        let all = self.outliers.iter();
        all.flat_map(|(run, samples)| samples.iter().map(move |k| (*run, *k)))
    }

    /// Forgets the jumps with which a recording ends a stretch in which it stood still.
    pub fn forget_after(&mut self, run: usize, frozen: &[Frozen]) {
        let is_after = |k: usize| frozen.iter().any(|own| own.next == Some(k));
        self.jumps.retain(|(of, k, _)| *of != run || !is_after(*k));
    }

    /// The largest jump.
    pub fn jump(&self) -> Option<(usize, usize, f64)> {
        let jumps = self.jumps.iter().copied();
        jumps.max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()))
    }
}

/// Breaks: the index in `known` before each, and its size.
fn breaks(own: &Values, known: &[usize], least: f64, usual: f64) -> Vec<(usize, f64)> {
    let step = median(own.time.windows(2).map(|pair| pair[1] - pair[0])).unwrap_or(0.0);
    let changes_of = |values: &[f64]| -> Vec<f64> {
        let pairs = known.windows(2);
        pairs
            .map(|pair| values[pair[1]] - values[pair[0]])
            .collect()
    };
    let changes = changes_of(&own.values);
    let modelled = (!own.modelled.is_empty()).then(|| changes_of(&own.modelled));
    // Across missing samples a larger change is allowed.
    let time = |i: usize| own.time[known[i]];
    let wait = |i: usize| ((time(i + 1) - time(i)) / step).max(1.0);
    let stands_out = |&i: &usize| {
        let (change, around) = beyond(&changes, i);
        let is_own = (modelled.as_ref()).is_some_and(|own| beyond(own, i).0 > OWN * change);
        change > wait(i) * least.max(BREAK * around.max(usual)) && !is_own
    };
    (0..changes.len())
        .filter(stands_out)
        .map(|i| (i, changes[i]))
        .collect()
}

/// Difference of a change from the usual one nearby, and the spread of the changes nearby.
fn beyond(changes: &[f64], i: usize) -> (f64, f64) {
    let others = (i.saturating_sub(NEARBY)..changes.len().min(i + NEARBY + 1)).filter(|j| *j != i);
    let middle = median(others.clone().map(|j| changes[j])).unwrap_or(0.0);
    let around = median(others.map(|j| (changes[j] - middle).abs())).unwrap_or(0.0);
    ((changes[i] - middle).abs(), ROBUST * around)
}

/// Index of the break of a group after which the values are back at the level before the first.
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

/// The run with the worst fit, and its rms residual over the median of all; `None` unless it is far worse than the
/// others both in its unit and relative to its task (the size of the commanded motion).
pub fn misfit(rms: &[f64], tasks: &[f64]) -> Option<(usize, f64)> {
    let parts: Vec<f64> = rms
        .iter()
        .zip(tasks)
        .map(|(rms, task)| rms / task)
        .collect();
    let worst = (0..rms.len()).max_by(|a, b| rms[*a].total_cmp(&rms[*b]))?;
    let others = |values: &[f64]| median(values.iter().copied()).unwrap_or(0.0);
    let is_worse = |values: &[f64]| values[worst] > WORSE * others(values);
    (rms.len() > 2 && is_worse(rms) && is_worse(&parts)).then(|| (worst, rms[worst] / others(rms)))
}

/// The stretches in which a recording repeats a value though it moved before, and afterwards makes up for the motion that it
/// has missed: a sensor that stood still. At the start and the end of a run one of these is enough, and a run may be of one
/// value. Values that are all kept for long, as by a sensor that is slower than the recording, are none, nor is an end
/// of the range that is reached more than once: a stop, or the end of what the sensor measures.
pub fn frozen(values: &[f64]) -> Vec<Frozen> {
    let kept = kept(values);
    if kept.len() == 1 && kept[0].len() >= ALWAYS {
        return vec![Frozen {
            samples: 0..values.len(),
            next: None,
            is_end: true,
        }];
    }
    let value = |i: usize| values[kept[i][0]];
    let changes: Vec<f64> = (1..kept.len())
        .map(|i| (value(i) - value(i - 1)).abs())
        .collect();
    let least = STEPS * resolution(values);
    let typical = median(changes.iter().copied()).unwrap_or(0.0);
    let last = changes.len();
    let ends = range(values);
    let is_stop = |i: usize| {
        let again = (0..kept.len()).filter(|j| value(*j) == value(i)).count();
        ends.contains(&value(i)) && again > 1
    };
    // Change `i` leads from value `i` to the next one.
    let is_frozen = |&i: &usize| {
        let near = i.saturating_sub(NEARBY)..(i + NEARBY).min(last);
        let beside = |j: &usize| *j != i && *j + 1 != i;
        let lengths = (near.clone().filter(beside)).map(|j| kept[j].len() as f64);
        let around = near.filter(beside).map(|j| changes[j]);
        let (Some(usual), Some(around)) = (median(lengths), median(around)) else {
            return false;
        };
        let length = kept[i].len() as f64;
        // What comes to rest at the end by itself slows down before.
        let before = changes[i.saturating_sub(MOVES)..i].iter().copied();
        let before = before.fold(0.0, f64::max);
        let moved = match i == last {
            true => before >= least && before >= MOVED * typical,
            false => i == 0 || before / usual >= MOVED * changes[i] / length,
        };
        // A single sample that is away afterwards is an outlier.
        let after = median((i + 1..kept.len().min(i + 1 + BESIDE)).map(value));
        let stays = after.is_none_or(|own| (own - value(i)).abs() > 0.5 * changes[i]);
        let caught_up = i == last || (changes[i] > (CAUGHT_UP * around).max(least) && stays);
        length >= KEPT * usual && moved && caught_up && !is_stop(i)
    };
    let is_inner = |i: &usize| (MOVES..last.saturating_sub(MOVES - 1)).contains(i);
    let looked_at = |i: &usize| last >= NEARBY && (is_inner(i) || *i == 0 || *i == last);
    let stretch = |i: usize| Frozen {
        samples: kept[i][0]..kept[i][kept[i].len() - 1] + 1,
        next: kept.get(i + 1).map(|own| own[0]),
        is_end: i == 0 || i == last,
    };
    let all = (0..kept.len()).filter(looked_at).filter(is_frozen);
    all.map(stretch).collect()
}

/// The samples with a value, those of equal successive values together.
fn kept(values: &[f64]) -> Vec<Vec<usize>> {
    let finite = |k: &usize| values[*k].is_finite();
    let known: Vec<usize> = (0..values.len()).filter(finite).collect();
    let kept = known.chunk_by(|a, b| values[*a] == values[*b]);
    kept.map(<[usize]>::to_vec).collect()
}

/// Whether each sample is new, if most repeat the one before: those of a sensor that is slower than the recording. All are
/// new otherwise.
fn fresh(values: &[f64]) -> Vec<bool> {
    let kept = kept(values);
    // Not if a vehicle rests for long: every second value is kept at least.
    let is_slow = median(kept.iter().map(|own| own.len() as f64)) >= Some(2.0);
    let mut fresh = vec![!is_slow; values.len()];
    kept.iter().for_each(|own| fresh[own[0]] = true);
    fresh
}

/// Values at the samples of a recording, NaN where a slow sensor repeats what it recorded: that is no sample.
pub fn of_fresh(mut values: Vec<f64>, recorded: &[f64]) -> Vec<f64> {
    for (value, is_fresh) in values.iter_mut().zip(fresh(recorded)) {
        if !is_fresh {
            *value = f64::NAN;
        }
    }
    values
}

/// Number of rows for each value of a sensor that is slower than the recording; `None` if it is not. Values that stay because
/// they are recorded in coarse steps change by one of these, and stay for as long as the motion is slow.
pub fn rows_per_value(values: &[f64]) -> Option<usize> {
    let kept = kept(values);
    let inner = kept.get(1..kept.len().saturating_sub(1))?;
    if inner.len() < NEARBY {
        return None;
    }
    let lengths = inner.iter().map(|own| own.len() as f64);
    let usual = median(lengths.clone())?;
    let is_usual = |length: &f64| (length - usual).abs() <= (REGULAR * usual).max(1.0);
    let regular = lengths.filter(is_usual).count();
    let changes = inner
        .windows(2)
        .map(|pair| (values[pair[1][0]] - values[pair[0][0]]).abs());
    let is_slow = usual >= SLOW
        && regular as f64 >= MOSTLY * inner.len() as f64
        && median(changes)? > STEPS * resolution(values);
    is_slow.then_some(usual as usize)
}

/// Error of the repeated values: their rms distance from the lines between the new ones. 0 if there are none.
pub fn error_of_repeats(time: &[f64], values: &[f64]) -> f64 {
    let kept = kept(values);
    let off = |pair: &[Vec<usize>]| -> Vec<f64> {
        let (from, to) = (pair[0][0], pair[1][0]);
        let slope = (values[to] - values[from]) / (time[to] - time[from]);
        let own = pair[0].iter();
        own.map(|&k| slope * (time[k] - time[from])).collect()
    };
    let all: Vec<f64> = kept.windows(2).flat_map(off).collect();
    if all.is_empty() { 0.0 } else { rms(&all) }
}

/// The part of a recording that stays at an end of its range, and that end; `None` if it is small or the recording too coarse
/// to tell. What is at rest there does not count, nor do the start and the end of a recording: with the values of a model,
/// which does not move meanwhile; without, it arrives and leaves slowly.
pub fn clipped(values: &[f64], modelled: Option<&[f64]>) -> Option<(f64, f64)> {
    let known = |k: &usize| values[*k].is_finite();
    let known: Vec<usize> = (0..values.len()).filter(known).collect();
    let of = |all: &[f64]| -> Vec<f64> { known.iter().map(|k| all[*k]).collect() };
    let (all, modelled) = (of(values), modelled.map(of));
    let ([lowest, highest], step) = (range(&all), resolution(&all));
    if all.is_empty() || highest - lowest < LEVELS * step {
        return None;
    }
    // Rows for each value of a slow sensor.
    let rows = rows_per_value(&all).unwrap_or(1);
    let is_cut = |own: &Range<usize>| {
        let (value, last) = (all[own.start], all.len() - 1);
        let is_far = |near: usize| (all[near] - value).abs() > ABRUPT * step;
        if own.len() < STAYS * rows || own.start == 0 || own.end > last {
            return false;
        }
        match &modelled {
            Some(modelled) => {
                let [low, high] = range(&modelled[own.clone()]);
                high - low > GOES_ON * (highest - lowest)
            }
            None => {
                is_far(own.start.saturating_sub(ARRIVAL * rows))
                    && is_far((own.end - 1 + ARRIVAL * rows).min(last))
            }
        }
    };
    let stays = |end: f64| -> usize {
        let mut first = 0;
        let stretches = all.chunk_by(|a, b| (*a == end) == (*b == end));
        let placed = stretches.map(|own| {
            first += own.len();
            first - own.len()..first
        });
        let cut = placed.filter(|own| all[own.start] == end && is_cut(own));
        cut.map(|own| own.len()).sum()
    };
    let [low, high] = [lowest, highest].map(stays);
    let part = (low + high) as f64 / all.len() as f64;
    let end = if high >= low { highest } else { lowest };
    (part >= CLIPPED).then_some((part, end))
}

/// Step in which values were recorded: the smallest distance between two of them, apart from a few exceptions.
pub fn resolution(values: &[f64]) -> f64 {
    let mut values: Vec<f64> = values.iter().copied().filter(|z| z.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let distances = values.windows(2).map(|pair| pair[1] - pair[0]);
    let mut distances: Vec<f64> = distances.filter(|distance| *distance > 0.0).collect();
    distances.sort_by(f64::total_cmp);
    let few = (CHANCE * distances.len() as f64) as usize;
    distances.get(few).copied().unwrap_or(0.0)
}

/// Standard deviation of white noise in the values, from the differences of successive ones; 0 if there are none.
pub fn noise(runs: &[Values]) -> f64 {
    let pairs = runs.iter().flat_map(|run| run.values.windows(2));
    let changes = pairs.map(|pair| (pair[1] - pair[0]).abs());
    ROBUST * median(changes.filter(|change| change.is_finite())).unwrap_or(0.0) / 2.0_f64.sqrt()
}

/// Robust standard deviation of all values.
fn spread(runs: &[Values]) -> f64 {
    let all = runs.iter().flat_map(|run| &run.values);
    ROBUST * median(all.map(|r| r.abs()).filter(|r| r.is_finite())).unwrap_or(0.0)
}

/// The median, the upper of the two middle values for an even number; `None` without values.
pub fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests;
