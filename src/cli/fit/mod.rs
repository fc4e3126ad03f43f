//! `pilotage fit`: identifies the pilot from recorded flights.

mod both;
mod describing;
mod log;
mod next;
mod orders;
mod problem;
mod refits;
mod start;
pub mod summary;
mod table;
mod watch;

use super::made::made;
use super::number::{positive, whole, within};
use super::overwrite::{OutputKind, Overwrite};
use super::trials::Columns;
use super::{Failure, Outcome, excitation, interrupt, terminal, vehicle};
use crate::atomic_file::AtomicFile;
use crate::cli::deadline::Deadline;
use crate::flights::trials::driven;
use crate::identification::solve::MAX_ORDER;
use crate::identification::{
    self, FitOptions, Identification, InitialPosition, InitialState, Mesh, Objective, Scheme,
    TrialSet, pilot_file,
};
use crate::inference::spectrum::Excitation;
use crate::inference::{Method, Obstacle};
use crate::models::Pilot;
use crate::report::{self, Report};
use clap::ArgMatches;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::parser::ValueSource;
use log::Log;
use orders::Orders;
use problem::Checks;
pub use problem::{FITTED, page_of as page_of_problem};
pub use refits::HEAD as REFITS;
use refits::{Refits, Refitted};
use serde_json::{Value, json};
use start::Begin;
use std::path::{Path, PathBuf};
use summary::{to_json, to_text};
pub use watch::{Iterate, Watch};

/// Version of the JSON that a fit prints, docs/json.md. It grows when a key goes or changes its meaning.
pub const SCHEMA: u32 = 1;

const EXAMPLES: &str = "\
Examples:
  # Identify a pilot from recorded flights, and write a report page.
  pilotage fit run*.csv --vehicle vehicle.toml -o pilot.toml --report fit.html

  # Follow the iterations: as a table, or as JSON lines for scripts (docs/json.md).
  pilotage fit run*.csv --verbose
  pilotage fit problem.toml --log fit.jsonl
  pilotage fit run*.csv --log - | jq -c 'select(.event == \"iteration\") | [.start, .objective]'

  # Is there a better optimum? Twenty random starts in addition to those from the data.
  pilotage fit run*.csv --random-starts 20

  # Which order do the data support? The prediction of left-out runs decides; also for a problem file.
  pilotage fit run*.csv --orders 1..4
  pilotage fit problem.toml --orders 1..4

  # Which pilot reproduces the flights: the one fitted to the response, or the one fitted to the stick?
  pilotage fit run*.csv --objective both --report both.html

  # Another pilot, another vehicle, other signals: a problem file.
  pilotage init run*.csv -o problem.toml     # then --pilot and --vehicle, or edit it
  pilotage fit problem.toml

  # Intervals that do not rely on the covariance: profiles of the objective, and 200 replicates of the runs, stored in a
  # file from which an interrupted command continues.
  pilotage fit run*.csv --profile
  pilotage fit problem.toml --profile pilot.theta2,pilot.theta4
  pilotage fit run*.csv --bootstrap 200 --seed 1 --resume refits.csv

  # How well is each run predicted by a fit to the others? Do all runs have the same parameters?
  pilotage fit problem.toml --leave-one-out
  pilotage fit problem.toml --per-run --report fit.html

  # At most ten seconds, and a continuation from the result.
  pilotage fit run*.csv --time-limit 10
  pilotage fit run*.csv --start 0.25,1.25,1.02,-0.0005,0.005,-0.058
  pilotage fit problem.toml --start pilot.gain=0.3,pilot.lag=0.2

A fit that is stopped by a limit or Ctrl-C writes the best iterate, marked as not converged; a second
Ctrl-C kills the process. Diagnostics are reasons to doubt the result; each has a code.
Exit codes: 0 converged, 1 not converged (the best iterate is written), a comparison that was stopped or has
fewer than three runs, or a diagnostic that makes the result meaningless, 2 bad use or input.";

