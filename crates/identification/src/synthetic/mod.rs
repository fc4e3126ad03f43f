//! A synthetic human who flies the vehicle, so that examples and tests need no recordings of people.
//!
//! It is *not* the model that pilotage fits: data from the fitted model itself would make every fit
//! look good (the inverse crime). It flies as people fly K/s²-like plants (McRuer's crossover model):
//! gain and lead on the error seen a delay ago, through the second-order lag of the arm, with noise of
//! its own, and the stick ends at its stops:
//!
//! ```text
//! c(t)  = -k (e(t-τ) + T_L ė(t-τ)) + n(t)            n: remnant, coloured noise
//! s̈     = ω_n² (c - s) - 2 ζ ω_n ṡ                    s: arm and hand
//! stick = clip(s, -1, 1)
//! ```

mod closed_loop;

use closed_loop::Loop;
use pilotage_models::{Quadcopter, quadcopter::N_STATES};
use pilotage_series::{Column, Series};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// Integration step [s], at most: small against the arm's lag and the delay.
const MAX_STEP: f64 = 1e-3;

/// A human's parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Human {
    /// Gain `k` [1/m]: stick for each metre of error.
    pub gain: f64,
    /// Lead time `T_L` \[s\].
    pub lead: f64,
    /// Reaction delay `τ` \[s\].
    pub delay: f64,
    /// Natural frequency of the arm `ω_n` [rad/s].
    pub frequency: f64,
    /// Damping ratio of the arm `ζ`.
    pub damping: f64,
    /// Standard deviation of the remnant, as a fraction of the stick that the first sight of the target
    /// calls for (`k |ŷ|`): people are as imprecise as they move much.
    pub remnant: f64,
    /// Correlation time of the remnant \[s\].
    pub remnant_time: f64,
}

impl Default for Human {
    fn default() -> Self {
        Self {
            gain: 0.03,
            lead: 2.5,
            delay: 0.15,
            frequency: 10.0,
            damping: 0.7,
            remnant: 0.04,
            remnant_time: 0.5,
        }
    }
}

/// A set of flights: the same human several times to each target, never quite the same way.
#[derive(Debug, Clone, PartialEq)]
pub struct Flights {
    /// Distances to fly \[m\].
    pub targets: Vec<f64>,
    /// Runs to each target.
    pub runs: usize,
    /// Duration of a run \[s\].
    pub duration: f64,
    /// Samples per second [1/s].
    pub rate: f64,
    /// Seed: the same seed gives the same flights.
    pub seed: u64,
    /// Standard deviation of `k`, `T_L`, `τ` and `ω_n` from run to run, relative.
    pub variation: f64,
}

impl Default for Flights {
    /// The paper's experiment: three runs to 10 m and three to 20 m, 15 s at 20 Hz.
    fn default() -> Self {
        Self {
            targets: vec![10.0, 20.0],
            runs: 3,
            duration: 15.0,
            rate: 20.0,
            seed: 4,
            variation: 0.05,
        }
    }
}

/// Why a human cannot fly.
#[derive(Debug, thiserror::Error)]
pub enum SyntheticError {
    /// A parameter that no human or experiment has.
    #[error("{name} = {value} is out of range; expected {min} to {max}")]
    Range {
        /// Name of the parameter, as on the command line.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Least value.
        min: f64,
        /// Greatest value.
        max: f64,
    },
    /// A target that is asked for twice: its runs would have the same names.
    #[error("target {target} m is given twice; `runs` says how often each is flown to")]
    Twice {
        /// The target \[m\].
        target: f64,
    },
    /// Human and vehicle together are unstable.
    #[error(
        "in run {run} human and vehicle swing up without bound: {position:e} m at {time} s; \
         look at the vehicle with `pilotage vehicle check`"
    )]
    Diverged {
        /// Name of the run.
        run: String,
        /// Time of the first sample out of bounds \[s\].
        time: f64,
        /// Position there \[m\].
        position: f64,
    },
}

/// One flight with the human's parameters on that day.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    /// Its name, such as `10m-run1`.
    pub name: String,
    /// The human in this run.
    pub human: Human,
    /// `target` \[m\], `position` \[m\] (to 0.1 mm) and `stick` (to 1/10000).
    pub series: Series,
}

impl Flights {
    /// Lets `human` fly them all. Run `j` draws from its own random stream, so that it does not depend
    /// on the runs before it.
    ///
    /// # Errors
    /// When a parameter is out of its range, or a run does not stay within 100 times its target.
    pub fn fly(&self, human: &Human, vehicle: &Quadcopter) -> Result<Vec<Flight>, SyntheticError> {
        self.check()?;
        human.check()?;
        let runs =
            (self.targets.iter()).flat_map(|&target| (1..=self.runs).map(move |i| (target, i)));
        (runs.enumerate())
            .map(|(stream, (target, run))| {
                let mut seed = [0; 32];
                seed[..8].copy_from_slice(&self.seed.to_le_bytes());
                let mut random = ChaCha8Rng::from_seed(seed);
                random.set_stream(stream as u64);
                let side = if target < 0.0 { "minus" } else { "" };
                let name = format!("{side}{}m-run{run}", target.abs());
                let human = human.on_a_day(self.variation, &mut random);
                let series = self.fly_one(&human, vehicle, target, &mut random);
                check_bounded(&name, target, &series)?;
                Ok(Flight {
                    name,
                    human,
                    series,
                })
            })
            .collect()
    }

