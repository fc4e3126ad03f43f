//! `pilotage trials synth`: flights of a synthetic human.

use super::super::made::{program, quoted};
use super::super::number::{number, whole};
use super::super::{Failure, Outcome, folder, overwrite, terminal};
use super::flown::{Equalisation, Flown, file};
use crate::synthetic::{Flight, Flights, Hands, Human, Moving, Shape};
use clap::ValueEnum;
use pilotage_text::printable::comment;
use std::path::PathBuf;

/// Options of `pilotage trials synth`; the defaults are those of [`Human`] and [`Flights`].
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    pilotage trials synth                                     the quadcopter, to 10 m and 20 m\n  \
    pilotage trials synth --vehicle integrator --target steps --amplitude 3\n  \
    pilotage trials synth --vehicle hover --target sines --duration 60 --coupling 0.1\n  \
    pilotage trials synth --vehicle my_model.toml --measure height")]
pub struct Synth {
    /// Folder for the flights.
    #[arg(short, long, default_value = "trials")]
    output: PathBuf,
    /// Write into a folder that is not empty.
    #[arg(long)]
    force: bool,
    /// Targets [m], separated by commas, or as words of their own.
    #[arg(long, value_name = "METRES", value_delimiter = ',', value_parser = number,
          default_values_t = Flights::default().targets, allow_hyphen_values = true)]
    targets: Vec<f64>,
    /// More targets [m], separated by spaces.
    #[arg(hide = true, requires = "targets", value_parser = number, allow_negative_numbers = true)]
    more_targets: Vec<f64>,
    /// Random moving target instead of constant ones, for each axis of the vehicle: a sum of sines (at prime
    /// multiples of the lowest frequency, different in each axis), ramps, or steps.
    #[arg(long, value_enum, value_name = "KIND", conflicts_with_all = ["targets", "more_targets"])]
    target: Option<Kind>,
    /// Number of sines, ramps or steps per axis [default: 8 sines, 5 ramps or steps].
    #[arg(long, requires = "target", value_parser = whole::<usize>, allow_hyphen_values = true)]
    count: Option<usize>,
    /// Amplitude of the slow sines, farthest position of ramps, or size of a step, in the unit of the position
    /// [default: 2].
    #[arg(long, requires = "target", value_parser = number, allow_hyphen_values = true)]
    amplitude: Option<f64>,
    /// Frequency above which the amplitudes of the sines fall with its square [rad/s] [default: 1.5].
    #[arg(long, requires = "target", value_parser = number, allow_hyphen_values = true)]
    bandwidth: Option<f64>,
    /// Runs per target; with --target, number of runs.
    #[arg(long, default_value_t = Flights::default().runs, value_parser = whole::<usize>, allow_hyphen_values = true)]
    runs: usize,
    /// Duration of a run [s].
    #[arg(long, default_value_t = Flights::default().duration, value_parser = number, allow_hyphen_values = true)]
    duration: f64,
    /// Samples per second [1/s].
    #[arg(long, default_value_t = Flights::default().rate, value_parser = number, allow_hyphen_values = true)]
    rate: f64,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = Flights::default().seed, value_parser = whole::<u64>, allow_hyphen_values = true)]
    seed: u64,
    /// Standard deviation of gain, lead, delay and omega-n from run to run, relative.
    #[arg(long, default_value_t = Flights::default().variation, value_parser = number, allow_hyphen_values = true)]
    variation: f64,
    /// Gain k of the human: stick per metre, or other unit of the position; one number, or one per axis separated by
    /// commas [default: 0.03 for a vehicle file, else suitable for the model].
    #[arg(long, value_delimiter = ',', value_parser = number, allow_hyphen_values = true)]
    gain: Vec<f64>,
    /// Lead time T_L of the human [s]; one number, or one per axis [default: 2.5 for a vehicle file, else suitable
    /// for the model].
    #[arg(long, value_delimiter = ',', value_parser = number, allow_hyphen_values = true)]
    lead: Vec<f64>,
    /// Lag time T_I of the human [s], for vehicles that respond to the stick at once; one number, or one per axis
    /// [default: 0 for a vehicle file, else suitable for the model].
    #[arg(long, value_delimiter = ',', value_parser = number, allow_hyphen_values = true)]
    lag: Vec<f64>,
    /// Reaction delay τ of the human [s].
    #[arg(long, default_value_t = Human::default().delay, value_parser = number, allow_hyphen_values = true)]
    delay: f64,
    /// Natural frequency of the arm ω_n [rad/s].
    #[arg(long, default_value_t = Human::default().frequency, value_parser = number, allow_hyphen_values = true)]
    omega_n: f64,
    /// Damping ratio of the arm ζ.
    #[arg(long, default_value_t = Human::default().damping, value_parser = number, allow_hyphen_values = true)]
    zeta: f64,
    /// Maximum speed of the stick [1/s] [default: none].
    #[arg(long, value_parser = number, allow_hyphen_values = true)]
    stick_rate: Option<f64>,
    /// Fraction of each hand's command that leaks into the other hand, for a vehicle with two axes [default: 0].
    #[arg(long, value_parser = number, allow_hyphen_values = true)]
    coupling: Option<f64>,
    /// Standard deviation of the remnant, relative to the initial stick command.
    #[arg(long, default_value_t = Human::default().remnant, value_parser = number, allow_hyphen_values = true)]
    remnant: f64,
    /// Correlation time of the remnant [s].
    #[arg(long, default_value_t = Human::default().remnant_time, value_parser = number, allow_hyphen_values = true)]
    remnant_time: f64,
    /// Vehicle: a vehicle file (TOML) of the quadcopter, a built-in model (`pilotage models`), or a model file with
    /// an input `stick`, or two, `stick` and `stick2` [default: the default vehicle].
    #[arg(long, value_name = "FILE|NAME")]
    vehicle: Option<String>,
    /// Output of the model that is its position, or two separated by commas [default: position, and position2].
    #[arg(long, value_name = "NAME", value_delimiter = ',', requires = "vehicle")]
    measure: Vec<String>,
}