/// Arguments of `pilotage fit`; the defaults are those of [`FitOptions`].
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Recorded flights (CSV) or manifests of flights (TOML), or one problem file (TOML, docs/problems.md).
    #[arg(required = true)]
    trials: Vec<PathBuf>,
    #[command(flatten)]
    columns: Columns,
    /// Pilot file to write [default: pilot.toml]; for a problem file the fitted model, or a folder for several models
    /// [default: INSTANCE-fitted.toml].
    #[arg(short, long)]
    output: Option<PathBuf>,
    #[arg(long, help = or_file("Collocation scheme; the paper uses `euler`", FitOptions::default().scheme, "scheme"))]
    scheme: Option<Scheme>,
    /// Approximate length of the mesh intervals [s] [default: the samples are the mesh; the mesh of a problem file].
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true)]
    mesh_step: Option<f64>,
    /// Assumption about the states at the first sample; the paper uses `free`.
    #[arg(long, value_parser = named(InitialState::ALL, InitialState::as_str),
          default_value = FitOptions::default().initial_state.as_str())]
    initial_state: InitialState,
    /// Position at the first sample of a vehicle at rest: estimated, since that sample is a measurement, or known
    /// exactly, as in a simulator.
    #[arg(long, value_parser = named(InitialPosition::ALL, InitialPosition::as_str),
          default_value = FitOptions::default().initial_position.as_str())]
    initial_position: InitialPosition,
    /// Do not constrain the closed loop of pilot and vehicle to be stable.
    #[arg(long)]
    allow_unstable_loop: bool,
    /// What is compared with the recording: the vehicle's response (as in the paper), the stick, or both in two fits.
    #[arg(long, value_parser = named(Compared::ALL, Compared::as_str), default_value = Compared::ALL[0].as_str())]
    objective: Compared,
    /// Start values of the parameters: one for each, in the order of the summary, or NAME=VALUE,... for some of a problem
    /// file [default: estimated from the data; those of a problem file].
    #[arg(
        long,
        value_name = "VALUES",
        value_delimiter = ',',
        value_parser = start::begin,
        allow_hyphen_values = true
    )]
    start: Option<Vec<Begin>>,
    /// Number of additional random starts [default: for runs that begin at rest, up to 8, until a second start
    /// reaches the best sum of squares; for a problem file its `starts`, less the given one].
    #[arg(long, value_name = "N", value_parser = whole::<usize>, allow_hyphen_values = true)]
    random_starts: Option<usize>,
    /// File of the vehicle that was flown (TOML) [default: the default vehicle].
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// Order n of the pilot, which has 2n parameters.
    #[arg(long, default_value_t = FitOptions::default().pilot.order as u8,
          value_parser = within(1..=MAX_ORDER as u8), allow_hyphen_values = true)]
    order: u8,
    /// Compare pilots of these orders, and continue with the smallest order that no larger one surpasses in the
    /// prediction of left-out runs (see `pilotage compare`).
    #[arg(long, value_name = "FIRST..LAST", value_parser = orders::orders, conflicts_with_all = ["order", "evaluate"])]
    orders: Option<Orders>,
    /// Limit of the stick |y_p| at every sample.
    #[arg(long, default_value_t = FitOptions::default().stick_limit, value_parser = positive, allow_hyphen_values = true)]
    stick_limit: f64,
    #[arg(long, value_parser = whole::<usize>, allow_hyphen_values = true,
          help = or_file("Iteration limit of each start", FitOptions::default().max_iterations, "max_iterations"))]
    max_iterations: Option<usize>,
    /// Stop after this time [s] with the best iterate; with --orders with the best of the compared ones, if any.
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true)]
    time_limit: Option<f64>,
    #[arg(long, value_parser = positive, allow_hyphen_values = true,
          help = or_file("Scaled KKT residual at convergence", format!("{:e}", FitOptions::default().tolerance), "tolerance"))]
    tolerance: Option<f64>,
    /// Write a report page (HTML).
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// For a problem file: print objective, gradient and residuals at the start values, without a fit.
    #[arg(long)]
    evaluate: bool,
    /// Method of the covariance: `plain` assumes white residuals, `sidpac` uses their autocorrelations, `ar` an
    /// autoregressive model of them, `cr3` leaves out one run at a time [default: cr3 for four or more runs, else
    /// ar].
    #[arg(long, value_name = "METHOD", value_parser = named(Method::ALL, Method::as_str))]
    covariance: Option<Method>,
    #[command(flatten)]
    refits: Refits,
    #[command(flatten)]
    checks: Checks,
    /// Print one JSON object instead of the summary.
    #[arg(long)]
    json: bool,
    /// Write each iteration as a JSON object on its own line, at the end one for each start and one for the fit; `-`
    /// is stdout, with the summary on stderr.
    #[arg(long, value_name = "FILE|-")]
    log: Option<PathBuf>,
    /// Print a line per iteration on stderr.
    #[arg(short, long)]
    verbose: bool,
    #[command(flatten)]
    overwrite: Overwrite,
    /// The first given flag of [`OF_FLIGHTS`].
    #[arg(skip)]
    of_flights: Option<OfFlights>,
}

