//! Runs in which a recording is later or earlier against the model than in the others: columns with different clocks.
//!
//! This is for vehicles: a human's own variation from run to run is of the same size.

use crate::outliers::median;
use crate::quantile;
use crate::statistics::range;

/// Longest shift that is looked for, relative to the run, and number of shifts up to it.
const LONGEST: f64 = 0.1;
const SHIFTS: i32 = 50;
/// Number of samples of a run from which on its shift is estimated.
const FEWEST: usize = 20;
/// Number of blocks of a run whose sums give the variance of its shift.
const BLOCKS: usize = 8;
/// A shift is certain from this multiple of its standard deviation on, and visible from this multiple of the time between
/// samples on.
const SURE: f64 = 5.0;
const SAMPLES: f64 = 0.5;
/// It is one run's own if it leaves at most this part of the run's squared residuals and is away from those of the other runs
/// by this multiple of their range,
const LEFT: f64 = 0.7;
const APART: f64 = 2.0;
/// or if normal shifts with the others' deviation have one like it with less than this probability.
const CHANCE: f64 = 0.01;

/// A signal of a run.
#[derive(Debug, Clone, Copy)]
pub struct Response<'a> {
    /// Times of the samples \[s\].
    pub time: &'a [f64],
    /// Recorded values; NaN where there is none.
    pub recorded: &'a [f64],
    /// Values of the model.
    pub modelled: &'a [f64],
}

