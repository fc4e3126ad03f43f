//! Targets over time: constant or moving randomly.

use super::{SyntheticError, check_ranges};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;
use std::f64::consts::TAU;

/// Highest frequency of the sines relative to the bandwidth.
const TOP: f64 = 4.0;

/// How a target moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A sum of sines.
    Sines,
    /// Straight lines between positions.
    Ramps,
    /// Jumps.
    Steps,
}

/// Moving targets, different in each run and axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moving {
    /// Shape of the motion.
    pub shape: Shape,
    /// Number of sines, ramps or steps in each axis.
    pub count: usize,
    /// Amplitude in the unit of the position: of the low-frequency sines; the farthest position of ramps; the size of a
    /// step.
    pub amplitude: f64,
    /// Sines up to this frequency have the full amplitude; above it the amplitude decreases with the square of the
    /// frequency [rad/s].
    pub bandwidth: f64,
}

/// A target over time.
#[derive(Debug, Clone, PartialEq)]
pub enum Signal {
    /// A constant that appears at time 0.
    Constant(f64),
    /// `Σ a sin(ω t + φ)`: amplitude, frequency [rad/s] and phase \[rad\] of each sine.
    Sines(Vec<[f64; 3]>),
    /// Straight lines between points of time \[s\] and position, with the last position held.
    Ramps(Vec<(f64, f64)>),
    /// Times \[s\] and the positions from there on; 0 before the first.
    Steps(Vec<(f64, f64)>),
}

impl Signal {
    /// The target and its rate at `time`; the rate of a jump is 0.
    pub fn at(&self, time: f64) -> (f64, f64) {
        match self {
            Self::Constant(place) => (*place, 0.0),
            Self::Sines(sines) => sines.iter().fold((0.0, 0.0), |sum, [a, w, phase]| {
                let (sin, cos) = (w * time + phase).sin_cos();
                (sum.0 + a * sin, sum.1 + a * w * cos)
            }),
            Self::Ramps(points) => ramp(points, time),
            // Times of steps and samples are equal up to rounding.
            Self::Steps(steps) => match steps.iter().rfind(|(begin, _)| time > begin - 1e-9) {
                Some((_, place)) => (*place, 0.0),
                None => (0.0, 0.0),
            },
        }
    }

    /// Its size: the magnitude of a constant, the root mean square of sines, the farthest position of the others.
    pub fn size(&self) -> f64 {
        match self {
            Self::Constant(place) => place.abs(),
            Self::Sines(sines) => sines.iter().map(|[a, ..]| a * a / 2.0).sum::<f64>().sqrt(),
            Self::Ramps(points) | Self::Steps(points) => points
                .iter()
                .map(|(_, place)| place.abs())
                .fold(0.0, f64::max),
        }
    }
}

fn ramp(points: &[(f64, f64)], time: f64) -> (f64, f64) {
    let pairs = points.iter().zip(points.iter().skip(1));
    let mut pairs = pairs.filter(|(_, (end, _))| time < *end);
    match pairs.next() {
        Some(((begin, from), (end, to))) => {
            let rate = (to - from) / (end - begin);
            (from + rate * (time - begin), rate)
        }
        None => (points.last().map_or(0.0, |(_, place)| *place), 0.0),
    }
}

/// Sampling of a run.
#[derive(Debug, Clone, Copy)]
pub struct Sampling {
    /// Duration of the run \[s\].
    pub duration: f64,
    /// Samples per second [1/s].
    pub rate: f64,
}

impl Moving {
    /// Rejects targets that do not fit into a run.
    pub(super) fn check(&self, axes: usize, sampling: Sampling) -> Result<(), SyntheticError> {
        check_ranges([
            ("count", self.count as f64, 1.0, 1e3),
            ("amplitude", self.amplitude, 1e-6, 1e6),
            ("bandwidth", self.bandwidth, 1e-3, 1e3),
        ])?;
        let samples = sampling.duration * sampling.rate;
        let needed = match self.shape {
            // Four samples per period of the fastest sine; fewer do not represent it.
            Shape::Sines => {
                let all = self.multiples(axes, sampling.duration);
                4 * all.last().copied().unwrap_or_default()
            }
            Shape::Ramps | Shape::Steps => 4 * self.count,
        };
        match needed as f64 <= samples {
            true => Ok(()),
            false => Err(SyntheticError::Crowded {
                count: self.count,
                samples: samples as usize,
                needed,
            }),
        }
    }

