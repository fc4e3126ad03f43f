//! `pilotage model simulate`: simulates a single model.

use super::super::number::positive;
use super::super::overwrite::Overwrite;
use super::super::{Failure, Outcome, cosim};
use super::open::{ModelArgs, settable};
use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

/// Arguments of `pilotage model simulate`.
#[derive(Debug, clap::Args)]
pub struct RunArgs {
    /// Stop time [s].
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = positive)]
    stop_time: f64,
    /// Time between rows of the result [s]; must divide the time [default: a thousandth of the time].
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    step: Option<f64>,
    /// Table of inputs over time (CSV).
    #[arg(long, value_name = "CSV")]
    input: Option<PathBuf>,
    /// Set a parameter, an input or a start value; may be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = super::super::system::flags::pair)]
    set: Vec<(String, String)>,
    /// Result file (CSV).
    #[arg(short, long, value_name = "FILE", default_value = "result.csv")]
    output: PathBuf,
    /// Write a page with all signals over time.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Print one JSON object instead of text.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Further arguments of `pilotage cosim`, such as `-- --record 'car.s*'`.
    #[arg(last = true)]
    more: Vec<OsString>,
}

/// Runs `pilotage model simulate`: a co-simulation with one instance, all of whose signals are recorded.
pub fn run(model: &ModelArgs, args: &RunArgs) -> Result<Outcome, Failure> {
    let opened = model.open()?;
    let name = opened.compiled().file.name.clone();
    let mut words: Vec<OsString> = vec!["pilotage cosim".into()];
    let mut option = |name: &str, value: OsString| words.extend([name.into(), value]);
    option("--stop-time", args.stop_time.to_string().into());
    let step = args.step.unwrap_or(args.stop_time / 1000.0);
    option("--step", step.to_string().into());
    let is_given = |flag: &str| args.more.iter().any(|word| is_flag(word, flag));
    if !is_given("--record") {
        option("--record", format!("{name}.*").into());
    }
    option("-o", args.output.clone().into());
    for (variable, value) in &args.set {
        let variable = settable(&opened, variable);
        option("--set", format!("{name}.{variable}={value}").into());
    }
    if let Some(report) = &args.report {
        option("--report", report.clone().into());
    }
    if let Some(input) = &args.input {
        let mut named = OsString::from("input=");
        named.push(input);
        option("--input", named);
    }
    // Only strong coupling follows a table within the time between two rows of the result.
    let has_table = args.input.is_some() || is_given("--input");
    if has_table && !is_given("--algorithm") && !is_given("--parallel") {
        option("--algorithm", "strong".into());
    }
    let flags = [(args.json, "--json"), (args.overwrite.force, "--force")];
    let flags = flags.into_iter().filter(|(is_given, _)| *is_given);
    words.extend(flags.map(|(_, flag)| flag.into()));
    let mut own = OsString::from(format!("{name}="));
    own.push(&model.model);
    words.push(own);
    words.extend(args.more.iter().cloned());
    let mut of_cosim = cosim::Args::of(&words)?;
    of_cosim.wiring.order = model.order.map(|order| order as u32);
    cosim::run(of_cosim)
}

/// Whether an argument of `pilotage cosim` is this flag, alone or with its value.
fn is_flag(word: &OsStr, flag: &str) -> bool {
    let word = word.to_string_lossy();
    word.strip_prefix(flag)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('='))
}
