//! `pilotage model`: checks and simulates a model file.
//!
//! | module | what it does |
//! | --- | --- |
//! | `open` | opens a model file, or a built-in model by name |
//! | `check` | prints how a model was interpreted |
//! | `simulate` | simulates a single model |
//! | `step` | computes step responses |

pub mod check;
pub mod open;
mod simulate;
mod step;

use self::open::ModelArgs;
use super::{Failure, Outcome};
use clap::Subcommand;

/// Arguments of `pilotage model`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Check a model file and print its variables, units, equations, and poles at the start values.
    #[command(after_help = "Examples:\n  \
        pilotage model check crossover.toml\n  \
        pilotage model check linear --order 4          a built-in model\n  \
        pilotage model check car.toml --json | jq .linear.poles")]
    Check {
        #[command(flatten)]
        model: ModelArgs,
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Simulate a single model; `pilotage cosim` connects several.
    #[command(after_help = "Examples:\n  \
        pilotage model simulate car.toml --set speed=25 --stop-time 5 -o car.csv\n  \
        pilotage model simulate car.toml --input steering.csv --stop-time 5 --report car.html\n\n\
        The input file is a table over time (CSV: `time [s]`, then columns named like inputs, with units). \
        Further options of `pilotage cosim` follow `--`: \
        pilotage model simulate car.toml --stop-time 5 -- --record-every 0.1")]
    Simulate {
        #[command(flatten)]
        model: ModelArgs,
        #[command(flatten)]
        run: simulate::RunArgs,
    },
    /// Step responses from each input to each output: value at the end, and relative to it rise time, overshoot and
    /// settling time.
    #[command(after_help = "Examples:\n  \
        pilotage model step dc_motor.toml --input voltage --size 12\n  \
        pilotage model step short_period --input stick --size 0.1 --csv step.csv --report step.html")]
    Step {
        #[command(flatten)]
        model: ModelArgs,
        #[command(flatten)]
        step: step::StepArgs,
    },
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    match args.command {
        Command::Check { model, json } => check::run(model.open()?, json),
        Command::Simulate { model, run } => simulate::run(&model, &run),
        Command::Step { model, step } => step::run(&model, &step),
    }
}
