//! Flights and their recordings.

use super::closed_loop::Loop;
use super::recording::Recording;
use super::target::{Moving, Sampling, Signal};
use super::{Hands, Human, SyntheticError, Vehicle, check_ranges};
use pilotage_series::Series;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Maximum integration step [s]: small compared with the arm's lag and the delay.
const MAX_STEP: f64 = 1e-3;

/// Minimum integration step [s]: vehicles that require less are too stiff for this simulation.
const MIN_STEP: f64 = 1e-5;

/// A set of flights: the same human flies several times to each target, with random variation.
#[derive(Debug, Clone, PartialEq)]
pub struct Flights {
    /// Distances to fly, in the unit of the position \[m\]; applied to every axis.
    pub targets: Vec<f64>,
    /// Moving targets, used instead of `targets`.
    pub moving: Option<Moving>,
    /// Number of runs to each target; with moving targets, of all runs.
    pub runs: usize,
    /// Duration of a run \[s\].
    pub duration: f64,
    /// Samples per second [1/s].
    pub rate: f64,
    /// Seed: the same seed gives the same flights.
    pub seed: u64,
    /// Relative standard deviation of `k`, `T_L`, `τ` and `ω_n` between runs.
    pub variation: f64,
}

impl Default for Flights {
    /// The paper's experiment: three runs to 10 m and three to 20 m, 15 s at 20 Hz.
    fn default() -> Self {
        Self {
            targets: vec![10.0, 20.0],
            moving: None,
            runs: 3,
            duration: 15.0,
            rate: 20.0,
            seed: 4,
            variation: 0.05,
        }
    }
}

/// One flight with the human's parameters in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    /// Its name, such as `10m-run1`, or `run1` for moving targets.
    pub name: String,
    /// The human in this run, in each axis.
    pub humans: Vec<Human>,
    /// `target`, `position` and `stick`, then `target2`, `position2` and `stick2` if there is a second axis, then the
    /// vehicle's other outputs; positions are rounded to 0.1 mm, or to four digits of a target below 1 m, all else
    /// likewise.
    pub series: Series,
}

/// A planned run.
struct Run {
    name: String,
    targets: Vec<Signal>,
    /// Random numbers of the run.
    random: ChaCha8Rng,
}

impl Flights {
    /// Simulates all flights of `human`. Run `j` draws from its own random stream, so that it does not depend on the
    /// previous runs.
    ///
    /// # Errors
    /// If a parameter is out of range, human and vehicle are unstable, or a run does not stay within 100 times its
    /// target.
    pub fn fly(&self, human: &Human, vehicle: &dyn Vehicle) -> Result<Vec<Flight>, SyntheticError> {
        let axes = vec![*human; vehicle.axes()];
        self.fly_hands(
            &Hands {
                axes,
                coupling: 0.0,
            },
            vehicle,
        )
    }

    /// The same with a human in each axis of the vehicle.
    ///
    /// # Errors
    /// As [`Self::fly`].
    ///
    /// # Panics
    /// If the number of hands differs from that of the axes.
    pub fn fly_hands(
        &self,
        hands: &Hands,
        vehicle: &dyn Vehicle,
    ) -> Result<Vec<Flight>, SyntheticError> {
        assert_eq!(hands.axes.len(), vehicle.axes(), "a hand for each axis");
        self.check(vehicle.axes())?;
        hands.check()?;
        if !vehicle.is_held_by(hands) {
            return Err(SyntheticError::Unstable);
        }
        let flown = self.planned(vehicle).into_iter().map(|mut run| {
            let hands = hands.on_a_day(self.variation, &mut run.random);
            let series = self.fly_one(&hands, vehicle, &mut run);
            check_bounded(&run, vehicle, &series)?;
            Ok(Flight {
                name: run.name,
                humans: hands.axes,
                series,
            })
        });
        flown.collect()
    }