/// [`Shape`] by name.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Kind {
    Sines,
    Ramps,
    Steps,
}

impl From<Kind> for Shape {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Sines => Self::Sines,
            Kind::Ramps => Self::Ramps,
            Kind::Steps => Self::Steps,
        }
    }
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Sines => "sines",
            Self::Ramps => "ramps",
            Self::Steps => "steps",
        }
    }

    /// Default number.
    fn count(self) -> usize {
        match self {
            Self::Sines => 8,
            Self::Ramps | Self::Steps => 5,
        }
    }
}

impl Synth {
    /// Runs the command.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let vehicle = Flown::open(self.vehicle.as_deref(), &self.measure)?;
        self.check(&vehicle)?;
        let hands = self.hands(&vehicle)?;
        let flights = vehicle.fly(&self.flights(), &hands)?;
        self.check_vehicle(&flights)?;
        folder::create_new(&self.output, self.force)?;
        let command = self.command(&hands);
        let mut manifest = comment(&command);
        for flight in &flights {
            let file = format!("{}.csv", flight.name);
            manifest += &format!(
                "\n[[run]]\nfile = {}\nweight = 1.0\nuse = \"fit\"\n",
                crate::document::quoted(&file)
            );
            self.save(&file, &to_csv(flight, &command, vehicle.unit()))?;
        }
        self.save("trials.toml", &manifest)?;
        terminal::print(&self.summary(&vehicle, flights.len()))?;
        Ok(Outcome::Done)
    }

    /// Written files and the suggested next command.
    fn summary(&self, vehicle: &Flown, count: usize) -> String {
        let (folder, list) = (
            terminal::shown(&self.output),
            self.output.join("trials.toml"),
        );
        let (program, typed) = (program(), quoted(&list.to_string_lossy()));
        let flights = if count == 1 { "flight" } else { "flights" };
        let text = format!(
            "{count} {flights} in {folder}, listed in {}\n",
            terminal::shown(&list)
        );
        match vehicle {
            Flown::Quadcopter(_) => format!(
                "{text}\nnext: {program} trials check {typed}\n      \
                 {program} fit {typed} -o pilot.toml\n"
            ),
            // A fit with another vehicle requires a problem file.
            Flown::Model(_) => text,
        }
    }

    /// Refuses options that have no meaning with this target or vehicle.
    fn check(&self, vehicle: &Flown) -> Result<(), Failure> {
        if let (Some(_), Some(kind @ (Kind::Ramps | Kind::Steps))) = (self.bandwidth, self.target) {
            let failure = Failure::new(format!("{} have no bandwidth", kind.name()));
            return Err(failure.hint("leave --bandwidth out, or take --target sines"));
        }
        let axes = vehicle.axes();
        if self.coupling.is_some() && axes == 1 {
            let failure = Failure::new("a vehicle with one axis has no other hand to leak into");
            return Err(
                failure.hint("leave --coupling out, or take one with two, such as --vehicle hover")
            );
        }
        for (name, given) in [
            ("gain", &self.gain),
            ("lead", &self.lead),
            ("lag", &self.lag),
        ] {
            if given.len() > axes {
                let count = given.len();
                let failure = Failure::new(format!(
                    "--{name} has {count} numbers, and the vehicle has {axes} axis or axes"
                ));
                return Err(failure.hint("give one number, or one for each axis"));
            }
        }
        Ok(())
    }

    fn targets(&self) -> Vec<f64> {
        [&*self.targets, &*self.more_targets].concat()
    }

    fn moving(&self) -> Option<Moving> {
        let kind = self.target?;
        Some(Moving {
            shape: kind.into(),
            count: self.count.unwrap_or(kind.count()),
            amplitude: self.amplitude.unwrap_or(2.0),
            bandwidth: self.bandwidth.unwrap_or(1.5),
        })
    }

    fn flights(&self) -> Flights {
        Flights {
            targets: self.targets(),
            moving: self.moving(),
            runs: self.runs,
            duration: self.duration,
            rate: self.rate,
            seed: self.seed,
            variation: self.variation,
        }
    }

    fn hands(&self, vehicle: &Flown) -> Result<Hands, Failure> {
        let human = Human {
            delay: self.delay,
            frequency: self.omega_n,
            damping: self.zeta,
            stick_rate: self.stick_rate.unwrap_or(f64::INFINITY),
            remnant: self.remnant,
            remnant_time: self.remnant_time,
            ..Human::default()
        };
        let given = Equalisation {
            gain: &self.gain,
            lead: &self.lead,
            lag: &self.lag,
        };
        Ok(Hands {
            axes: vehicle.humans(&human, &given)?,
            coupling: self.coupling.unwrap_or(0.0),
        })
    }

    /// The command that reproduces these flights, independent of future defaults.
    fn command(&self, hands: &Hands) -> String {
        let target = match (self.target, self.moving()) {
            (Some(kind), Some(moving)) => {
                let bandwidth = match kind {
                    Kind::Sines => format!(" --bandwidth {}", moving.bandwidth),
                    Kind::Ramps | Kind::Steps => String::new(),
                };
                let (kind, count, amplitude) = (kind.name(), moving.count, moving.amplitude);
                format!("--target {kind} --count {count} --amplitude {amplitude}{bandwidth}")
            }
            _ => format!("--targets {}", listed(&self.targets())),
        };
        let each = |of: fn(&Human) -> f64| {
            let mut axes: Vec<f64> = hands.axes.iter().map(of).collect();
            // One value is for both axes.
            axes.dedup();
            listed(&axes)
        };
        let (gain, lead, lag) = (
            each(|own| own.gain),
            each(|own| own.lead),
            each(|own| own.lag),
        );
        let mut command = format!(
            "pilotage trials synth {target} --runs {} --duration {} --rate {} --seed {} \
             --variation {} --gain {gain} --lead {lead} --delay {} --omega-n {} --zeta {} --remnant {} \
             --remnant-time {}",
            self.runs,
            self.duration,
            self.rate,
            self.seed,
            self.variation,
            self.delay,
            self.omega_n,
            self.zeta,
            self.remnant,
            self.remnant_time,
        );
        if hands.axes.iter().any(|human| human.lag != 0.0) {
            command += &format!(" --lag {lag}");
        }
        let rest = [
            ("stick-rate", self.stick_rate.map(|rate| rate.to_string())),
            ("coupling", self.coupling.map(|part| part.to_string())),
            ("vehicle", self.vehicle.as_deref().map(quoted)),
            (
                "measure",
                (!self.measure.is_empty()).then(|| self.measure.join(",")),
            ),
        ];
        for (name, value) in rest {
            command += &value.map_or_else(String::new, |value| format!(" --{name} {value}"));
        }
        command
    }

    /// Refuses to overwrite the vehicle file; other files in the folder have been checked before.
    fn check_vehicle(&self, flights: &[Flight]) -> Result<(), Failure> {
        let inputs: Vec<PathBuf> = file(self.vehicle.as_deref()).into_iter().collect();
        let files = flights.iter().map(|flight| format!("{}.csv", flight.name));
        let files = files.chain(["trials.toml".to_owned()]);
        let outputs: Vec<PathBuf> = files.map(|file| self.output.join(file)).collect();
        overwrite::keep(&inputs, &outputs)
    }

    fn save(&self, file: &str, content: &str) -> Result<(), Failure> {
        overwrite::save(&self.output.join(file), content)
    }
}

/// Numbers separated by commas.
fn listed(numbers: &[f64]) -> String {
    numbers
        .iter()
        .map(f64::to_string)
        .collect::<Vec<_>>()
        .join(",")
}

/// A flight as CSV, with its origin in comments.
fn to_csv(flight: &Flight, command: &str, unit: &str) -> String {
    let humans = flight.humans.iter().map(|human| {
        let lag = match human.lag {
            0.0 => String::new(),
            lag => format!("lag {lag:.3} s, "),
        };
        format!(
            "gain {:.4} 1/{unit}, lead {:.3} s, {lag}delay {:.3} s, omega-n {:.2} rad/s",
            human.gain, human.lead, human.delay, human.frequency
        )
    });
    let humans: Vec<String> = humans.collect();
    let mut series = flight.series.clone();
    series.comments = vec![
        format!("made by: {command}"),
        format!(
            "pilot: synthetic human; in this run {}",
            humans.join("; in the second axis ")
        ),
    ];
    series.to_csv()
}