/// Help on an option whose default a problem file states in `[fit]`.
fn or_file(what: &str, default: impl std::fmt::Display, key: &str) -> String {
    format!("{what} [default: {default}; `{key}` of a problem file]")
}

/// A flag for flights alone: its name in the code, on the command line, and what a problem file has in its place.
type OfFlights = &'static (&'static str, &'static str, &'static str);

const OF_FLIGHTS: [(&str, &str, &str); 8] = [
    (
        "vehicle",
        "--vehicle",
        "`model` of an instance in [system] names the vehicle",
    ),
    (
        "order",
        "--order",
        "`order` of the pilot's instance in [system] says it; --orders compares several",
    ),
    (
        "initial_state",
        "--initial-state",
        "[initial] says how each state begins; one without a line begins as its model says",
    ),
    (
        "initial_position",
        "--initial-position",
        "[initial] says how each state begins: \"free\", \"first sample\" or a number",
    ),
    (
        "allow_unstable_loop",
        "--allow-unstable-loop",
        "`closed_loop` in [stability] keeps the loop stable; without it the loop is free",
    ),
    (
        "objective",
        "--objective",
        "[[measured]] says which signals are compared with the recording",
    ),
    (
        "stick_limit",
        "--stick-limit",
        "`limit` of the output in its model is the limit; of the pilot `linear` it is the parameter `stick_limit`",
    ),
    (
        "named",
        "--column",
        "[inputs] and `column` of [[measured]] name the columns",
    ),
];

/// What is compared with the recording.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Compared {
    One(Objective),
    Both,
}

impl Compared {
    const ALL: [Self; 3] = [
        Self::One(Objective::Response),
        Self::One(Objective::Stick),
        Self::Both,
    ];

    fn as_str(self) -> &'static str {
        match self {
            Self::One(objective) => objective.as_str(),
            Self::Both => "both",
        }
    }
}

/// A parser for one of `all`, by name.
fn named<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [T; N],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.map(name)).try_map(move |given| {
        let found = all.into_iter().find(|&value| name(value) == given);
        found.ok_or_else(|| format!("{given} is not one of the names"))
    })
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    if let Some(path) = problem::of(&args)? {
        return problem::run(&args, path);
    }
    if args.evaluate {
        return Err(
            Failure::new("--evaluate takes a problem file").hint("`pilotage init` writes one")
        );
    }
    if let Some(flag) = args.checks.flag() {
        return Err(Failure::new(format!("{flag} takes a problem file"))
            .hint("`pilotage init run*.csv -o problem.toml` writes that of these runs"));
    }
    if let (Compared::Both, Some(flag)) = (args.objective, args.refits.flag()) {
        let message = format!("{flag} takes one fit, and --objective both are two");
        return Err(Failure::new(message).hint("fit one after the other"));
    }
    if args.objective == Compared::Both && args.log.is_some() {
        return Err(
            Failure::new("--log writes one fit, and --objective both are two")
                .hint("leave --log out, or fit one after the other"),
        );
    }
    args.check_alone()?;
    let mut options = args.options()?;
    let set = args.columns.read(&args.trials)?;
    for note in &set.notes {
        terminal::note(note);
    }
    args.check_outputs(&set)?;
    let excited = Excitation::of(&driven(&set.fit));
    if let Some(own) = excited.filter(|_| !args.json && !args.logs_to_stdout()) {
        terminal::print(&excitation::first_lines(&own))?;
    }
    if let (Some(_), Some(flag)) = (&args.orders, args.refits.flag()) {
        let message = format!("{flag} takes one order, and --orders compares several");
        return Err(Failure::new(message).hint("give --order with that which was taken"));
    }
    if args.orders.is_some() && args.objective == Compared::Both {
        let message = "--orders compares one fit, and --objective both are two";
        return Err(Failure::new(message).hint("leave one of them out"));
    }
    let sought = identification::refits::sought(&options).into_iter();
    let sought: Vec<_> = sought.map(|name| (name, None)).collect();
    let plan = args.refits.plan(&sought, set.fit.len())?;
    if let (Some(Method::Cr3), 0..=1) = (args.covariance, set.fit.len()) {
        return Err(impossible(Method::Cr3));
    }
    let deadline = Deadline::after(args.time_limit);
    if args.objective == Compared::Both {
        interrupt::listen("stopping at the next iteration")?;
        return both::run(&args, set, &options, deadline);
    }
    let pilot_output = open(args.output())?;
    let report_output = args.report.as_deref().map(open).transpose()?;

    interrupt::listen("stopping at the next iteration")?;
    let (found, orders, log) = match &args.orders {
        Some(orders) => {
            let chosen = orders.flights(&args, &set, &options, deadline)?;
            orders::print_choice(&args, &chosen)?;
            let Some(taken) = chosen.taken else {
                return args.without_order(&chosen.json);
            };
            options.pilot.order = taken.order;
            let found = Identification::of(taken.fit, options, set);
            (found, Some((chosen.json, chosen.is_whole)), None)
        }
        None => {
            let log = args.log.as_deref().map(Log::open).transpose()?;
            let mut watch = Watch::new(deadline, log, args.verbose);
            let found = Identification::new(set, options, &mut |progress| watch.flights(progress));
            let log = watch.end();
            (found?, None, log)
        }
    };
    let (orders, is_compared) = orders.unzip();
    args.check_covariance(&found)?;
    let refitted = match &plan {
        Some(plan) => args.refitted(plan, &found, deadline)?,
        None => None,
    };

    save(pilot_output, args.output(), &pilot_file::to_toml(&found))?;
    if let (Some(output), Some(path)) = (report_output, &args.report) {
        save(output, path, &page(&found, refitted.as_ref()))?;
    }
    args.print_summary(&found, refitted.as_ref(), orders)?;
    if let Some(log) = log {
        log.close(&to_json(&found, None))?;
    }
    let is_whole = refitted.as_ref().is_none_or(Refitted::is_whole);
    let is_whole = is_whole && is_compared.unwrap_or(true) && found.fit.skipped == 0;
    Ok(match found.fit.is_answer() && is_whole {
        true => Outcome::Done,
        false => Outcome::No,
    })
}

