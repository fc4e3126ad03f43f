//! `pilotage trials`: recorded flights, checked or made.

use super::made::{program, quoted};
use super::number::{number, whole};
use super::recognise::{self, FileKind};
use super::system::flags::pair;
use super::{Failure, Outcome, folder, overwrite, terminal, vehicle};
use crate::identification::trials::{ColumnNames, Summary, TrialError, TrialSet};
use crate::report::{short, significant, target_of};
use crate::series::SeriesError;
use crate::synthetic::{Flight, Flights, Human};
use clap::Subcommand;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Arguments of `pilotage trials`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Check trial files and show each in a few numbers.
    Check {
        /// Trials (CSV) or manifests (TOML).
        #[arg(required = true)]
        trials: Vec<PathBuf>,
        #[command(flatten)]
        columns: Columns,
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Let a synthetic human fly: one CSV file a run, and a manifest.
    Synth(Box<Synth>),
}

/// Which columns of the files are what.
#[derive(Debug, clap::Args)]
pub struct Columns {
    /// Take `time`, `target`, `position` or `stick` from a column of another name; may be given many times.
    #[arg(long = "column", value_name = "WHAT=NAME", value_parser = pair)]
    named: Vec<(String, String)>,
}

impl Columns {
    /// Reads trials and manifests.
    pub fn read(&self, paths: &[PathBuf]) -> Result<TrialSet, Failure> {
        let what = "recorded flights (CSV) or lists of them (TOML)";
        recognise::expect(
            paths,
            &[FileKind::Trial, FileKind::Table, FileKind::Manifest],
            what,
        )?;
        let read = TrialSet::read_with(paths, &ColumnNames::new(&self.named)?);
        read.map_err(|error| {
            let quantity = match &error {
                TrialError::NoColumn { column, .. } => column.clone(),
                TrialError::Series(SeriesError::NoTime { expected, .. }) => expected.clone(),
                _ => return Failure::from(error),
            };
            // A name that was given and is not there needs no advice to give one.
            let is_given = self.named.iter().any(|(_, name)| *name == quantity);
            let failure = Failure::from(error);
            match is_given {
                true => failure,
                false => failure.hint(format!("--column {quantity}=NAME says which column it is")),
            }
        })
    }
}

/// Options of `pilotage trials synth`; the defaults are those of [`Human`] and [`Flights`].
#[derive(Debug, clap::Args)]
struct Synth {
    /// Folder to write into.
    #[arg(short, long, default_value = "trials")]
    output: PathBuf,
    /// Write into a folder that is not empty.
    #[arg(long)]
    force: bool,
    /// Targets [m], with commas or spaces between them.
    #[arg(long, value_name = "METRES", value_delimiter = ',', value_parser = number,
          default_values_t = Flights::default().targets, allow_hyphen_values = true)]
    targets: Vec<f64>,
    /// More targets [m], where spaces part them.
    #[arg(hide = true, requires = "targets", value_parser = number, allow_negative_numbers = true)]
    more_targets: Vec<f64>,
    /// Runs to each target.
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
    /// The human's gain k [1/m].
    #[arg(long, default_value_t = Human::default().gain, value_parser = number, allow_hyphen_values = true)]
    gain: f64,
    /// The human's lead time T_L [s].
    #[arg(long, default_value_t = Human::default().lead, value_parser = number, allow_hyphen_values = true)]
    lead: f64,
    /// The human's reaction delay τ [s].
    #[arg(long, default_value_t = Human::default().delay, value_parser = number, allow_hyphen_values = true)]
    delay: f64,
    /// Natural frequency of the arm ω_n [rad/s].
    #[arg(long, default_value_t = Human::default().frequency, value_parser = number, allow_hyphen_values = true)]
    omega_n: f64,
    /// Damping ratio of the arm ζ.
    #[arg(long, default_value_t = Human::default().damping, value_parser = number, allow_hyphen_values = true)]
    zeta: f64,
    /// Standard deviation of the remnant noise, relative to the stick that the target calls for.
    #[arg(long, default_value_t = Human::default().remnant, value_parser = number, allow_hyphen_values = true)]
    remnant: f64,
    /// Correlation time of the remnant [s].
    #[arg(long, default_value_t = Human::default().remnant_time, value_parser = number, allow_hyphen_values = true)]
    remnant_time: f64,
    /// The vehicle that is flown (TOML); the default vehicle where it is missing.
    #[arg(long)]
    vehicle: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    match args.command {
        Command::Check {
            trials,
            columns,
            json,
        } => check(&columns.read(&trials)?, json),
        Command::Synth(synth) => synth.run(),
    }
}

