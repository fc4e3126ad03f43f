//! `pilotage sweep`: many runs of a system with other values, and what its measures depend on; `pilotage merge` joins shards.

mod page;
mod plan;
mod run;
mod store;
mod summary;

use super::cosim::coupling::CouplingArgs;
use super::cosim::times::Times;
use super::deadline::Deadline;
use super::number::positive;
use super::progress::Counter;
use super::shard::Shard;
use super::system::flags::Wiring;
use super::{Failure, Outcome, folder, interrupt, overwrite, terminal};
use pilotage_sweep::REDUCERS;
use pilotage_text::counted;
use plan::Plan;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;
use store::{Row, Store};

const EXAMPLES: &str = "\
Examples:
  # How the loop settles for masses and gains: all combinations.
  pilotage sweep loop.toml --vary vehicle.mass=0.8:1.6:9 --vary pilot.gain=0.05,0.1,0.2 --stop-time 15 --step 0.05 \\
    --measure 'settling(vehicle.z, 0.05)' --measure 'rms = rms(vehicle.z - 10)' -o sweep

  # Five hundred draws, and which of the variables matters; the pilot's parameters as its fit knows them, with their covariance.
  pilotage sweep loop.toml --vary 'vehicle.mass~normal(1.2, 0.1)' --vary 'pilot~fit' --method latin-hypercube --samples 500 \\
    --measure 'overshoot(vehicle.z)' --stop-time 15 --step 0.05 -o draws

  # Sobol' indices of two variables: 256 (2 + 2) runs.
  pilotage sweep loop.toml --vary 'vehicle.mass~uniform(0.8, 1.6)' --vary 'pilot.gain~loguniform(0.05, 0.2)' --method saltelli \\
    --samples 256 --measure 'final(vehicle.z)' --stop-time 15 --step 0.05 -o indices

  # The rows of a table, whose columns are named like variables. A third of a study on each of three machines.
  pilotage sweep loop.toml --table samples.csv --measure 'peak(pilot.stick)' --stop-time 15 --step 0.05 --shard 1/3 -o one
  pilotage merge one two three -o all

The folder has sweep.csv (a row for each sample), sweep.json and sweep.html (quantiles, dependences, figures). A study that was
stopped or killed goes on with the same command. The same samples give the same bytes in any order, on any number of threads, whole
or in shards. A sample that fails is a row with its reason.
Exit codes: 0 done, 1 stopped, or samples failed, 2 bad use or input.";

/// Arguments of `pilotage sweep`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    wiring: Wiring,
    /// What is varied; may be repeated: NAME=LOW:HIGH:COUNT, NAME=VALUE,VALUE..., NAME~uniform(low, high), ~loguniform(low, high),
    /// ~normal(mean, sd), ~lognormal(median, sd of the logarithm), ~triangular(low, likely, high); INSTANCE~fit for all parameters
    /// of a fitted model file, by the covariance that it has.
    #[arg(long, value_name = "NAME=VALUES|NAME~LAW")]
    vary: Vec<String>,
    /// Samples from a file: CSV, columns named `instance.variable`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["vary", "method", "samples"])]
    table: Option<PathBuf>,
    /// How samples are chosen [default: grid of lists, else latin-hypercube].
    #[arg(long, value_enum)]
    method: Option<plan::MethodName>,
    /// Number of samples; of saltelli, of base samples.
    #[arg(long, value_name = "COUNT", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    samples: u32,
    /// Seed of all random numbers.
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    seed: u32,
    /// Number of each run, an expression of signals; may be repeated. [NAME =] with initial, final, min, max, peak, mean, sd, rms,
    /// integral, at(x, t), when(x), settling(x, part), overshoot, rise [default: the last values of all outputs].
    #[arg(long, value_name = "EXPRESSION")]
    measure: Vec<String>,
    #[command(flatten)]
    times: Times,
    #[command(flatten)]
    coupling: CouplingArgs,
    /// Only part I of N of the samples; `pilotage merge` joins all parts.
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Folder to write.
    #[arg(long, short, value_name = "FOLDER", default_value = "sweep")]
    output: PathBuf,
    /// Write into a folder that has other files.
    #[arg(long)]
    force: bool,
    /// Stop after this time [s]; the samples that are done are kept.
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true)]
    time_limit: Option<f64>,
    /// Print sweep.json; of a part the numbers of its samples and of all, and the time of a sample [s].
    #[arg(long)]
    json: bool,
}