impl Args {
    /// Path of the pilot file.
    fn output(&self) -> &Path {
        self.output.as_deref().unwrap_or(Path::new("pilot.toml"))
    }

    /// Notes which of the flags that problem files do not accept, since they specify them themselves, are given, be it with
    /// their defaults.
    pub fn note_given(&mut self, matches: &ArgMatches) {
        let is_given =
            |(id, ..): &OfFlights| matches.value_source(id) == Some(ValueSource::CommandLine);
        self.of_flights = OF_FLIGHTS.iter().find(is_given);
    }

    /// Refuses what belongs to one fit where several are compared, and two outputs on stdout.
    fn check_alone(&self) -> Result<(), Failure> {
        if self.json && self.logs_to_stdout() {
            return Err(Failure::new("--json and --log - both want stdout").hint(
                "give --log a file; or leave --json out: the log's last line has the result",
            ));
        }
        if self.orders.is_some() && self.log.is_some() {
            let message = "--log writes one fit, and --orders compares several";
            return Err(Failure::new(message)
                .hint("leave --log out, or fit the order which was taken alone"));
        }
        if self.orders.is_some() && self.start.is_some() {
            let message = "--start has the parameters of one order, and --orders compares several";
            return Err(Failure::new(message).hint("leave --start out"));
        }
        Ok(())
    }

    fn options(&self) -> Result<FitOptions, Failure> {
        let pilot = Pilot {
            order: self.order.into(),
        };
        let vehicle = vehicle::resolve(self.vehicle.as_deref())?;
        let default = FitOptions::default();
        Ok(FitOptions {
            scheme: self.scheme.unwrap_or(default.scheme),
            mesh: self.mesh_step.map_or(Mesh::Samples, Mesh::Step),
            initial_state: self.initial_state,
            initial_position: self.initial_position,
            stable_loop: !self.allow_unstable_loop,
            objective: match self.objective {
                Compared::One(objective) => objective,
                Compared::Both => Objective::Response,
            },
            pilot,
            vehicle,
            vehicle_assumed: self.vehicle.is_none(),
            start: self
                .start
                .as_deref()
                .map(|all| start::theta(all, pilot))
                .transpose()?,
            random_starts: self.random_starts,
            stick_limit: self.stick_limit,
            tolerance: self.tolerance.unwrap_or(default.tolerance),
            max_iterations: self.max_iterations.unwrap_or(default.max_iterations),
            covariance: self.covariance,
        })
    }

