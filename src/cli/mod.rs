//! The command line: parses, resolves, acts. Only this module uses clap, stdout and stderr.
//!
//! One file per command; each has an `Args` (clap) and a `run(Args) -> Result<Outcome, Failure>`.

pub mod call;
mod compare;
mod compile;
mod completions;
mod container;
mod convert;
pub mod cosim;
mod deadline;
mod demo;
mod excitation;
mod export;
mod failure;
mod fit;
#[cfg(feature = "fly")]
mod fly;
#[cfg(not(feature = "fly"))]
#[path = "fly/left_out.rs"]
mod fly;
mod fmu_warnings;
mod folder;
mod folds;
mod format;
mod guard;
mod hv;
mod info;
mod init;
mod interrupt;
mod linearize;
mod made;
mod model;
mod models;
mod number;
mod optimise;
mod overwrite;
mod pack;
mod plot;
mod progress;
mod recognise;
mod shard;
mod sweep;
mod system;
mod terminal;
mod trials;
mod validate;
mod vehicle;

pub use failure::{Failure, Outcome};

use clap::error::ErrorKind;
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use pilotage_text::printable::one_line;
use std::sync::{Mutex, PoisonError};

/// Identify how a human pilot acts on a vehicle, and export that pilot as an FMU.
#[derive(Debug, Parser)]
#[command(
    version,
    about,
    max_term_width = 100,
    arg_required_else_help = true,
    after_help = "`pilotage COMMAND --help` shows examples.\n\nExit codes: 0 done, 1 the answer is no (not converged, not \
    valid, unstable) or an FMU failed, 2 bad use or input; ended by Ctrl-C: 130."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// The commands, in the order in which a user meets them.
#[derive(Debug, Subcommand)]
enum Command {
    /// Run the whole chain on six example flights: fit, export, validation, co-simulation, report.
    Demo(demo::Args),
    /// Check recorded flights, or generate synthetic ones.
    Trials(trials::Args),
    /// Fly a vehicle on a page in the browser; flights are recorded and the pilot is identified.
    Fly(fly::Args),
    /// Write a problem file for runs and models.
    Init(init::Args),
    /// Identify a pilot from recorded flights, or the parameters of a problem file.
    Fit(Box<fit::Args>),
    /// Select one of several problem files on the same runs: by left-out runs, AICc and BIC.
    Compare(compare::Args),
    /// Optimal control of a system of models: the best inputs, by an objective and constraints.
    Optimise(optimise::Args),
    /// The height-velocity map of a helicopter after power loss, with a pilot in the loop.
    Hv(Box<hv::Args>),
    /// Show or check the coefficients of the vehicle.
    Vehicle(vehicle::Args),
    /// List the built-in pilots and vehicles, or print one.
    Models(models::Args),
    /// Check, simulate or step a model file.
    Model(model::Args),
    /// Write a model file, a pilot or a quadcopter as an FMU.
    Export(Box<export::Args>),
    /// Build an FMU from a model in Rust.
    Pack(pack::Args),
    /// Build an FMU's binary for this machine from its sources.
    Compile(compile::Args),
    /// Draw figures of a fit or of results as files.
    Plot(plot::Args),
    /// Make one FMU of a system.
    Container(Box<container::Args>),
    /// Convert a system file to SSP, or SSP to a system file.
    Convert(convert::Args),
    /// Connect FMUs and simulate them.
    Cosim(Box<cosim::Args>),
    /// Simulate a system many times with other values, and find what its measures depend on.
    Sweep(Box<sweep::Args>),
    /// Join the parts of a study that `sweep --shard` made.
    Merge(sweep::MergeArgs),
    /// Linearise the coupled system: matrices, poles, margins and effective delay of its loops.
    Linearize(Box<linearize::Args>),
    /// Check FMUs against the standard, and run them.
    Validate(validate::Args),
    /// Show the contents of an FMU: interfaces, variables, units.
    Info(info::Args),
    /// Print what a shell needs to complete commands and options.
    Completions(completions::Args),
    /// Write the manual pages.
    #[command(hide = true)]
    Man(completions::ManArgs),
    /// Test one FMU and report each stage: `validate` runs it in a separate process.
    #[command(hide = true)]
    Probe(validate::ProbeArgs),
    /// Run one FMU for another process: `--isolate` starts it.
    #[command(name = system::isolation::COMMAND, hide = true)]
    Isolated(IsolatedArgs),
}