    /// Multiples of the base frequency `2π / duration` for all axes: primes, so that no sine is a harmonic of another,
    /// from 2 on and evenly spaced over the logarithm of the frequency as far as primes allow.
    fn multiples(&self, axes: usize, duration: f64) -> Vec<usize> {
        let count = axes * self.count;
        let top = (TOP * self.bandwidth * duration / TAU).max(2.0);
        let mut last = 1;
        let mut all = Vec::with_capacity(count);
        for k in 0..count {
            let part = k as f64 / (count - 1).max(1) as f64;
            let wanted = 2.0 * (top / 2.0).powf(part);
            last = (last + 1..)
                .find(|n| is_prime(*n) && *n as f64 + 0.5 > wanted)
                .unwrap_or(last);
            all.push(last);
        }
        all
    }

    /// The targets of one run, one per axis; the sines' frequencies alternate between the axes, so that their effects
    /// can be distinguished.
    pub(super) fn signals(
        &self,
        axes: usize,
        sampling: Sampling,
        random: &mut ChaCha8Rng,
    ) -> Vec<Signal> {
        let multiples = self.multiples(axes, sampling.duration);
        (0..axes)
            .map(|axis| match self.shape {
                Shape::Sines => {
                    let own = multiples.iter().skip(axis).step_by(axes);
                    self.sines(own, sampling.duration, random)
                }
                Shape::Ramps => self.ramps(sampling, random),
                Shape::Steps => self.steps(sampling, random),
            })
            .collect()
    }

    /// Sines of random phases, all advanced to the first zero of their sum: a target that jumps at the start would have
    /// no rate there.
    fn sines<'a>(
        &self,
        multiples: impl Iterator<Item = &'a usize>,
        duration: f64,
        random: &mut ChaCha8Rng,
    ) -> Signal {
        let frequencies = multiples.map(|n| *n as f64 * TAU / duration);
        let sines = frequencies.map(|w| [self.amplitude_at(w), w, TAU * uniform(random)]);
        let mut sines: Vec<[f64; 3]> = sines.collect();
        let advance = first_zero(|time| Signal::Sines(sines.clone()).at(time).0, duration);
        for [_, frequency, phase] in &mut sines {
            *phase = (*phase + *frequency * advance) % TAU;
        }
        Signal::Sines(sines)
    }

    fn amplitude_at(&self, frequency: f64) -> f64 {
        self.amplitude * (self.bandwidth / frequency).powi(2).min(1.0)
    }

    /// Each ramp ends in the second half of its share of the run, at a sample.
    fn ramps(&self, sampling: Sampling, random: &mut ChaCha8Rng) -> Signal {
        let mut points = vec![(0.0, 0.0)];
        for k in 0..self.count {
            let end = sampling.within(k, self.count, 0.5 + 0.5 * uniform(random));
            points.push((end, self.amplitude * (2.0 * uniform(random) - 1.0)));
        }
        Signal::Ramps(points)
    }

    /// Each step occurs in the first half of its share of the run, at a sample; its sign is reversed if it would lead
    /// farther than two steps from 0.
    fn steps(&self, sampling: Sampling, random: &mut ChaCha8Rng) -> Signal {
        let mut level = 0_i32;
        let mut steps = Vec::with_capacity(self.count);
        for k in 0..self.count {
            let begin = sampling.within(k, self.count, 0.5 * uniform(random));
            let sign = if uniform(random) < 0.5 { -1 } else { 1 };
            level += if (level + sign).abs() > 2 {
                -sign
            } else {
                sign
            };
            steps.push((begin, self.amplitude * f64::from(level)));
        }
        Signal::Steps(steps)
    }
}

impl Sampling {
    /// The sample time nearest to `part` of the `k`-th of `count` equal shares of the run \[s\].
    fn within(self, k: usize, count: usize, part: f64) -> f64 {
        let time = self.duration * (k as f64 + part) / count as f64;
        (time * self.rate).round() / self.rate
    }
}

/// First sign change of a function of mean 0, bracketed by a thousand values and refined by bisection.
fn first_zero(value: impl Fn(f64) -> f64, duration: f64) -> f64 {
    let begin = value(0.0);
    let mut times = (1..1000).map(|k| duration * f64::from(k) / 1000.0);
    let Some(mut after) = times.find(|time| value(*time) * begin <= 0.0) else {
        return 0.0;
    };
    let mut before = (after - duration / 1000.0).max(0.0);
    for _ in 0..60 {
        let middle = 0.5 * (before + after);
        match value(middle) * begin <= 0.0 {
            true => after = middle,
            false => before = middle,
        }
    }
    after
}

/// Uniform number from 0 to 1, excluding 1.
fn uniform(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

fn is_prime(n: usize) -> bool {
    n > 1
        && (2..)
            .take_while(|k| k * k <= n)
            .all(|k| !n.is_multiple_of(k))
}
