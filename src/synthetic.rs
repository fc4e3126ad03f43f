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

use crate::models::{Quadcopter, quadcopter::N_STATES};
use crate::series::{Column, Series};
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
    /// Lead time `T_L` [s].
    pub lead: f64,
    /// Reaction delay `τ` [s].
    pub delay: f64,
    /// Natural frequency of the arm `ω_n` [rad/s].
    pub frequency: f64,
    /// Damping ratio of the arm `ζ`.
    pub damping: f64,
    /// Standard deviation of the remnant, as a fraction of the stick that the first sight of the target
    /// calls for (`k |ŷ|`): people are as imprecise as they move much.
    pub remnant: f64,
    /// Correlation time of the remnant [s].
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
    /// Distances to fly [m].
    pub targets: Vec<f64>,
    /// Runs to each target.
    pub runs: usize,
    /// Duration of a run [s].
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
    /// Human and vehicle together are unstable.
    #[error(
        "in run {run} human and vehicle swing up without bound: {position:e} m at {time} s; \
         look at the vehicle with `pilotage vehicle check`"
    )]
    Diverged {
        /// Name of the run.
        run: String,
        /// Time of the first sample out of bounds [s].
        time: f64,
        /// Position there [m].
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
    /// `target` [m], `position` [m] (to 0.1 mm) and `stick` (to 1/10000).
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
        ];
        check_ranges(targets.chain(rest))
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

/// States of human and vehicle: `[x_v, s, ṡ]`.
const N: usize = N_STATES + 2;

/// Human and vehicle in closed loop, integrated by the classical Runge–Kutta method with a fixed step.
struct Loop<'a> {
    human: &'a Human,
    vehicle: &'a Quadcopter,
    target: f64,
    step: f64,
    state: [f64; N],
    /// Error [m] and its rate [m/s] at every step so far.
    seen: Vec<(f64, f64)>,
    /// Remnant [stick].
    remnant: f64,
}

impl<'a> Loop<'a> {
    fn new(human: &'a Human, vehicle: &'a Quadcopter, target: f64, step: f64) -> Self {
        Self {
            human,
            vehicle,
            target,
            step,
            state: [0.0; N],
            seen: vec![(target, 0.0)],
            remnant: 0.04,
        }
    }