/// The run whose recording is late, and by how much \[s\] relative to the other runs (negative: early). `None` if no run
/// differs, or there is only one.
pub fn late(runs: &[Response<'_>]) -> Option<(usize, f64)> {
    let shifts: Vec<(usize, Shift)> = (runs.iter().enumerate())
        .filter_map(|(run, own)| Some((run, own.shift()?)))
        .collect();
    let differs = |(run, own): &(usize, Shift)| {
        let others: Vec<&Shift> = (shifts.iter().filter(|other| other.0 != *run))
            .map(|other| &other.1)
            .collect();
        let all: Vec<f64> = others.iter().map(|other| other.by).collect();
        let by = own.by - median(all.iter().copied())?;
        let sd = own.sd.hypot(median(others.iter().map(|other| other.sd))?);
        let is_seen = by.abs() > (SURE * sd).max(SAMPLES * own.step);
        let is_alone = own.left <= LEFT && is_apart(own.by, &all);
        (is_seen && (is_alone || is_extreme(own.by, &all))).then_some((*run, by))
    };
    let all = shifts.iter().filter_map(differs);
    all.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
}

/// Whether a value is farther from the others than they are from each other.
fn is_apart(value: f64, others: &[f64]) -> bool {
    let [low, high] = range(others);
    value < low - APART * (high - low) || value > high + APART * (high - low)
}

/// Whether the others' mean and deviation make such a value among all of them improbable.
fn is_extreme(value: f64, others: &[f64]) -> bool {
    let count = others.len() as f64;
    let mean = others.iter().sum::<f64>() / count;
    let variance = others.iter().map(|own| (own - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let level = 1.0 - CHANCE / (count + 1.0);
    let sd = (variance * (1.0 + 1.0 / count)).sqrt();
    count > 1.0 && (value - mean).abs() > quantile(level, count - 1.0) * sd
}

/// The shift of the model's signal that is nearest to the recording.
#[derive(Debug, Clone, Copy)]
struct Shift {
    /// Time by which the recording is later \[s\].
    by: f64,
    /// Its standard deviation \[s\].
    sd: f64,
    /// Part of the squared residuals that it leaves.
    left: f64,
    /// Median time between samples \[s\].
    step: f64,
}

impl Response<'_> {
    fn shift(&self) -> Option<Shift> {
        let step = median(self.time.windows(2).map(|pair| pair[1] - pair[0]))?;
        let (first, last) = (*self.time.first()?, *self.time.last()?);
        let longest = LONGEST * (last - first);
        // The samples at which the model is known for all shifts.
        let inner = |k: &usize| {
            let time = self.time[*k];
            self.recorded[*k].is_finite() && time - first >= longest && last - time >= longest
        };
        let samples: Vec<usize> = (0..self.time.len()).filter(inner).collect();
        if samples.len() < FEWEST {
            return None;
        }
        let squares = |by: f64| -> f64 {
            let squares = samples
                .iter()
                .map(|&k| (self.recorded[k] - self.modelled_at(self.time[k] - by)).powi(2));
            squares.sum()
        };
        let width = longest / f64::from(SHIFTS);
        let shift = |i: i32| longest * f64::from(i) / f64::from(SHIFTS);
        let all: Vec<f64> = (-SHIFTS..=SHIFTS).map(|i| squares(shift(i))).collect();
        let best = (0..all.len()).min_by(|a, b| all[*a].total_cmp(&all[*b]))?;
        if best == 0 || best + 1 == all.len() {
            return None;
        }
        // The vertex of the parabola through the best and its neighbours.
        let (before, least, after) = (all[best - 1], all[best], all[best + 1]);
        let part = 0.5 * (before - after) / (before - 2.0 * least + after);
        let by = shift(best as i32 - SHIFTS) + part * width;
        let slope = |time: f64| {
            (self.modelled_at(time + width) - self.modelled_at(time - width)) / (2.0 * width)
        };
        // The variance of a sum of correlated terms, from its parts over blocks.
        let part = |&k: &usize| {
            let time = self.time[k] - by;
            let (slope, error) = (slope(time), self.recorded[k] - self.modelled_at(time));
            (slope * error, slope * slope)
        };
        let parts: Vec<(f64, f64)> = samples.iter().map(part).collect();
        let blocks = parts.chunks(parts.len().div_ceil(BLOCKS));
        let sums = blocks.map(|own| own.iter().map(|part| part.0).sum::<f64>().powi(2));
        let information: f64 = parts.iter().map(|part| part.1).sum();
        let sd = sums.sum::<f64>().sqrt() / information;
        Some(Shift {
            by,
            sd,
            left: squares(by) / squares(0.0),
            step,
        })
    }

    /// The model's value at a time, linear between samples.
    fn modelled_at(&self, time: f64) -> f64 {
        let after = self
            .time
            .partition_point(|own| *own < time)
            .clamp(1, self.time.len() - 1);
        let (a, b) = (after - 1, after);
        let part = (time - self.time[a]) / (self.time[b] - self.time[a]);
        self.modelled[a] + part * (self.modelled[b] - self.modelled[a])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Times, recorded and modelled values of a run of 40 s that is late by `by`.
    fn run(seed: u64, by: f64, noise: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let random = ChaCha8Rng::seed_from_u64(seed);
        let phase = seed as f64;
        let signal = |t: f64| (0.6 * t + phase).sin() + 0.5 * (1.7 * t + 3.0 * phase).sin();
        let time: Vec<f64> = (0..800).map(|k| 0.05 * f64::from(k)).collect();
        let modelled = time.iter().map(|t| signal(*t)).collect();
        let errors = Distribution::<f64>::sample_iter(StandardNormal, random);
        let late = time.iter().zip(errors);
        let recorded: Vec<f64> = late.map(|(t, e)| signal(t - by) + noise * e).collect();
        (time, recorded, modelled)
    }

    fn found(shifts: &[f64], noise: f64) -> Option<(usize, f64)> {
        let runs = shifts.iter().enumerate();
        let runs: Vec<_> = runs.map(|(k, by)| run(k as u64 + 1, *by, noise)).collect();
        let responses = runs.iter().map(|(time, recorded, modelled)| Response {
            time,
            recorded,
            modelled,
        });
        late(&responses.collect::<Vec<_>>())
    }

    /// As a fit leaves it that takes all runs for one: -0.07 s in two of them and 0.13 s in the third.
    #[test]
    fn a_late_run_is_found_with_its_delay() {
        for noise in [0.0, 0.02, 0.1] {
            let (run, by) = found(&[-0.07, 0.13, -0.07], noise).unwrap();
            assert_eq!(run, 1);
            assert!((by - 0.2).abs() < 0.02, "{by}");
            let (_, by) = found(&[0.1, -0.1], noise).unwrap();
            assert!((by.abs() - 0.2).abs() < 0.02, "{by}");
        }
        // Among eight, in noise of the size of the signal's.
        let mut shifts = [0.0; 8];
        shifts[5] = -0.3;
        assert_eq!(found(&shifts, 0.5).map(|own| own.0), Some(5));
    }

    #[test]
    fn runs_of_one_clock_and_runs_that_all_differ_are_not_late() {
        for noise in [0.0, 0.02, 0.3] {
            assert_eq!(found(&[0.0; 3], noise), None);
            // The model itself is late.
            assert_eq!(found(&[0.2; 3], noise), None);
            assert_eq!(found(&[0.1, -0.2, 0.15, -0.1, 0.0, 0.25], noise), None);
        }
        assert_eq!(found(&[0.3], 0.02), None);
        assert_eq!(found(&[], 0.02), None);
    }

    #[test]
    fn what_does_not_move_or_is_missing_is_not_late() {
        let (time, mut recorded, modelled) = run(1, 0.2, 0.02);
        recorded.iter_mut().for_each(|y| *y = f64::NAN);
        let still = vec![1.0; time.len()];
        let response = |recorded, modelled| Response {
            time: &time,
            recorded,
            modelled,
        };
        let other = response(&modelled, &modelled);
        assert_eq!(late(&[other, response(&recorded, &modelled)]), None);
        assert_eq!(late(&[other, response(&still, &still)]), None);
        assert_eq!(
            late(&[
                other,
                Response {
                    time: &[],
                    recorded: &[],
                    modelled: &[]
                }
            ]),
            None
        );
    }
}