/// Arguments of `pilotage merge`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  pilotage merge one two three -o all    the folders of --shard 1/3, 2/3, 3/3"
)]
pub struct MergeArgs {
    /// Folders of the parts of one study.
    #[arg(required = true, value_name = "FOLDER")]
    parts: Vec<PathBuf>,
    /// Folder to write.
    #[arg(long, short, value_name = "FOLDER", default_value = "sweep")]
    output: PathBuf,
    /// Write into a folder that has other files.
    #[arg(long)]
    force: bool,
    /// Print sweep.json.
    #[arg(long)]
    json: bool,
}

/// Runs `pilotage sweep`.
pub fn run(args: &Args) -> Result<Outcome, Failure> {
    let whole = args.shard.unwrap_or(Shard::WHOLE);
    let first = run::Opened::of(args)?;
    // A mistake in a name, a value or a measure is one of all samples.
    let (plan, measures) = Plan::new(args, &first)?;
    let runs = run::Runs::new(args, &plan, measures, first)?;
    let plan = Plan {
        is_repeatable: runs.is_repeatable,
        ..plan.clone()
    };
    let mut store = Store::open(&args.output, &plan, whole)?;
    if !store.is_resumed() {
        let created = folder::create_new(&args.output, args.force);
        created.map_err(|failure| match store.is_of_others() {
            true => failure.hint(
                "another study was stopped in it; the same arguments go on, --force begins anew",
            ),
            false => failure,
        })?;
        store.begin()?;
    }
    interrupt::listen("stopping; the samples that are done are kept")?;
    let deadline = Deadline::after(args.time_limit);
    let wanted: Vec<usize> = (0..plan.design.count())
        .filter(|k| whole.has(*k) && !store.has(*k))
        .collect();
    let counter = Counter::new("samples", wanted.len() as u64);
    let begin = Instant::now();
    let is_whole = runs.all(&wanted, &counter, &deadline, &mut store)?;
    let seconds = begin.elapsed().as_secs_f64() / wanted.len().max(1) as f64;
    counter.clear();
    if !is_whole {
        terminal::note(&format!(
            "stopped: {} kept in {}; the same command goes on",
            counted(store.count(), "sample"),
            terminal::shown(&args.output)
        ));
        return Ok(Outcome::No);
    }
    let rows = store.rows();
    match args.shard {
        Some(own) => {
            store.finish(&rows)?;
            if args.json {
                let part =
                    json!({ "samples": rows.len(), "of": plan.design.count(), "seconds": seconds });
                terminal::print(&format!("{part}\n"))?;
                return Ok(outcome(&rows));
            }
            let text = format!(
                "{} of part {} of {} in {}\nnext: the other parts, then pilotage merge FOLDER... -o all\n",
                counted(rows.len(), "sample"),
                own.own,
                own.of,
                terminal::shown(&args.output)
            );
            terminal::print(&text)?;
            Ok(outcome(&rows))
        }
        None => {
            write(&args.output, &plan, &rows, args.json)?;
            store.remove();
            Ok(outcome(&rows))
        }
    }
}

/// Runs `pilotage merge`.
pub fn merge(args: &MergeArgs) -> Result<Outcome, Failure> {
    let (plan, rows) = store::merged(&args.parts)?;
    folder::create_new(&args.output, args.force)?;
    write(&args.output, &plan, &rows, args.json)?;
    Ok(outcome(&rows))
}

fn outcome(rows: &[Row]) -> Outcome {
    match rows.iter().all(|own| own.failure.is_none()) {
        true => Outcome::Done,
        false => Outcome::No,
    }
}

/// Writes all files of a study, and its summary.
fn write(output: &Path, plan: &Plan, rows: &[Row], is_json: bool) -> Result<(), Failure> {
    let found = summary::Summary::of(plan, rows);
    let json = format!("{:#}\n", found.to_json(plan));
    overwrite::save(&output.join("sweep.csv"), store::table(plan, rows))?;
    overwrite::save(&output.join("sweep.json"), &json)?;
    overwrite::save(&output.join("sweep.html"), page::html(plan, rows, &found))?;
    terminal::print(&match is_json {
        true => json,
        false => found.to_text(output),
    })
}

/// Reducers with their meanings, for messages.
fn reducers() -> String {
    let all: Vec<&str> = REDUCERS.iter().map(|own| own.0).collect();
    all.join(", ")
}
