//! Whole periods of forcing functions that are sums of sines, and their lines.

use super::fourier::amplitudes;
use nalgebra::Complex;
use std::cmp::Ordering;
use std::f64::consts::TAU;
use std::ops::Range;

/// Minimum number of samples of a run for a spectrum.
const FEWEST: usize = 32;
/// Relative deviation from the mean step up to which samples are evenly spaced.
const EVEN: f64 = 0.01;
/// Maximum number of window lengths, the smoothest continuations first, for which spectra are computed.
const CANDIDATES: usize = 24;
/// Number of bins on each side of a line that define the floor.
const AROUND: usize = 6;
/// Minimum power of a line relative to that floor, and relative to the largest line.
const ABOVE: f64 = 100.0;
const LEAST: f64 = 1e-5;
/// Minimum number of bins per line of a sum of sines; steps at equal intervals have power in most bins.
const FEW: usize = 5;
/// Minimum share of the power in the lines of a sum of sines.
const CONCENTRATED: f64 = 0.999;
/// Junctions within this factor of the signal's own roughness count as equally smooth; among them the longest window is
/// first.
const SMOOTH: f64 = 10.0;
/// Share of power next to the lines below which no other window is tried.
const CLEAN: f64 = 1e-6;
/// Range of values, relative to their size, below which they are constant.
const STILL: f64 = 1e-9;

/// Why a run has no lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Unfit {
    /// Too few samples.
    #[error("has fewer than {FEWEST} samples")]
    Few,
    /// Samples are not evenly spaced.
    #[error("has samples that are not evenly spaced")]
    Uneven,
    /// Samples within whole periods are missing or not finite.
    #[error("has missing samples")]
    Missing,
    /// No forcing function moves.
    #[error("has a target that stands still")]
    Still,
    /// Not a sum of sines over whole periods.
    #[error("has a target that is no sum of a few sines over whole periods")]
    NoLines,
}

/// Whole periods at the end of a run, where the initial transient has decayed.
#[derive(Debug, Clone, PartialEq)]
pub struct Window {
    /// Index of the first sample.
    pub first: usize,
    /// Number of samples.
    pub length: usize,
    /// Distance of samples \[s\].
    pub step: f64,
    /// Lines of each forcing function as ascending multiples of 2π/(length · step). A line shared by two of them is in
    /// neither list; a constant one has none.
    pub lines: Vec<Vec<usize>>,
    /// All lines, including shared ones.
    pub(super) excited: Vec<usize>,
}

impl Window {
    /// Finds the window of forcing functions with samples at these times \[s\].
    ///
    /// # Errors
    /// If they have no lines.
    pub fn of(time: &[f64], forcing: &[&[f64]]) -> Result<Self, Unfit> {
        let n = time.len();
        let step = even_step(time)?;
        let moving: Vec<usize> = (0..forcing.len()).filter(|k| moves(forcing[*k])).collect();
        if forcing
            .iter()
            .any(|own| own.len() != n || own.iter().any(|x| !x.is_finite()))
        {
            return Err(Unfit::Missing);
        }
        if moving.is_empty() {
            return Err(Unfit::Still);
        }
        let signals: Vec<&[f64]> = moving.iter().map(|k| forcing[*k]).collect();
        let (length, own) = cleanest(&signals).ok_or(Unfit::NoLines)?;
        let mut lines = vec![Vec::new(); forcing.len()];
        for (k, own) in moving.into_iter().zip(own) {
            lines[k] = own;
        }
        let (lines, excited) = parted(lines);
        let first = n - length;
        Ok(Self {
            first,
            length,
            step,
            lines,
            excited,
        })
    }

    /// Distance of the bins [rad/s].
    pub fn spacing(&self) -> f64 {
        TAU / (self.length as f64 * self.step)
    }

    /// The base frequency, of which all lines are integer multiples [rad/s].
    pub fn base(&self) -> f64 {
        let divisor = self.excited.iter().copied().fold(0, gcd);
        self.spacing() * divisor as f64
    }

    /// Amplitudes of a signal in the window; `None` if samples are missing.
    pub fn amplitudes(&self, values: &[f64]) -> Option<Vec<Complex<f64>>> {
        let own = values.get(self.first..self.first + self.length)?;
        own.iter().all(|x| x.is_finite()).then(|| amplitudes(own))
    }
}

