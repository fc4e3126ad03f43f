//! `pilotage fit`: fits a problem, or the one that recorded flights pose.
//!
//! | module, each used by those above | contents |
//! | --- | --- |
//! | `run` | one fit, from the problem to what is written |
//! | `both` | `--objective both`: two fits |
//! | `task` | a problem file, or flights and their problem |
//! | `page`, `tables` | the report page |
//! | `summary`, `sure`, `describing` | the results as text and JSON |
//! | `models`, `kept` | the files of fitted models |
//! | `orders`, `refits`, `checks` | what solves again |
//! | `evaluate`, `start` | the start values |
//! | `handed` | the results as tables, for a program that calls the command |
//! | `watch`, `log`, `table` | what is shown while it solves |

mod both;
mod checks;
mod describing;
mod evaluate;
mod handed;
mod kept;
mod log;
mod models;
mod orders;
mod page;
mod refits;
mod run;
mod start;
mod summary;
mod sure;
mod table;
mod tables;
mod task;
mod watch;

use super::number::{positive, whole, within};
use super::overwrite::Overwrite;
use super::trials::Columns;
use super::{Failure, Outcome, terminal};
use crate::collocation::Scheme;
use crate::estimation::file::{Limits, Options};
use crate::flights::FlightOptions;
use crate::flights::options::{InitialPosition, InitialState, Objective};
use crate::inference::Method;
use checks::Checks;
use clap::ArgMatches;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::parser::ValueSource;
pub use models::{HEAD as FITTED, planned};
use orders::Orders;
pub use page::page;
pub use refits::HEAD as REFITS;
use refits::Refits;
pub use run::{outcomes, page_of as page_of_problem, solved};
use serde_json::{Value, json};
use start::Begin;
use std::path::PathBuf;
pub use summary::Outcomes;
pub use task::Task;
pub use watch::{Iterate, Watch};

/// The highest order of a pilot that is fitted to flights.
const MAX_ORDER: usize = 6;

/// Version of the JSON that a fit prints, docs/json.md. It grows when a key goes or changes its meaning.
pub const SCHEMA: u32 = 3;

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

  # Which order do the data support? The prediction of left-out runs decides.
  pilotage fit run*.csv --orders 1..4

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
  pilotage fit run*.csv --leave-one-out
  pilotage fit problem.toml --per-run --report fit.html

  # At most ten seconds, and a continuation from the result.
  pilotage fit run*.csv --time-limit 10
  pilotage fit run*.csv --start 0.25,1.25,1.02,-0.0005,0.005,-0.058
  pilotage fit problem.toml --start pilot.gain=0.3,pilot.lag=0.2

A fit that is stopped by a limit or Ctrl-C writes the best iterate, marked as not converged; a second
Ctrl-C kills the process. Diagnostics are reasons to doubt the result; each has a code.
Exit codes: 0 converged, 1 not converged (the best iterate is written), a comparison that was stopped or has
fewer than three runs, or a diagnostic that makes the result meaningless, 2 bad use or input.";

/// Arguments of `pilotage fit`; the defaults are those of [`FlightOptions`].
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Recorded flights (CSV) or manifests of flights (TOML), or one problem file (TOML, docs/problems.md).
    #[arg(required = true)]
    trials: Vec<PathBuf>,
    #[command(flatten)]
    columns: Columns,
    /// File of the fitted model, or a folder for several [default: pilot.toml; of a problem file INSTANCE-fitted.toml].
    #[arg(short, long)]
    output: Option<PathBuf>,
    #[arg(long, help = or_file("Collocation scheme; the paper uses `euler`", "one that suits the equations", "scheme"))]
    scheme: Option<Scheme>,
    /// Approximate length of the mesh intervals [s] [default: the samples are the mesh; the mesh of a problem file].
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true)]
    mesh_step: Option<f64>,
    /// Assumption about the states at the first sample; the paper uses `free`.
    #[arg(long, value_parser = named(InitialState::ALL, InitialState::as_str),
          default_value = FlightOptions::default().initial_state.as_str())]
    initial_state: InitialState,
    /// Position at the first sample of a vehicle at rest: estimated, since that sample is a measurement, or known
    /// exactly, as in a simulator.
    #[arg(long, value_parser = named(InitialPosition::ALL, InitialPosition::as_str),
          default_value = FlightOptions::default().initial_position.as_str())]
    initial_position: InitialPosition,
    /// Do not constrain the closed loop of pilot and vehicle to be stable.
    #[arg(long)]
    allow_unstable_loop: bool,
    /// What is compared with the recording: the vehicle's response (as in the paper), the stick, or both in two fits.
    #[arg(long, value_parser = named(Compared::ALL, Compared::as_str), default_value = Compared::ALL[0].as_str())]
    objective: Compared,
    /// Start values of the parameters: one for each, in the order of the summary, or NAME=VALUE,... for some [default: estimated from the data; those of a problem file].
    #[arg(
        long,
        value_name = "VALUES",
        value_delimiter = ',',
        value_parser = start::begin,
        allow_hyphen_values = true
    )]
    start: Option<Vec<Begin>>,
    /// Number of additional random starts [default: 7, or the `starts` of a problem file less the given one].
    #[arg(long, value_name = "N", value_parser = whole::<usize>, allow_hyphen_values = true)]
    random_starts: Option<usize>,
    /// File of the vehicle that was flown (TOML) [default: the default vehicle].
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// Order n of the pilot, which has 2n parameters.
    #[arg(long, default_value_t = FlightOptions::default().order as u8,
          value_parser = within(1..=MAX_ORDER as u8), allow_hyphen_values = true)]
    order: u8,
    /// Compare pilots of these orders, and continue with the smallest order that no larger one surpasses in the
    /// prediction of left-out runs (see `pilotage compare`).
    #[arg(long, value_name = "FIRST..LAST", value_parser = orders::orders, conflicts_with_all = ["order", "evaluate"])]
    orders: Option<Orders>,
    /// Limit of the stick |y_p|.
    #[arg(long, default_value_t = FlightOptions::default().stick_limit, value_parser = positive, allow_hyphen_values = true)]
    stick_limit: f64,
    #[arg(long, value_parser = named(Limits::ALL, Limits::as_str), value_name = "WAY",
          help = or_file("How outputs keep their limits: they saturate there, or the limits are constraints at all samples, as in the paper",
                         Options::default().limits.as_str(), "limits"))]
    limits: Option<Limits>,
    #[arg(long, value_parser = whole::<usize>, allow_hyphen_values = true,
          help = or_file("Iteration limit of each start", Options::default().max_iterations, "max_iterations"))]
    max_iterations: Option<usize>,
    /// Stop after this time [s] with the best iterate; with --orders with the best of the compared ones, if any.
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true)]
    time_limit: Option<f64>,
    #[arg(long, value_parser = positive, allow_hyphen_values = true,
          help = or_file("Scaled KKT residual at convergence", format!("{:e}", Options::default().tolerance), "tolerance"))]
    tolerance: Option<f64>,
    /// Write a report page (HTML).
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Print objective, gradient and residuals at the start values, without a fit.
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
    match args.objective {
        Compared::Both => both::run(&args),
        Compared::One(_) => run::run(&args),
    }
}

impl Args {
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

    /// Outcome of a command that has selected no order.
    fn without_order(&self, orders: &Value) -> Result<Outcome, Failure> {
        if self.json {
            terminal::print(&format!("{:#}\n", json!({ "orders": orders })))?;
        }
        Ok(Outcome::No)
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
