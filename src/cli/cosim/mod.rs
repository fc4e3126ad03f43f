//! `pilotage cosim`: connects FMUs and simulates them.

pub mod coupling;
pub mod ending;
mod live;
pub mod metadata;
mod pace;
pub mod prepared;
mod report;
mod rows;
pub mod scenario;
mod state;
mod summary;
pub mod times;
mod watch;

use self::coupling::CouplingArgs;
use self::live::{Live, LiveArgs, Traffic};
use self::pace::{Deadlines, Pace};
use self::rows::Rows;
pub use self::state::HEADER as STATE;
use self::summary::Summary;
use self::times::Times;
use self::watch::{ProgressFormat, Watch};
use super::number::positive;
use super::overwrite::{self, OutputKind, Overwrite};
use super::system::flags::Wiring;
use super::system::tables::InputTable;
use super::system::{Built, full_name, only};
use super::{Failure, Outcome, call, interrupt, terminal};
use crate::atomic_file;
use crate::cosim::recorder::Signal;
use crate::cosim::{
    Algorithm, Checkpoints, Clock, Components, Ending, Finite, NotFinite, Run, Selection, System,
    Thinned,
};
use crate::error_chain::error_chain;
use clap::Parser;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  # The pilot flies the quadcopter to 10 m.
  pilotage cosim pilot.fmu quadcopter.fmu \\
    --connect pilot.stick=quadcopter.stick --connect quadcopter.z=pilot.position \\
    --set pilot.target=10 --stop-time 15 --step 0.05 -o result.csv

  # Two instances of one FMU, with names.
  pilotage cosim left=pilot.fmu right=pilot.fmu --stop-time 1 --step 0.1

  # A target over time from column `target [ft]` of flight.csv; parameters from a file.
  pilotage cosim pilot.fmu --input flight.csv --connect flight.target=pilot.target \\
    --parameters pilot-values.toml --stop-time 15 --step 0.05

  # A long run with few recorded signals and rows.
  pilotage cosim pilot.fmu --record 'pilot.s*,pilot.theta1' --record-every 1 \\
    --stop-time 3600 --step 0.05 --progress json

  # A system file with instances, wires and values (docs/systems.md); --save-system writes one.
  pilotage cosim system.toml --stop-time 15 --step 0.05

  # A system of another tool: SSP (archive, folder or .ssd), OspSystemStructure.xml, mm.json of maestro.
  pilotage cosim system.ssp --variant heavy --step 0.05

  # The same with another vehicle and another target: arguments take precedence over the file.
  pilotage cosim system.toml vehicle=heavy.fmu --set pilot.target=20 --stop-time 15 --step 0.05

  # The state at 10 s, and a run that goes on from it, as after a crash.
  pilotage cosim system.toml --stop-time 15 --step 0.05 --save-state 10=run.state
  pilotage cosim system.toml --from-state run.state -o rest.csv

  # Parquet, with units and descriptions inside: `attrs` of the frame that pandas reads.
  pilotage cosim system.toml --stop-time 15 --step 0.05 -o result.parquet

  # By the clock, with a target that comes over UDP, and each row sent.
  pilotage cosim system.toml --stop-time 60 --step 0.01 --real-time \\
    --live pilot.target --udp-in 127.0.0.1:5001 --udp-out 127.0.0.1:5002

The result has a column `time` [s] and a column `instance.variable [unit]` for every output; --input
reads it. During the run it is in RESULT.part, and is renamed at the end. After a crash RESULT.part
remains; the next run renames it and reports that.
Exit codes: 0 done, 1 an FMU failed during the run or Ctrl-C stopped it (the rows until then are
kept), or signals are NaN or infinite, 2 bad use or input.";