impl Synth {
    fn run(&self) -> Result<Outcome, Failure> {
        let vehicle = vehicle::resolve(self.vehicle.as_deref())?;
        let flights = self.flights().fly(&self.human(), &vehicle)?;
        self.check_vehicle(&flights)?;
        folder::create_new(&self.output, self.force)?;
        let mut manifest = format!("# {}\n", self.command());
        for flight in &flights {
            let file = format!("{}.csv", flight.name);
            manifest += &format!("\n[[run]]\nfile = \"{file}\"\nweight = 1.0\nuse = \"fit\"\n");
            self.save(&file, &self.to_csv(flight))?;
        }
        self.save("trials.toml", &manifest)?;
        let (folder, list) = (self.output.display(), self.output.join("trials.toml"));
        let (program, typed) = (program(), quoted(&list.to_string_lossy()));
        terminal::print(&format!(
            "{} flights in {folder}, listed in {}\n\n\
             next: {program} trials check {typed}\n      \
             {program} fit {typed} -o pilot.toml\n",
            flights.len(),
            list.display()
        ))?;
        Ok(Outcome::Done)
    }

    fn targets(&self) -> Vec<f64> {
        [&*self.targets, &*self.more_targets].concat()
    }

    fn flights(&self) -> Flights {
        Flights {
            targets: self.targets(),
            runs: self.runs,
            duration: self.duration,
            rate: self.rate,
            seed: self.seed,
            variation: self.variation,
        }
    }

    fn human(&self) -> Human {
        Human {
            gain: self.gain,
            lead: self.lead,
            delay: self.delay,
            frequency: self.omega_n,
            damping: self.zeta,
            remnant: self.remnant,
            remnant_time: self.remnant_time,
        }
    }

    /// The command that makes these flights again, whatever the defaults will be.
    fn command(&self) -> String {
        let targets: Vec<String> = self.targets().iter().map(f64::to_string).collect();
        let vehicle = self.vehicle.as_ref();
        let vehicle =
            vehicle.map_or_else(String::new, |file| format!(" --vehicle {}", file.display()));
        let command = format!(
            "pilotage trials synth --targets {} --runs {} --duration {} --rate {} --seed {} \
             --variation {} --gain {} --lead {} --delay {} --omega-n {} --zeta {} --remnant {} \
             --remnant-time {}{vehicle}",
            targets.join(","),
            self.runs,
            self.duration,
            self.rate,
            self.seed,
            self.variation,
            self.gain,
            self.lead,
            self.delay,
            self.omega_n,
            self.zeta,
            self.remnant,
            self.remnant_time,
        );
        // It goes into comments, which end with the line.
        command.replace(char::is_control, " ")
    }

    /// A flight with its origin in the comments.
    fn to_csv(&self, flight: &Flight) -> String {
        let human = &flight.human;
        let mut series = flight.series.clone();
        series.comments = vec![
            format!("made by: {}", self.command()),
            format!(
                "pilot: synthetic human; in this run gain {:.4} 1/m, lead {:.3} s, delay {:.3} s, omega-n {:.2} rad/s",
                human.gain, human.lead, human.delay, human.frequency
            ),
        ];
        series.to_csv()
    }