    fn check(&self, axes: usize) -> Result<(), SyntheticError> {
        let targets = self
            .targets
            .iter()
            .map(|&target| ("|targets|", target.abs(), 0.1, 1e5));
        let rest = [
            ("runs", self.runs as f64, 1.0, 1e4),
            ("duration", self.duration, 1.0, 3600.0),
            ("rate", self.rate, 1.0, 1e4),
            ("variation", self.variation, 0.0, 0.3),
            // A trial requires at least this many samples.
            ("duration · rate", self.duration * self.rate, 9.0, 3.6e7),
        ];
        check_ranges(targets.chain(rest))?;
        if let Some(moving) = &self.moving {
            return moving.check(axes, self.sampling());
        }
        let is_before = |k: usize| self.targets[..k].contains(&self.targets[k]);
        match (0..self.targets.len()).find(|&k| is_before(k)) {
            Some(k) => Err(SyntheticError::Twice {
                target: self.targets[k],
            }),
            None => Ok(()),
        }
    }

    fn sampling(&self) -> Sampling {
        Sampling {
            duration: self.duration,
            rate: self.rate,
        }
    }

    /// The runs with their targets. Moving targets use separate random streams, so that they do not depend on the
    /// human.
    fn planned(&self, vehicle: &dyn Vehicle) -> Vec<Run> {
        let axes = vehicle.axes();
        let Some(moving) = &self.moving else {
            let runs = self
                .targets
                .iter()
                .flat_map(|&target| (1..=self.runs).map(move |i| (target, i)));
            let unit: String = vehicle
                .unit(0)
                .chars()
                .filter(char::is_ascii_alphanumeric)
                .collect();
            let planned = runs.enumerate().map(|(stream, (target, run))| {
                let side = if target < 0.0 { "minus" } else { "" };
                Run {
                    name: format!("{side}{}{unit}-run{run}", target.abs()),
                    targets: vec![Signal::Constant(target); axes],
                    random: self.stream(stream as u64),
                }
            });
            return planned.collect();
        };
        let planned = (0..self.runs).map(|run| Run {
            name: format!("run{}", run + 1),
            targets: moving.signals(axes, self.sampling(), &mut self.stream(!(run as u64))),
            random: self.stream(run as u64),
        });
        planned.collect()
    }

    fn stream(&self, stream: u64) -> ChaCha8Rng {
        let mut seed = [0; 32];
        seed[..8].copy_from_slice(&self.seed.to_le_bytes());
        let mut random = ChaCha8Rng::from_seed(seed);
        random.set_stream(stream);
        random
    }

    /// Simulates one run from rest.
    fn fly_one(&self, hands: &Hands, vehicle: &dyn Vehicle, run: &mut Run) -> Series {
        let largest = (0.5 / vehicle.fastest()).clamp(MIN_STEP, MAX_STEP);
        let substeps = (1.0 / (self.rate * largest)).ceil() as usize;
        let step = 1.0 / (self.rate * substeps as f64);
        let samples = (self.duration * self.rate).round() as usize + 1;
        let mut loop_ = Loop::new(hands, vehicle, &run.targets, step, &mut run.random);
        let mut recording = Recording::default();
        for sample in 0..samples {
            recording.positions.push(loop_.positions());
            recording.sticks.push(loop_.sticks());
            recording.others.push(loop_.others());
            if sample + 1 < samples {
                (0..substeps).for_each(|_| loop_.advance(&mut run.random));
            }
        }
        let time = (0..samples).map(|k| k as f64 / self.rate).collect();
        recording.series(vehicle, &run.targets, time)
    }
}

/// Rejects a run in which human and vehicle diverge.
fn check_bounded(run: &Run, vehicle: &dyn Vehicle, series: &Series) -> Result<(), SyntheticError> {
    for (axis, (name, target)) in ["position", "position2"]
        .into_iter()
        .zip(&run.targets)
        .enumerate()
    {
        let Some(column) = series.column(name) else {
            continue;
        };
        let begin = column.values.first().copied().unwrap_or_default();
        let is_bounded = |position: f64| (position - begin).abs() <= 100.0 * target.size();
        let mut out = column.values.iter().zip(&series.time);
        if let Some((&position, &time)) = out.find(|(position, _)| !is_bounded(**position)) {
            return Err(SyntheticError::Diverged {
                run: run.name.clone(),
                time,
                position,
                unit: vehicle.unit(axis).into(),
                command: vehicle.check_command(),
            });
        }
    }
    Ok(())
}