/// Arguments of `pilotage cosim`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    pub wiring: Wiring,
    #[command(flatten)]
    times: Times,
    #[command(flatten)]
    coupling: CouplingArgs,
    /// Signals to record, in this order: `instance.variable`, where `*` stands for any characters and `?` for one
    /// character. A pattern selects outputs, inputs and locals, or parameters if none of these match [default: all
    /// outputs].
    #[arg(long, value_name = "PATTERN,...")]
    record: Vec<String>,
    /// Time between recorded rows [s], a multiple of the step [default: the step]. The last row is always recorded.
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_hyphen_values = true)]
    record_every: Option<f64>,
    /// Result file: CSV, or Parquet if its name ends in .parquet.
    #[arg(short, long, value_name = "FILE", default_value = "result.csv")]
    output: PathBuf,
    /// Also write RESULT-metadata.json with units and descriptions of a CSV result's columns (CSV on the Web); a Parquet file has
    /// them itself.
    #[arg(long)]
    metadata: bool,
    /// What happens in the run (TOML, docs/cosim.md): from a time or a condition on, inputs are set, frozen, shifted, scaled,
    /// delayed or noisy, or the run ends.
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Pace the run by the clock: so many simulated seconds in a second; missed deadlines are counted.
    #[arg(long, value_name = "FACTOR", value_parser = positive, num_args = 0..=1, default_missing_value = "1")]
    real_time: Option<f64>,
    #[command(flatten)]
    live: LiveArgs,
    /// Write the state of the run at a time [s], or where it ends or Ctrl-C stops it; may be repeated. All FMUs need to write
    /// theirs (canGetAndSetFMUstate, canSerializeFMUstate).
    #[arg(long, value_name = "[TIME=]FILE", value_parser = state::save)]
    save_state: Vec<state::Save>,
    /// Go on from a state that --save-state wrote, with the same system and arguments: the rows from its time on are those of a
    /// run without a stop, to the last bit.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["start_time", "step"])]
    from_state: Option<PathBuf>,
    /// Write a page with the recorded signals over time, the lag and error of each connection, and the time of all
    /// calls.
    #[arg(long, value_name = "FILE", conflicts_with = "parallel")]
    report: Option<PathBuf>,
    /// Accept NaN and infinite signals: no error, exit code 0.
    #[arg(long)]
    allow_nan: bool,
    /// Format of the progress on stderr.
    #[arg(long, value_enum, default_value_t)]
    progress: ProgressFormat,
    /// Print one JSON object instead of text.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    // Errors that can be detected without the files are reported before the files are opened.
    if !args.wiring.has_system_file() {
        args.times.check()?;
    }
    args.check_report()?;
    let read: Vec<PathBuf> = args
        .from_state
        .iter()
        .chain(&args.scenario)
        .cloned()
        .collect();
    let metadata = args.metadata();
    let outputs = args.outputs(metadata.as_deref());
    let built = args.wiring.build(&args.overwrite, &read, &outputs)?;
    let (done, built) = simulated(&args, built)?;
    let summary = Summary {
        args: &args,
        files: &built.files,
        done: &done,
    };
    if let Some(path) = &args.report {
        overwrite::save(path, summary.page()?)?;
    }
    if let Some(path) = args.metadata() {
        overwrite::save(&path, metadata::of(&args.output, &done.signals))?;
    }
    let words = match args.json {
        true => format!("{:#}\n", summary.to_json()),
        false => summary.to_text(),
    };
    match args.live.stream {
        // There are the rows.
        true => terminal::eprint(&words),
        false => terminal::print(&words)?,
    }
    if let Some(message) = &done.ending.message {
        terminal::say(done.ending.severity, message);
    }
    if !(args.allow_nan || done.not_finite.is_none()) {
        for words in done.not_finite.words() {
            terminal::say("error", &words);
        }
        terminal::say(
            "hint",
            "look for what computes it; --allow-nan takes such results",
        );
    }
    let outcome = done.outcome(&args);
    end(done.run.components, outcome);
    Ok(outcome)
}

/// A run whose rows are saved.
pub struct Simulated {
    pub algorithm: Algorithm,
    pub clock: Clock,
    pub run: Run,
    pub ending: ending::Words,
    /// Wall-clock time \[s\].
    pub seconds: f64,
    /// Number of recorded rows.
    pub rows: u64,
    /// Recorded signals.
    pub signals: Vec<Signal>,
    /// Connections whose values are converted: output, its unit, input, its unit.
    pub converted: Vec<[String; 4]>,
    pub notes: Vec<String>,
    /// Of a run that is paced by the clock.
    pub deadlines: Option<Deadlines>,
    /// What came from outside and went there.
    pub traffic: Option<Traffic>,
    /// Signals of the result with NaN or infinite values.
    pub not_finite: NotFinite,
}

impl Simulated {
    fn outcome(&self, args: &Args) -> Outcome {
        let is_taken = args.allow_nan || self.not_finite.is_none();
        match self.run.ending {
            Ending::Completed | Ending::EndRequested { .. } if is_taken => Outcome::Done,
            Ending::Completed | Ending::EndRequested { .. } => Outcome::No,
            Ending::Stopped { .. } | Ending::Discarded { .. } | Ending::Failed { .. } => {
                Outcome::No
            }
        }
    }
}