/// Arguments of `pilotage isolated`.
#[derive(Debug, clap::Args)]
struct IsolatedArgs {
    /// Over which questions come.
    channel: std::path::PathBuf,
}

/// Entry point of the command. Exit codes: 0 done, 1 ran but the answer is no, 2 invalid usage or input.
pub fn main() -> u8 {
    let parsed = Cli::command().try_get_matches_from(call::arguments());
    let parsed = parsed.and_then(|matches| Ok((Cli::from_arg_matches(&matches)?, matches)));
    let (mut command, matches) = match parsed {
        Ok((cli, matches)) => (cli.command, matches),
        Err(error) => return refused(error),
    };
    let writes_json = writes_json(&matches);
    if let (Command::Fit(args), Some((_, own))) = (&mut command, matches.subcommand()) {
        args.note_given(own);
    }
    crate::atomic_file::stay();
    pilotage_process::own::remember();
    // If signals cannot be handled, temporary files remain until the next run removes them.
    let _ = pilotage_process::leftovers::remove_on_signals();
    let is_watched = match pilotage_process::end_with_parent() {
        Ok(is_watched) => is_watched,
        Err(error) => {
            // What the other process then has to say is the message below.
            pilotage_process::finished(2);
            return failed(&Failure::new(format!("cannot be watched: {error}")));
        }
    };
    if !is_watched && command.may_call_fmus() {
        let code = guard::watched().unwrap_or_else(|failure| failed(&failure));
        pilotage_process::leftovers::stay_if_ending();
        return code;
    }
    // Without it, what FMUs print stays where users expect it, and `/dev/stdout` may name an output.
    if is_watched && writes_json {
        pilotage_process::own::separate_stdout();
    }
    // `validate` judges what an FMU says where it is misused.
    if !matches!(command, Command::Probe(_)) {
        fmu_warnings::show();
    }
    let code = run(command);
    pilotage_process::finished(code);
    pilotage_process::leftovers::stay_if_ending();
    code
}

/// Prints help that was asked for, or what is wrong with the arguments: they may be names of files that somebody else made.
fn refused(error: clap::Error) -> u8 {
    // Once more, with arguments that cannot begin a line of their own in the message.
    let shown = call::arguments();
    let shown = (shown.iter()).map(|own| one_line(&own.to_string_lossy()).into_owned());
    let again = Cli::command().try_get_matches_from(shown);
    let error = again.err().unwrap_or(error);
    if !matches!(
        error.kind(),
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
    ) && error.use_stderr()
    {
        let error = error.format(&mut Cli::command());
        terminal::eprint(&error.to_string());
        return 2;
    }
    error.exit()
}

/// Whether the command was given `--json`.
fn writes_json(matches: &ArgMatches) -> bool {
    match matches.subcommand() {
        Some((_, own)) => writes_json(own),
        None => matches!(matches.try_get_one("json"), Ok(Some(true))),
    }
}

/// Runs a command and returns its exit code.
fn run(command: Command) -> u8 {
    let ready = match command.is_parallel() {
        true => start_threads(),
        false => Ok(()),
    };
    let outcome = ready.and_then(|()| done(command));
    match outcome {
        Ok(outcome) => outcome.code(),
        Err(failure) => {
            // An error due to files removed by the signal handler is not reported.
            pilotage_process::leftovers::stay_if_ending();
            terminal::eprint(&format!("{failure}\n"));
            failure.code()
        }
    }
}