fn gcd(a: usize, b: usize) -> usize {
    match b {
        0 => a,
        _ => gcd(b, a % b),
    }
}

/// Distance of evenly spaced samples \[s\].
fn even_step(time: &[f64]) -> Result<f64, Unfit> {
    if time.len() < FEWEST {
        return Err(Unfit::Few);
    }
    let mean = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
    let is_even = |pair: &[f64]| (pair[1] - pair[0] - mean).abs() <= EVEN * mean;
    match mean > 0.0 && time.windows(2).all(is_even) {
        true => Ok(mean),
        false => Err(Unfit::Uneven),
    }
}

fn moves(values: &[f64]) -> bool {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    most - least > STILL * most.abs().max(least.abs())
}

/// Window lengths of at least half the run, ordered by how smoothly all signals continue periodically: by the third
/// differences across the junction, relative to those within.
fn candidates(signals: &[&[f64]]) -> Vec<usize> {
    let n = signals[0].len();
    let third = |x: [f64; 4]| (x[3] - 3.0 * x[2] + 3.0 * x[1] - x[0]).powi(2);
    let within = |x: &[f64]| {
        let all = x.windows(4).map(|x| third([x[0], x[1], x[2], x[3]]));
        all.sum::<f64>() / (n - 3) as f64
    };
    let own: Vec<f64> = signals.iter().map(|x| within(x)).collect();
    let junction = |length: usize| -> f64 {
        let over = |(x, own): (&&[f64], &f64)| {
            let at = |k: usize| x[n - length + (length - 3 + k) % length];
            let all = (0..3).map(|k| third([at(k), at(k + 1), at(k + 2), at(k + 3)]));
            all.sum::<f64>() / own.max(f64::MIN_POSITIVE)
        };
        signals.iter().zip(&own).map(over).sum()
    };
    let mut all: Vec<(f64, usize)> = (n.div_ceil(2)..=n).map(|m| (junction(m), m)).collect();
    let rank = |own: &(f64, usize)| (own.0.max(SMOOTH), usize::MAX - own.1);
    all.sort_by(|a, b| rank(a).partial_cmp(&rank(b)).unwrap_or(Ordering::Equal));
    all.into_iter().take(CANDIDATES).map(|own| own.1).collect()
}

/// The first window with negligible power next to the lines, otherwise the one with the least, and the lines of each
/// signal.
fn cleanest(signals: &[&[f64]]) -> Option<(usize, Vec<Vec<usize>>)> {
    let mut best: Option<(f64, usize, Vec<Vec<usize>>)> = None;
    for length in candidates(signals) {
        let found = concentrated(signals, length);
        let is_better =
            |own: &(f64, usize, Vec<Vec<usize>>)| best.as_ref().is_none_or(|best| own.0 < best.0);
        best = found.filter(is_better).or(best);
        if best.as_ref().is_some_and(|best| best.0 <= CLEAN) {
            break;
        }
    }
    best.map(|(_, length, lines)| (length, lines))
}

/// The largest share of a signal's power next to its lines in the last `length` samples, and the lines of each signal;
/// `None` if any is not a sum of a few sines there.
fn concentrated(signals: &[&[f64]], length: usize) -> Option<(f64, usize, Vec<Vec<usize>>)> {
    let (mut left, mut lines) = (0.0_f64, Vec::new());
    for x in signals {
        let all = amplitudes(&x[x.len() - length..]);
        let power: Vec<f64> = all.iter().map(Complex::norm_sqr).collect();
        let own = lines_of(&power);
        if own.is_empty() || own.len() * FEW > power.len() {
            return None;
        }
        let total: f64 = power.iter().sum();
        left = left.max(1.0 - own.iter().map(|k| power[*k]).sum::<f64>() / total);
        lines.push(own);
    }
    (left <= 1.0 - CONCENTRATED).then_some((left, length, lines))
}

