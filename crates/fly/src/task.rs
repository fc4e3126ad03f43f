//! Tasks of a run: targets and stick disturbances over time.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;

/// Period of the sums of sines \[s\]: all frequencies are integer multiples of 2π over the period.
pub const PERIOD: f64 = 81.92;

/// Frequencies of the sines of target and disturbance as multiples of 2π/81.92 s, without common values, after Zaal
/// (2012).
pub const TARGET_LINES: [u32; 10] = [6, 13, 27, 41, 53, 73, 103, 139, 194, 229];
/// See [`TARGET_LINES`].
pub const DISTURBANCE_LINES: [u32; 10] = [5, 11, 23, 37, 51, 71, 101, 137, 171, 226];

/// Time constants of the filter that shapes the sines' amplitudes \[s\], `|(1 + 0.1 jω)²/(1 + 0.8 jω)²|`: from 0.698 at
/// n = 6 to 0.016 at n = 229, as in that paper.
const FALL: [f64; 2] = [0.1, 0.8];

/// Number of random sets of phases, from which the one with the smallest peak is chosen.
const DRAWS: usize = 50;

/// A signal over time.
#[derive(Debug, Clone, PartialEq)]
pub enum Signal {
    /// A constant.
    Constant(f64),
    /// Amplitude, frequency \[rad/s\] and phase \[rad\] of each sine.
    Sines(Vec<[f64; 3]>),
}

impl Signal {
    /// Sines at these multiples of 2π/81.92 s with decreasing amplitudes, scaled to this total root mean square.
    pub fn sines(lines: &[u32], rms: f64, seed: u64) -> Self {
        let omega = |n: u32| TAU * f64::from(n) / PERIOD;
        let gain = |time: f64, omega: f64| 1.0 + (time * omega).powi(2);
        let shape = |n: &u32| gain(FALL[0], omega(*n)) / gain(FALL[1], omega(*n));
        let power: f64 = lines.iter().map(|n| shape(n).powi(2) / 2.0).sum();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || -> Vec<[f64; 3]> {
            let sine = |n: &u32| {
                let phase = TAU * f64::from(random.next_u32()) / (f64::from(u32::MAX) + 1.0);
                [rms * shape(n) / power.sqrt(), omega(*n), phase]
            };
            lines.iter().map(sine).collect()
        };
        let draws: Vec<Self> = (0..DRAWS).map(|_| Self::Sines(draw())).collect();
        let calmest = draws
            .into_iter()
            .min_by(|a, b| a.peak().total_cmp(&b.peak()));
        calmest.unwrap_or(Self::Constant(0.0))
    }

    /// Its value at a time \[s\].
    pub fn at(&self, time: f64) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Sines(sines) => sines
                .iter()
                .map(|[a, w, phase]| a * (w * time + phase).sin())
                .sum(),
        }
    }

    /// Its largest magnitude, sampled ten times a second.
    fn peak(&self) -> f64 {
        let count = (10.0 * PERIOD) as usize;
        (0..count)
            .map(|k| self.at(0.1 * k as f64).abs())
            .fold(0.0, f64::max)
    }
}

/// Type of display.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Display {
    /// The vehicle in a scene.
    Scene,
    /// Only the error is shown.
    Compensatory,
    /// Target and vehicle are shown.
    Pursuit,
}

/// The task of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// Its name, used in file names.
    pub name: String,
    /// Its title for display.
    pub title: String,
    /// Instructions for the person.
    pub words: String,
    /// Target of each axis, relative to the vehicle's initial position, in the unit of the position.
    pub target: Vec<Signal>,
    /// Disturbance added to each stick; 1 is full stick.
    pub disturbance: Vec<Signal>,
    /// Duration of a run \[s\].
    pub seconds: f64,
    /// Time at the beginning that is excluded from the score \[s\].
    pub run_in: f64,
    /// Recorded rows per second.
    pub rate: f64,
    /// Type of display.
    pub display: Display,
    /// Number of measured runs.
    pub runs: usize,
    /// Whether the sign of the targets is random for each run.
    pub is_signed: bool,
    /// Whether it has sines instead of a constant target.
    pub is_tracking: bool,
}

impl Task {
    /// The targets of all axes at a time.
    pub fn targets(&self, time: f64, sign: f64) -> Vec<f64> {
        self.target.iter().map(|own| sign * own.at(time)).collect()
    }

    /// The disturbances of all axes at a time.
    pub fn disturbances(&self, time: f64) -> Vec<f64> {
        self.disturbance.iter().map(|own| own.at(time)).collect()
    }

    /// Whether a disturbance is added to the stick.
    pub fn is_disturbed(&self) -> bool {
        self.disturbance
            .iter()
            .any(|own| *own != Signal::Constant(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The amplitudes published in the paper, to three digits.
    #[test]
    fn amplitudes_fall_as_published() {
        let Signal::Sines(sines) = Signal::sines(&TARGET_LINES, 1.0, 1) else {
            panic!("no sines")
        };
        let ratio = sines[9][0] / sines[0][0];
        assert!((ratio - 0.016 / 0.698).abs() < 1e-3, "{ratio}");
    }

    /// Over a period each sum has the requested root mean square, zero mean, and no content at the other's frequencies.
    #[test]
    fn sines_have_their_size_and_lines_of_their_own() {
        let count = 8192;
        let [own, other] =
            [&TARGET_LINES, &DISTURBANCE_LINES].map(|lines| Signal::sines(lines, 2.0, 3));
        let dot = |a: &dyn Fn(f64) -> f64, b: &dyn Fn(f64) -> f64| -> f64 {
            let times = (0..count).map(|k| f64::from(k) * PERIOD / f64::from(count));
            times.map(|t| a(t) * b(t)).sum::<f64>() / f64::from(count)
        };
        assert!((dot(&|t| own.at(t), &|t| own.at(t)).sqrt() - 2.0).abs() < 1e-9);
        assert!(dot(&|t| own.at(t), &|_| 1.0).abs() < 1e-9);
        assert!(dot(&|t| own.at(t), &|t| other.at(t)).abs() < 1e-9);
        assert!(own.peak() < 3.0 * 2.0, "{}", own.peak());
    }
}