/// Starts the threads for parallel work, once for all commands of this process.
fn start_threads() -> Result<(), Failure> {
    static PROCESS: Mutex<Option<u32>> = Mutex::new(None);
    let mut process = PROCESS.lock().unwrap_or_else(PoisonError::into_inner);
    let own = std::process::id();
    match *process {
        Some(before) if before == own => return Ok(()),
        Some(_) => {
            let message = "this process was forked from one that computes in parallel, and has none of its threads";
            return Err(Failure::new(message).hint("spawn it instead of forking it"));
        }
        None => {}
    }
    let started = crate::collocation::start_threads().map_err(|error| {
        Failure::new(format!("cannot start threads: {error}")).hint(
            "RAYON_NUM_THREADS=1 asks for one only; limits of memory and of processes (`ulimit -v`, `ulimit -u`) may forbid it",
        )
    });
    *process = started.is_ok().then_some(own);
    started
}

fn done(command: Command) -> Result<Outcome, Failure> {
    match command {
        Command::Demo(args) => demo::run(args),
        Command::Trials(args) => trials::run(args),
        Command::Fly(args) => fly::run(args),
        Command::Init(args) => init::run(args),
        Command::Fit(args) => fit::run(*args),
        Command::Compare(args) => compare::run(&args),
        Command::Optimise(args) => optimise::run(&args),
        Command::Hv(args) => hv::run(&args),
        Command::Sweep(args) => sweep::run(&args),
        Command::Merge(args) => sweep::merge(&args),
        Command::Vehicle(args) => vehicle::run(args),
        Command::Models(args) => models::run(args),
        Command::Model(args) => model::run(args),
        Command::Export(args) => export::run(*args),
        Command::Pack(args) => pack::run(args),
        Command::Compile(args) => compile::run(args),
        Command::Plot(args) => plot::run(args),
        Command::Convert(args) => convert::run(&args),
        Command::Container(args) => container::run(&args),
        Command::Cosim(args) => cosim::run(*args),
        Command::Linearize(args) => linearize::run(*args),
        Command::Validate(args) => validate::run(args),
        Command::Info(args) => info::run(args),
        Command::Completions(args) => completions::run(&args),
        Command::Man(args) => completions::man(&args),
        Command::Probe(args) => validate::probe(args),
        Command::Isolated(args) => {
            match crate::cosim::fmu_component::isolated::serve(&args.channel) {
                Ok(()) => Ok(Outcome::Done),
                Err(error) => Err(Failure::new(format!(
                    "no channel {}: {error}",
                    args.channel.display()
                ))),
            }
        }
    }
}

fn failed(failure: &Failure) -> u8 {
    terminal::eprint(&format!("{failure}\n"));
    2
}

impl Command {
    /// Whether the command computes in parallel whatever its options are.
    fn is_parallel(&self) -> bool {
        matches!(
            self,
            Self::Demo(_)
                | Self::Merge(_)
                | Self::Trials(_)
                | Self::Init(_)
                | Self::Fit(_)
                | Self::Compare(_)
                | Self::Hv(_)
                | Self::Sweep(_)
                | Self::Plot(_)
        )
    }

    /// Whether the command may run code of FMUs in its own process.
    fn may_call_fmus(&self) -> bool {
        match self {
            Self::Cosim(_) | Self::Container(_) | Self::Linearize(_) | Self::Sweep(_) => true,
            Self::Fit(_)
            | Self::Compare(_)
            | Self::Init(_)
            | Self::Hv(_)
            | Self::Model(_)
            | Self::Optimise(_)
            | Self::Plot(_)
            | Self::Trials(_)
            | Self::Fly(_) => guard::arguments_name_fmus(),
            // Only those of system files are loaded in this process.
            Self::Info(_) | Self::Validate(_) => guard::systems_name_fmus(),
            // No wildcard: of each new command it must be said.
            Self::Demo(_)
            | Self::Merge(_)
            | Self::Convert(_)
            | Self::Vehicle(_)
            | Self::Models(_)
            | Self::Export(_)
            | Self::Pack(_)
            | Self::Compile(_)
            | Self::Completions(_)
            | Self::Man(_)
            | Self::Probe(_)
            | Self::Isolated(_) => false,
        }
    }
}