    /// Refuses to overwrite the vehicle that is flown; whatever else is in the folder has been looked at.
    fn check_vehicle(&self, flights: &[Flight]) -> Result<(), Failure> {
        let inputs: Vec<PathBuf> = self.vehicle.iter().cloned().collect();
        let files = flights.iter().map(|flight| format!("{}.csv", flight.name));
        let files = files.chain(["trials.toml".to_owned()]);
        let outputs: Vec<PathBuf> = files.map(|file| self.output.join(file)).collect();
        overwrite::keep(&inputs, &outputs)
    }

    fn save(&self, file: &str, content: &str) -> Result<(), Failure> {
        overwrite::save(&self.output.join(file), content)
    }
}

fn check(set: &TrialSet, json: bool) -> Result<Outcome, Failure> {
    match json {
        true => terminal::print(&format!("{:#}\n", to_json(set)))?,
        false => terminal::print(&to_table(set))?,
    }
    Ok(Outcome::Done)
}

/// Each trial with its summary and what it is used for.
fn uses(set: &TrialSet) -> Vec<(&crate::identification::Trial, Summary, &'static str)> {
    let fit = set.fit.iter().map(|trial| (trial, "fit"));
    let validation = set.validation.iter().map(|trial| (trial, "validation"));
    (fit.chain(validation))
        .map(|(trial, used)| (trial, trial.summary(), used))
        .collect()
}

fn to_json(set: &TrialSet) -> Value {
    let trials: Vec<Value> = (uses(set).iter())
        .map(|(trial, summary, used)| {
            json!({
                "name": trial.name,
                "file": trial.origin,
                "sha256": trial.sha256,
                "use": used,
                "weight": trial.weight,
                "samples": summary.samples,
                "missing": summary.missing,
                "duration_s": summary.duration,
                "rate_per_s": summary.rate,
                "largest_gap": summary.largest_gap,
                "target_m": summary.target,
                "target_range_m": summary.target_range,
                "final_error_m": summary.final_error,
                "rms_error_m": summary.rms_error,
                "overshoot": summary.overshoot,
                "peak_stick": summary.peak_stick,
            })
        })
        .collect();
    json!({ "trials": trials, "notes": set.notes })
}

fn to_table(set: &TrialSet) -> String {
    let uses = uses(set);
    let width =
        |cells: &mut dyn Iterator<Item = usize>, least: usize| cells.fold(least, usize::max);
    let names = &mut uses.iter().map(|(trial, ..)| trial.name.chars().count());
    let names = width(names, 5);
    let targets = width(&mut uses.iter().map(|(_, run, _)| target_of(run).len()), 6);
    let mut text = format!(
        "{:<names$}  use         weight  samples  missing     rate  {:>targets$}  rms error  final error  overshoot  peak stick\n\
         {:<names$}                                         [1/s]  {:>targets$}        [m]          [m]        [%]         [1]\n",
        "trial", "target", "", "[m]"
    );
    let or_none = |number: Option<String>| number.unwrap_or_else(|| "-".into());
    for (trial, summary, used) in &uses {
        text += &format!(
            "{:<names$}  {used:<10}  {:>6}  {:>7}  {:>7}  {:>7}  {:>targets$}  {:>9.3}  {:>11.3}  {:>9}  {:>10}\n",
            trial.name,
            short(trial.weight, 4),
            summary.samples,
            summary.missing,
            significant(summary.rate, 4),
            target_of(summary),
            summary.rms_error,
            summary.final_error,
            or_none(summary.overshoot.map(|part| format!("{:.1}", 100.0 * part))),
            or_none(summary.peak_stick.map(|peak| format!("{peak:.3}"))),
        );
    }
    for note in &set.notes {
        text += &format!("note: {note}\n");
    }
    for (trial, summary, _) in uses
        .iter()
        .filter(|(_, summary, _)| summary.largest_gap > 1.5)
    {
        text += &format!(
            "note: {}: the longest time step is {:.1} times the usual one; is a stretch of the recording lost?\n",
            trial.name, summary.largest_gap
        );
    }
    text
}