    /// Refuses a requested covariance method that is not available for this fit.
    fn check_covariance(&self, found: &Identification) -> Result<(), Failure> {
        let sure = found.fit.uncertainty.as_ref();
        match (self.covariance, sure.map(|own| own.spread.method)) {
            (Some(asked), Some(method)) if asked != method => Err(impossible(asked)),
            _ => Ok(()),
        }
    }

    fn check_outputs(&self, set: &TrialSet) -> Result<(), Failure> {
        let inputs: Vec<PathBuf> = set.files.iter().chain(&self.vehicle).cloned().collect();
        let log = self.log.as_deref().filter(|log| !log::is_stdout(log));
        let stick = both::stick_file(self);
        let stick =
            (self.objective == Compared::Both).then_some((stick.as_path(), OutputKind::Pilot));
        let outputs: Vec<(&Path, OutputKind)> = [(self.output(), OutputKind::Pilot)]
            .into_iter()
            .chain(stick)
            .chain(self.report.as_deref().map(|path| (path, OutputKind::Page)))
            .chain(log.map(|path| (path, OutputKind::Log)))
            .chain(self.refits.output())
            .collect();
        self.overwrite.check(&inputs, &outputs)
    }

    /// Runs the refits of a fit; `None` if it cannot be refitted.
    fn refitted(
        &self,
        plan: &refits::Plan,
        found: &Identification,
        deadline: Deadline,
    ) -> Result<Option<Refitted>, Failure> {
        let study = identification::refits::study(&found.fit, &found.trials.fit, &found.options);
        match study {
            Some(study) => Ok(Some(plan.run(&study, deadline)?)),
            None => {
                terminal::note(refits::NOTHING);
                Ok(None)
            }
        }
    }

    /// Outcome of a command that has selected no order.
    fn without_order(&self, orders: &Value) -> Result<Outcome, Failure> {
        if self.json {
            terminal::print(&format!("{:#}\n", json!({ "orders": orders })))?;
        }
        Ok(Outcome::No)
    }

    /// Prints the summary, to stderr if the log goes to stdout.
    fn print_summary(
        &self,
        found: &Identification,
        refitted: Option<&Refitted>,
        orders: Option<Value>,
    ) -> Result<(), Failure> {
        let text = match self.json {
            true => {
                let mut object = to_json(found, refitted);
                if let Some(orders) = orders {
                    object["orders"] = orders;
                }
                format!("{object:#}\n")
            }
            false => {
                let refits = refitted.map_or(String::new(), Refitted::to_text);
                to_text(found) + &refits + &self.next(found)
            }
        };
        self.print(&text)
    }

    /// Prints to stdout, or to stderr if the log goes to stdout.
    fn print(&self, text: &str) -> Result<(), Failure> {
        match self.logs_to_stdout() {
            true => terminal::eprint(text),
            false => terminal::print(text)?,
        }
        Ok(())
    }

    fn logs_to_stdout(&self) -> bool {
        self.log.as_deref().is_some_and(log::is_stdout)
    }
}

/// The failure for a covariance method that is not available, with a hint to alternatives.
fn impossible(method: Method) -> Failure {
    let reason = match method {
        Method::Cr3 => Obstacle::FewRuns,
        Method::Plain | Method::Sidpac | Method::Ar => Obstacle::Negative,
    };
    let message = format!("--covariance {method} is not possible with these runs: {reason}");
    Failure::new(message).hint(
        "--covariance ar models the noise, with one run too; the default takes what is possible",
    )
}

/// The report page of a fit without co-simulations.
fn page(found: &Identification, refitted: Option<&Refitted>) -> String {
    report::page(&Report {
        found,
        refits: refitted.map(Refitted::table),
        profiles: refitted.and_then(Refitted::figure),
        loops: &[],
        made: &made(),
    })
}

/// Opens an output before the computation.
fn open(path: &Path) -> Result<AtomicFile, Failure> {
    AtomicFile::create(path).map_err(|error| Failure::cannot_write(path, &error))
}

fn save(output: AtomicFile, path: &Path, content: &str) -> Result<(), Failure> {
    (output.save(content.as_bytes())).map_err(|error| Failure::cannot_write(path, &error))
}