/// Simulates a system and saves its rows; gives what is left of what was built.
fn simulated(args: &Args, mut built: Built) -> Result<(Simulated, Built), Failure> {
    let mut system = std::mem::take(&mut built.system);
    let before = args.from_state.as_deref().map(state::Read::new);
    let before = before.transpose()?;
    let (clock, assumed) = match &before {
        Some(before) => (before.clock(args.times.stop_time)?, None),
        None => args.times.clock(&system, built.description.experiment)?,
    };
    let scenario = args.scenario.as_deref().map(scenario::Read::new);
    let mut scenario = scenario.transpose()?.unwrap_or_default();
    scenario.add_live(args.live.inputs(), clock.start());
    let first = before.as_ref().map_or(0, |own| own.state.step());
    let every = args.rows_between(&clock)?;
    let mut coupling = args.coupling.coupling(&clock)?;
    let run_of = |coupling| state::Of::run(args, &built, &clock, coupling, &scenario.scenario);
    if let Some(before) = &before {
        before.check(&run_of(coupling)?)?;
    }
    let saves = match args.save_state.is_empty() {
        true => None,
        false => Some(state::Saves::new(args, run_of(coupling)?, &clock, first)?),
    };
    coupling.measure |= args.report.is_some();
    if coupling.parallel {
        super::start_threads()?;
    }
    args.coupling.apply_parts(&mut system)?;
    let selection = args.selection(&mut system, &built.tables)?;
    let notes = built.tables.iter().flat_map(|table| table.notes(&clock));
    let notes = (built.notes.iter().cloned().chain(notes))
        .chain(unfed(&system, args.live.inputs()))
        .chain(system.limitations())
        .chain(assumed);
    let notes = notes.collect();
    let converted = system.converted();
    let triggers = scenario.apply(&mut system)?;
    interrupt::listen("stopping after this step")?;

    let ends = args.live.open()?;
    let mut sink = Rows::open(&args.output, clock.steps() / every + 2)?;
    let mut finite = Finite::new(sink.recorder());
    let times = [clock.step() * every as f64, clock.stop()];
    let waits = args.real_time.is_none();
    let mut live = Live::new(&mut finite, ends, triggers.inlets(), waits, times);
    let mut thinned = Thinned::new(&mut live, selection, every).after(first);
    let mut watch = Watch::new(&mut thinned, args.progress, &clock);
    let mut conditions = triggers.over(&mut watch);
    let mut pace = Pace::new(&mut conditions, args.real_time);
    let checkpoints = Checkpoints {
        from: before.map(|before| before.state),
        at: saves.as_ref().map_or(Vec::new(), |own| own.at.clone()),
        at_end: saves.as_ref().is_some_and(state::Saves::has_end),
        keep: Some(&mut |which, state| saves.as_ref().map_or(Ok(()), |own| own.keep(which, state))),
    };
    let tolerance = args.coupling.component_tolerance();
    let run =
        crate::cosim::run_between(system, &clock, tolerance, coupling, &mut pace, checkpoints);
    let deadlines = pace.deadlines;
    // An FMU may have changed the working folder.
    atomic_file::go_back();
    let run = match run {
        Ok(run) => run,
        Err(error) => {
            watch.end("failed", clock.start(), None);
            return Err(sink.explain(error, &built.description));
        }
    };
    let ending = ending::Words::with_rows(&run);
    watch.end(ending.status, run.time, Some(report::to_json(&run.report)));
    let seconds = watch.elapsed().as_secs_f64();
    let Thinned { signals, rows, .. } = thinned;
    let traffic = live.traffic();
    let not_finite = finite.finish();
    sink.save(&args.output)?;
    let done = Simulated {
        algorithm: coupling.algorithm,
        clock,
        run,
        ending,
        seconds,
        rows,
        signals,
        converted,
        notes,
        deadlines,
        traffic,
        not_finite,
    };
    Ok((done, built))
}

/// Terminates and frees the components after all results are reported: a failure here causes only a warning.
pub fn end(mut components: Components, outcome: Outcome) {
    pilotage_process::finished(outcome.code());
    if let Some(Ending::Failed {
        instance,
        stage,
        source,
        ..
    }) = components.terminate()
    {
        let why = error_chain(source.as_ref());
        terminal::say(
            "warning",
            &format!("`{instance}` failed to {stage}, after the run: {why}"),
        );
    }
}