    fn check(&self) -> Result<(), SyntheticError> {
        let targets = self
            .targets
            .iter()
            .map(|&target| ("|targets|", target.abs(), 0.1, 1e5));
        let rest = [
            ("runs", self.runs as f64, 1.0, 1e4),
            ("duration", self.duration, 1.0, 3600.0),
            ("rate", self.rate, 1.0, 1e4),
            ("variation", self.variation, 0.0, 0.3),
            // Fewer samples are no trial.
            ("duration · rate", self.duration * self.rate, 9.0, 3.6e7),
        ];
        check_ranges(targets.chain(rest))?;
        let is_before = |k: usize| self.targets[..k].contains(&self.targets[k]);
        match (0..self.targets.len()).find(|&k| is_before(k)) {
            Some(k) => Err(SyntheticError::Twice {
                target: self.targets[k],
            }),
            None => Ok(()),
        }
    }

    /// One run from hover at 0 to `target`, which appears at time 0.
    fn fly_one(
        &self,
        human: &Human,
        vehicle: &Quadcopter,
        target: f64,
        random: &mut ChaCha8Rng,
    ) -> Series {
        let substeps = (1.0 / (self.rate * MAX_STEP)).ceil() as usize;
        let step = 1.0 / (self.rate * substeps as f64);
        let samples = (self.duration * self.rate).round() as usize + 1;
        let mut loop_ = Loop::new(human, vehicle, target, step);
        let (mut position, mut stick) = (Vec::new(), Vec::new());
        for sample in 0..samples {
            position.push(rounded(loop_.state[0]));
            stick.push(rounded(clip(loop_.state[N_STATES])));
            if sample + 1 < samples {
                (0..substeps).for_each(|_| loop_.advance(random));
            }
        }
        let column = |name: &str, unit: &str, values| Column {
            name: name.into(),
            unit: unit.into(),
            values,
        };
        Series {
            comments: Vec::new(),
            time_unit: "s".into(),
            time: (0..samples).map(|k| k as f64 / self.rate).collect(),
            columns: vec![
                column("target", "m", vec![target; samples]),
                column("position", "m", position),
                column("stick", "1", stick),
            ],
        }
    }
}

/// The first of `(name, value, min, max)` that is out of range.
fn check_ranges(
    ranges: impl IntoIterator<Item = (&'static str, f64, f64, f64)>,
) -> Result<(), SyntheticError> {
    let mut ranges = ranges.into_iter();
    match ranges.find(|(_, value, min, max)| !(min..=max).contains(&value)) {
        Some((name, value, min, max)) => Err(SyntheticError::Range {
            name,
            value,
            min,
            max,
        }),
        None => Ok(()),
    }
}

/// Refuses a run in which human and vehicle swing up.
fn check_bounded(run: &str, target: f64, series: &Series) -> Result<(), SyntheticError> {
    let positions = series
        .column("position")
        .into_iter()
        .flat_map(|column| &column.values);
    let bounded = |position: f64| position.abs() <= 100.0 * target.abs();
    match positions
        .enumerate()
        .find(|(_, position)| !bounded(**position))
    {
        Some((k, &position)) => Err(SyntheticError::Diverged {
            run: run.into(),
            time: series.time[k],
            position,
        }),
        None => Ok(()),
    }
}

impl Human {
    fn check(&self) -> Result<(), SyntheticError> {
        check_ranges([
            ("gain", self.gain, 1e-4, 10.0),
            ("lead", self.lead, 0.0, 20.0),
            ("delay", self.delay, 0.0, 2.0),
            ("omega-n", self.frequency, 0.5, 100.0),
            ("zeta", self.damping, 0.05, 5.0),
            ("remnant", self.remnant, 0.0, 1.0),
            ("remnant-time", self.remnant_time, 0.01, 10.0),
        ])
    }

    /// The same human on another day: gain, lead, delay and arm vary by the relative standard deviation
    /// `variation`, at most 2.5 of them.
    fn on_a_day(&self, variation: f64, random: &mut ChaCha8Rng) -> Self {
        let mut vary = |value: f64| {
            let deviate: f64 = StandardNormal.sample(random);
            value * (1.0 + variation * deviate.clamp(-2.5, 2.5))
        };
        Self {
            gain: vary(self.gain),
            lead: vary(self.lead),
            delay: vary(self.delay),
            frequency: vary(self.frequency),
            ..*self
        }
    }
}

/// The stick's stops.
fn clip(stick: f64) -> f64 {
    stick.clamp(-1.0, 1.0)
}

/// Resolution of the recording: no recorder has sixteen digits. `+ 0.0` turns -0 into 0.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4 + 0.0
}

#[cfg(test)]
mod tests;