    /// Advances by one step; the remnant is held over it.
    fn advance(&mut self, random: &mut ChaCha8Rng) {
        let h = self.step;
        let k1 = self.derivative(&self.state, 0.0);
        let k2 = self.derivative(&along(&self.state, &k1, h / 2.0), 0.5);
        let k3 = self.derivative(&along(&self.state, &k2, h / 2.0), 0.5);
        let k4 = self.derivative(&along(&self.state, &k3, h), 1.0);
        for i in 0..N {
            self.state[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
        self.seen
            .push((self.target - self.state[0], -self.state[2]));
        self.remnant = self.next_remnant(random);
    }

    /// The remnant one step on: exact discretisation of an Ornstein–Uhlenbeck process.
    fn next_remnant(&self, random: &mut ChaCha8Rng) -> f64 {
        let deviation = self.human.remnant * self.human.gain * self.target.abs();
        let decay = (-self.step / self.human.remnant_time).exp();
        let deviate: f64 = StandardNormal.sample(random);
        decay * self.remnant + deviation * (1.0 - decay * decay).sqrt() * deviate
    }

    /// Error and rate as seen at `fraction` of the present step, a delay ago; nothing before the target
    /// appears. Between steps it is interpolated linearly.
    fn seen(&self, fraction: f64) -> (f64, f64) {
        let now = (self.seen.len() - 1) as f64 + fraction;
        let at = now - self.human.delay / self.step;
        if at < 0.0 {
            return (0.0, 0.0);
        }
        let (k, part) = (at.floor() as usize, at.fract());
        let (a, b) = (self.seen[k], self.seen[(k + 1).min(self.seen.len() - 1)]);
        (a.0 + part * (b.0 - a.0), a.1 + part * (b.1 - a.1))
    }

    fn derivative(&self, x: &[f64; N], fraction: f64) -> [f64; N] {
        let human = self.human;
        let (error, rate) = self.seen(fraction);
        let command = -human.gain * (error + human.lead * rate) + self.remnant;
        let (arm, arm_rate) = (x[N_STATES], x[N_STATES + 1]);
        let mut dx = [0.0; N];
        self.vehicle
            .derivative(&x[..N_STATES], clip(arm), &mut dx[..N_STATES]);
        dx[N_STATES] = arm_rate;
        dx[N_STATES + 1] =
            human.frequency * (human.frequency * (command - arm) - 2.0 * human.damping * arm_rate);
        dx
    }
}

/// `x + h dx`.
fn along(x: &[f64; N], dx: &[f64; N], h: f64) -> [f64; N] {
    std::array::from_fn(|i| x[i] + h * dx[i])
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
mod tests {
    use super::*;

    /// Greatest and last value of a column.
    fn peak_and_last(values: &[f64]) -> (f64, f64) {
        let peak = values.iter().copied().fold(f64::MIN, f64::max);
        (peak, values[values.len() - 1])
    }

    #[test]
    fn the_default_flights_are_credible() {
        for flight in Flights::default()
            .fly(&Human::default(), &Quadcopter::default())
            .unwrap()
        {
            let values = |name| &flight.series.column(name).unwrap().values;
            let target = values("target")[0];
            let (peak, last) = peak_and_last(values("position"));
            assert!(
                (1.1..1.3).contains(&(peak / target)),
                "{}: {peak}",
                flight.name
            );
            assert!(
                (last / target - 1.0).abs() < 0.04,
                "{}: {last}",
                flight.name
            );
            let stick = values("stick")
                .iter()
                .fold(0.0, |peak: f64, s| peak.max(s.abs()));
            assert!(
                (0.02..0.035).contains(&(stick / target)),
                "{}: {stick}",
                flight.name
            );
            assert_eq!(flight.series.time.len(), 301);
        }
    }

    #[test]
    fn a_run_does_not_depend_on_the_runs_after_it_and_differs_from_its_neighbours() {
        let all = Flights::default()
            .fly(&Human::default(), &Quadcopter::default())
            .unwrap();
        let one = Flights {
            targets: vec![10.0],
            runs: 1,
            ..Flights::default()
        };
        let alone = one.fly(&Human::default(), &Quadcopter::default()).unwrap();
        assert_eq!(alone[0], all[0]);
        assert_ne!(all[0].series, all[1].series);
    }

    #[test]
    fn without_remnant_and_variation_the_step_size_does_not_matter() {
        let human = Human {
            remnant: 0.0,
            ..Human::default()
        };
        let at_rate = |rate| {
            let flights = Flights {
                targets: vec![10.0],
                runs: 1,
                rate,
                variation: 0.0,
                ..Flights::default()
            };
            let series = flights
                .fly(&human, &Quadcopter::default())
                .unwrap()
                .remove(0)
                .series;
            series.column("position").unwrap().values.clone()
        };
        // 1000 and 3000 integration steps a second, compared once a second. The target comes into view
        // somewhere within a step, so the way flown differs by half a coarse step's worth at most.
        let (coarse, fine) = (at_rate(1000.0), at_rate(3000.0));
        for second in 0..=15 {
            let difference = coarse[1000 * second] - fine[3000 * second];
            assert!(difference.abs() < 2e-3, "{second} s: {difference}");
        }
    }

    #[test]
    fn what_cannot_be_flown_is_refused() {
        let unstable = Quadcopter {
            attitude_gain: 76.37,
            rate_gain: 1.02,
            ..Quadcopter::default()
        };
        let error = Flights::default().fly(&Human::default(), &unstable).err();
        assert!(
            matches!(error, Some(SyntheticError::Diverged { .. })),
            "{error:?}"
        );
        let wild = Human {
            gain: f64::NAN,
            ..Human::default()
        };
        let error = Flights::default().fly(&wild, &Quadcopter::default()).err();
        assert_eq!(
            error.map(|error| error.to_string()).as_deref(),
            Some("gain = NaN is out of range; expected 0.0001 to 10")
        );
    }

    #[test]
    fn the_stick_ends_at_its_stops() {
        let flights = Flights {
            targets: vec![60.0],
            runs: 1,
            ..Flights::default()
        };
        let flight = flights
            .fly(&Human::default(), &Quadcopter::default())
            .unwrap()
            .remove(0);
        let stick = &flight.series.column("stick").unwrap().values;
        assert!(stick.contains(&-1.0) && stick.iter().all(|s| s.abs() <= 1.0));
    }
}