/// Bins that exceed their neighbours.
fn lines_of(power: &[f64]) -> Vec<usize> {
    let most = power.iter().copied().fold(0.0, f64::max);
    // Every second bin may be a line, so a median could be a line itself.
    let quartile = |bins: Range<usize>| {
        let mut all: Vec<f64> = power[bins].to_vec();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 4).copied().unwrap_or(0.0)
    };
    // On both sides: a step or a ramp has high power below and low power above.
    let floor = |k: usize| {
        let below = quartile(k.saturating_sub(AROUND).max(1)..k);
        below.max(quartile(k + 1..(k + AROUND + 1).min(power.len())))
    };
    let is_line = |k: &usize| power[*k] > ABOVE * floor(*k) && power[*k] > LEAST * most;
    (1..power.len()).filter(is_line).collect()
}

/// The lines of each forcing function that no other has, and all lines.
fn parted(lines: Vec<Vec<usize>>) -> (Vec<Vec<usize>>, Vec<usize>) {
    let mut all = lines.concat();
    all.sort_unstable();
    let is_alone =
        |k: &usize| all.partition_point(|own| own <= k) - all.partition_point(|own| own < k) == 1;
    let alone = lines
        .iter()
        .map(|own| own.iter().copied().filter(|k| is_alone(k)).collect());
    let alone = alone.collect();
    let mut excited = all.clone();
    excited.dedup();
    (alone, excited)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(n: usize, period: f64, lines: &[usize]) -> Vec<f64> {
        let at = |t: usize| {
            let sine =
                |k: &usize| (TAU * *k as f64 * t as f64 / period + *k as f64).sin() / *k as f64;
            1.0 + lines.iter().map(sine).sum::<f64>()
        };
        (0..n).map(at).collect()
    }

    fn time(n: usize) -> Vec<f64> {
        (0..n).map(|k| k as f64 / 20.0).collect()
    }

    #[test]
    fn whole_periods_are_found_whatever_is_before_them() {
        for (n, period, length) in [
            (901, 900.0, 900),
            (1000, 900.0, 900),
            (901, 250.0, 750),
            (640, 640.0, 640),
        ] {
            let forcing = wave(n, period, &[2, 3, 5, 7, 11, 19]);
            let found = Window::of(&time(n), &[&forcing]).unwrap();
            assert_eq!(
                (found.first, found.length),
                (n - length, length),
                "{n} {period}"
            );
            let times = (length as f64 / period) as usize;
            assert_eq!(found.lines[0], [2, 3, 5, 7, 11, 19].map(|k| k * times));
            assert!((found.base() - TAU * 20.0 / period).abs() < 1e-9);
        }
    }

    #[test]
    fn lines_of_two_forcing_functions_are_told_apart() {
        let [target, disturbance] = [[2, 5, 11], [3, 5, 13]].map(|lines| wave(601, 600.0, &lines));
        let still = vec![4.0; 601];
        let found = Window::of(&time(601), &[&target, &still, &disturbance]).unwrap();
        assert_eq!(found.lines, [vec![2, 11], vec![], vec![3, 13]]);
        assert_eq!(found.excited, [2, 3, 5, 11, 13]);
    }

    #[test]
    fn what_is_no_sum_of_sines_is_told() {
        let n = 400;
        let even = time(n);
        let of =
            |time: &[f64], forcing: Vec<f64>| Window::of(time, &[&forcing]).map(|own| own.lines);
        assert_eq!(of(&even[..3], vec![0.0, 1.0, 2.0]), Err(Unfit::Few));
        assert_eq!(of(&even, vec![10.0; n]), Err(Unfit::Still));
        assert_eq!(of(&even, vec![f64::NAN; n]), Err(Unfit::Missing));
        let step = (0..n).map(|k| if k < 130 { 0.0 } else { 2.0 }).collect();
        assert_eq!(of(&even, step), Err(Unfit::NoLines));
        let ramps = (0..n).map(|k| (k % 170) as f64).collect();
        assert_eq!(of(&even, ramps), Err(Unfit::NoLines));
        let chirp = (0..n).map(|k| (2e-4 * (k * k) as f64).sin()).collect();
        assert_eq!(of(&even, chirp), Err(Unfit::NoLines));
        let mut late = even.clone();
        late[200] += 0.02;
        assert_eq!(of(&late, wave(n, 399.0, &[2, 7])), Err(Unfit::Uneven));
        assert_eq!(of(&even, wave(n, 399.0, &[2, 7])), Ok(vec![vec![2, 7]]));
    }
}
