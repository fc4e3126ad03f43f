//! `pilotage sweep`: many runs of a system with other values, and what its measures depend on; `pilotage merge` joins shards.

mod page;
mod plan;
mod run;
mod store;
mod summary;
mod traces;

use super::cosim::coupling::CouplingArgs;
use super::cosim::scenario;
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
use traces::Traces;

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

  # The engine fails at some time, and all heights over time are kept (docs/cosim.md has scenarios).
  pilotage sweep loop.toml --scenario lost.toml --vary 'scenario.failure~uniform(2, 8)' --samples 500 --trajectories=vehicle.z \\
    --measure 'min(vehicle.z)' --stop-time 15 --step 0.05 -o failures

The folder has sweep.csv and sweep.parquet (a row for each sample), sweep.json and sweep.html (quantiles, dependences, figures). A study that was
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
    /// Keep the trajectories of all samples, in trajectories.parquet: of all outputs, or of signals named like
    /// `--trajectories=vehicle.z,pilot.*`.
    #[arg(long, value_name = "PATTERN,...", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    trajectories: Option<String>,
    /// What happens in each run (TOML, docs/cosim.md); numbers of an event with a name can be varied: `scenario.NAME` is its time,
    /// `scenario.NAME.KEY` its duration, set, bias, scale, delay, noise, seed, or the level of its condition.
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
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
    let scenario = args.scenario.as_deref().map(scenario::Read::new);
    let scenario = scenario.transpose()?.unwrap_or_default();
    let mut first = run::Opened::of(args)?;
    // A mistake in a name, a value or a measure is one of all samples.
    let (plan, measures) = Plan::new(args, &scenario, &mut first)?;
    let runs = run::Runs::new(args, &plan, scenario, measures, first)?;
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
        store.begin(&plan)?;
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
            write(&args.output, &plan, &rows, store.traces(), args.json)?;
            store.remove();
            Ok(outcome(&rows))
        }
    }
}

/// Runs `pilotage merge`.
pub fn merge(args: &MergeArgs) -> Result<Outcome, Failure> {
    let (plan, rows, traces) = store::merged(&args.parts)?;
    folder::create_new(&args.output, args.force)?;
    write(&args.output, &plan, &rows, traces.as_ref(), args.json)?;
    Ok(outcome(&rows))
}

fn outcome(rows: &[Row]) -> Outcome {
    match rows.iter().all(|own| own.failure.is_none()) {
        true => Outcome::Done,
        false => Outcome::No,
    }
}

/// Writes all files of a study, and its summary.
fn write(
    output: &Path,
    plan: &Plan,
    rows: &[Row],
    traces: Option<&Traces>,
    is_json: bool,
) -> Result<(), Failure> {
    let found = summary::Summary::of(plan, rows);
    let json = format!("{:#}\n", found.to_json(plan));
    overwrite::save(&output.join("sweep.csv"), store::table(plan, rows))?;
    let columns = output.join("sweep.parquet");
    let bytes = store::parquet(plan, rows);
    let bytes = bytes.map_err(|error| Failure::cannot_write(&columns, &error))?;
    overwrite::save(&columns, bytes)?;
    overwrite::save(&output.join("sweep.json"), &json)?;
    let mut fans = Vec::new();
    if let Some(traces) = traces {
        let path = output.join("trajectories.parquet");
        traces.write(&path, plan)?;
        let drawn = 0..plan.traced.len().min(page::MOST);
        let all = drawn.map(|k| traces.fan(k, plan)).collect::<Result<_, _>>();
        fans = all.map_err(|error| Failure::new(format!("cannot read trajectories: {error}")))?;
    }
    overwrite::save(
        &output.join("sweep.html"),
        page::html(plan, rows, &found, &fans),
    )?;
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