impl Args {
    /// Parses arguments; the first word is the command name used in messages. Ends the process if they ask for help.
    pub fn of(words: &[OsString]) -> Result<Self, Failure> {
        #[derive(clap::Parser)]
        struct Line {
            #[command(flatten)]
            args: Args,
        }
        let refused = |error: clap::Error| {
            if !error.use_stderr() {
                // Help that was asked for.
                error.exit();
            }
            let text = error.to_string();
            let text = text.strip_prefix("error: ").unwrap_or(&text);
            let (message, below) = text.split_once('\n').unwrap_or((text, ""));
            Failure::new(message).below(below)
        };
        Ok(Line::try_parse_from(words).map_err(refused)?.args)
    }

    fn check_report(&self) -> Result<(), Failure> {
        let result = self.output.as_path();
        if self.report.is_some() && call::is_on() {
            let message = "--report draws a result in a file, and here it stays in memory";
            return Err(Failure::new(message).hint("leave it out"));
        }
        if self.report.is_some() && result.exists() && !result.is_file() {
            let message = format!(
                "--report draws what the result holds, and nothing can be read back from {}",
                result.display()
            );
            return Err(Failure::new(message).hint("give the result a file with -o"));
        }
        Ok(())
    }

    /// The side file with units and descriptions.
    fn metadata(&self) -> Option<PathBuf> {
        let has_own = call::is_on() || overwrite::is_parquet(&self.output);
        (self.metadata && !has_own).then(|| metadata::beside(&self.output))
    }

    /// The output files.
    fn outputs<'a>(&'a self, metadata: Option<&'a Path>) -> Vec<(&'a Path, OutputKind)> {
        let page = self.report.as_deref().map(|path| (path, OutputKind::Page));
        // Who calls the command takes the rows from memory.
        let result = (!call::is_on()).then_some((self.output.as_path(), OutputKind::Result));
        let states = self.save_state.iter();
        let states = states.map(|own| (own.file.as_path(), OutputKind::State));
        let metadata = metadata.map(|path| (path, OutputKind::Metadata));
        (result.into_iter().chain(metadata))
            .chain(page)
            .chain(states)
            .collect()
    }

    /// Number of communication steps between two recorded rows.
    fn rows_between(&self, clock: &Clock) -> Result<u64, Failure> {
        let Some(interval) = self.record_every else {
            return Ok(1);
        };
        let ratio = interval / clock.step();
        let whole = ratio.round();
        match whole >= 1.0 && (ratio - whole).abs() <= 1e-9 * ratio {
            true => Ok(whole as u64),
            false => Err(Failure::new(format!(
                "--record-every {interval} s is no multiple of the step of {} s",
                clock.step()
            ))),
        }
    }

    /// The signals to record; `None` for every output.
    fn selection(
        &self,
        system: &mut System,
        tables: &[InputTable],
    ) -> Result<Option<Selection>, Failure> {
        if !self.record.is_empty() {
            let patterns: Vec<String> = self.record.iter().flat_map(|own| patterns(own)).collect();
            return Ok(Some(Selection::new(system, &patterns)?));
        }
        let names: Vec<String> = tables.iter().map(|table| table.name.clone()).collect();
        Ok((!names.is_empty()).then(|| Selection::without(system, &names)))
    }
}

/// The patterns of a list, separated by commas, of which those in brackets belong to names: `a.x,a.m[1,2]`.
pub fn patterns(list: &str) -> Vec<String> {
    let mut all = vec![String::new()];
    let mut depth = 0;
    for sign in list.chars() {
        depth += i32::from(sign == '[') - i32::from(sign == ']' && depth > 0);
        match sign {
            ',' if depth == 0 => all.push(String::new()),
            _ => all.last_mut().expect("one at least").push(sign),
        }
    }
    all
}

fn unfed(system: &System, live: &[String]) -> impl Iterator<Item = String> + use<> {
    let live = live
        .iter()
        .map(|name| full_name(system, name, only(system)));
    let live: Vec<String> = live.collect();
    let open = system.open_inputs().into_iter();
    let open = open.filter(move |input| !live.contains(input));
    open.map(|input| format!("nothing feeds `{input}`; it keeps its start value"))
}
