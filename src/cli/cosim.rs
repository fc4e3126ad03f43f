//! `pilotage cosim`: FMUs wired together and simulated.

use super::cosim_report as report;
use super::{Failure, Outcome, terminal};
use crate::cosim::recorder::Signal;
use crate::cosim::{
    Algorithm, Clock, Control, Coupling, CsvRecorder, Ending, MasterError, Recorder, Run, System,
    fmu_slave,
};
use crate::fmi::Kind;
use crate::output::Output;
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::json;
use std::error::Error;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const EXAMPLES: &str = "\
Examples:
  # The pilot flies the quadcopter to 10 m.
  pilotage cosim pilot.fmu quadcopter.fmu \\
    --connect pilot.stick=quadcopter.stick --connect quadcopter.z=pilot.position \\
    --set pilot.target=10 --stop-time 15 --step 0.05 -o result.csv

  # Two pilots of one file, by names of their own.
  pilotage cosim left=pilot.fmu right=pilot.fmu --stop-time 1 --step 0.1

The result has a column `time` and a column `instance.variable` for every output.
Exit codes: 0 done, 1 an FMU failed on the way (the rows until then are kept), 2 bad use or input.";

/// Arguments of `pilotage cosim`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// FMUs; an instance is named after its file unless NAME= says otherwise.
    #[arg(required = true, value_name = "[NAME=]FMU")]
    fmus: Vec<String>,
    /// Wire an output to an input; may be given many times.
    #[arg(long, value_name = "INSTANCE.OUTPUT=INSTANCE.INPUT", value_parser = pair)]
    connect: Vec<(String, String)>,
    /// Give a parameter or an unconnected input its value; may be given many times.
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE", value_parser = pair)]
    set: Vec<(String, String)>,
    /// Start time [s].
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    start_time: f64,
    /// Stop time [s].
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    stop_time: f64,
    /// Communication step [s]; must divide the duration.
    #[arg(long, value_name = "SECONDS")]
    step: f64,
    /// How the FMUs exchange values.
    #[arg(long, value_enum, default_value_t)]
    algorithm: AlgorithmName,
    /// What FMUs that can be both are used for [default: cs].
    #[arg(long, value_enum)]
    kind: Option<KindName>,
    /// Degree of the polynomials that stand for outputs not known yet [default: 0, values are held].
    #[arg(long, value_name = "0..2", value_parser = clap::value_parser!(u8).range(0..=2))]
    extrapolation: Option<u8>,
    /// Choose the communication steps so that no input is wrong by more than this, relative to its
    /// magnitude; every multiple of --step is hit. FMUs must be able to go back (canGetAndSetFMUstate)
    /// for a step to be repeated.
    #[arg(long, value_name = "NUMBER", value_parser = positive)]
    tolerance: Option<f64>,
    /// Shortest communication step with --tolerance [s] [default: a billionth of --step].
    #[arg(long, value_name = "SECONDS", value_parser = positive, requires = "tolerance")]
    min_step: Option<f64>,
    /// Longest communication step with --tolerance [s] [default: --step].
    #[arg(long, value_name = "SECONDS", value_parser = positive, requires = "tolerance")]
    max_step: Option<f64>,
    /// Relative tolerance for FMUs with error control of their own [default: a tenth of --tolerance,
    /// else each FMU's own].
    #[arg(long, value_name = "NUMBER", value_parser = positive)]
    fmu_tolerance: Option<f64>,
    /// Have an FMU take every communication step in that many equal parts; may be given many times.
    #[arg(long, value_name = "INSTANCE=N", value_parser = pair)]
    parts: Vec<(String, String)>,
    /// Measure and show coupling errors, calls and times.
    #[arg(long)]
    report: bool,
    /// Where the result goes (CSV).
    #[arg(short, long, value_name = "FILE", default_value = "result.csv")]
    output: PathBuf,
    /// Print one JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// [`Algorithm`] by name.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
enum AlgorithmName {
    /// All FMUs get the others' outputs at the begin of the step, then all step.
    #[default]
    Jacobi,
    /// One FMU after another, in the order of their dependencies, each with the newest values.
    GaussSeidel,
    /// Steps are repeated from saved states until the outputs at their ends fit the inputs: no lag,
    /// second order.
    Strong,
}

/// [`Kind`] by name.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum KindName {
    /// Co-simulation: the FMU brings its own solver.
    Cs,
    /// Model exchange: the FMU's equations are solved here, with error control and events.
    Me,
}

impl From<KindName> for Kind {
    fn from(name: KindName) -> Self {
        match name {
            KindName::Cs => Self::CoSimulation,
            KindName::Me => Self::ModelExchange,
        }
    }
}

/// `a=b`, split at the first `=`.
fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((left, right)) if !left.is_empty() => Ok((left.to_owned(), right.to_owned())),
        _ => Err("expected two parts with `=` between them".to_owned()),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a positive number".to_owned()),
    }
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let clock = Clock::new(args.start_time, args.stop_time, args.step)?;
    let algorithm = match args.algorithm {
        AlgorithmName::Jacobi => Algorithm::Jacobi,
        AlgorithmName::GaussSeidel => Algorithm::GaussSeidel,
        AlgorithmName::Strong => Algorithm::Strong,
    };
    let coupling = Coupling {
        extrapolation: args.extrapolation.map(usize::from),
        control: args.tolerance.map(|tolerance| {
            let control = Control::new(tolerance, &clock);
            Control {
                min_step: args.min_step.unwrap_or(control.min_step),
                max_step: args.max_step.unwrap_or(control.max_step),
                ..control
            }
        }),
        measure: args.report,
        ..algorithm.into()
    };
    let fmu_tolerance = args.fmu_tolerance.or(args.tolerance.map(|t| 0.1 * t));
    let system = build(&args)?;
    let output = Output::create(&args.output).map_err(|error| {
        Failure::new(format!("cannot write {}: {error}", args.output.display()))
    })?;
    let open_inputs = system.open_inputs();
    let converted = system.converted();
    let started = Instant::now();
    let mut recorder = WithProgress::new(CsvRecorder::new(BufWriter::new(output)), clock.steps());
    let run = crate::cosim::run(system, &clock, fmu_tolerance, coupling, &mut recorder);
    recorder.bar.finish_and_clear();
    let run = run.map_err(|error| explain(error, &args.output))?;
    save(recorder.inner, &args.output)?;
    let ending = describe(&run);
    let text = match args.json {
        true => format!(
            "{:#}\n",
            to_json(
                &args,
                algorithm,
                &run,
                started.elapsed(),
                &ending,
                &converted
            )
        ),
        false => to_text(&args, algorithm, &run, &open_inputs, &converted),
    };
    terminal::print(&text)?;
    if let Some(message) = ending.message {
        eprintln!("{}: {message}", ending.severity);
    }
    Ok(match run.ending {
        Ending::Completed | Ending::EndRequested { .. } => Outcome::Done,
        Ending::Discarded { .. } | Ending::Failed { .. } => Outcome::No,
    })
}

/// Opens all FMUs and wires them.
fn build(args: &Args) -> Result<System, Failure> {
    let mut system = System::new();
    for argument in &args.fmus {
        let (name, file) = instance(argument);
        system.add(
            &name,
            fmu_slave::open(&file, &name, args.kind.map(Kind::from))?,
        )?;
    }
    for (from, to) in &args.connect {
        system.connect(from, to)?;
    }
    for (name, value) in &args.set {
        system.set(name, value)?;
    }
    for (name, parts) in &args.parts {
        let parts = parts.parse().map_err(|_| {
            Failure::new(format!(
                "--parts {name}={parts}: `{parts}` is no whole number"
            ))
        })?;
        system.set_parts(name, parts)?;
    }
    Ok(system)
}

/// Name and file of `NAME=FILE` or `FILE`; a file whose own name has a `=` is a file.
fn instance(argument: &str) -> (String, PathBuf) {
    let path = Path::new(argument);
    match argument.split_once('=') {
        Some((name, file)) if !path.exists() => (name.to_owned(), PathBuf::from(file)),
        _ => {
            let stem = path
                .file_stem()
                .map(|stem| stem.to_string_lossy().into_owned());
            (stem.unwrap_or_default(), path.to_owned())
        }
    }
}

fn save(recorder: CsvRecorder<BufWriter<Output>>, path: &Path) -> Result<(), Failure> {
    let failed = |error| Failure::new(format!("cannot write {}: {error}", path.display()));
    let buffer = recorder.finish().map_err(failed)?;
    let output = buffer
        .into_inner()
        .map_err(|error| failed(error.into_error()))?;
    output.finish().map_err(failed)
}

fn explain(error: MasterError, output: &Path) -> Failure {
    let is_write_error = matches!(error, MasterError::Record { .. });
    let failure = Failure::from(error);
    match is_write_error {
        true => failure.hint(format!("is there room for {}?", output.display())),
        false => failure,
    }
}

/// How a run ended, in words.
struct EndingWords {
    status: &'static str,
    severity: &'static str,
    message: Option<String>,
}

fn describe(run: &Run) -> EndingWords {
    let (status, severity, message) = match &run.ending {
        Ending::Completed => ("completed", "note", None),
        Ending::EndRequested { instance, time } => {
            let message = format!("`{instance}` asked for the end at {time} s");
            ("end-requested", "note", Some(message))
        }
        Ending::Discarded {
            instance,
            time,
            reached,
        } => {
            let message = format!(
                "`{instance}` discarded the step from {time} s, it came to {reached} s; \
                 the rows until {} s are kept",
                run.time
            );
            ("discarded", "error", Some(message))
        }
        Ending::Failed {
            instance,
            time,
            stage,
            source,
        } => {
            let message = format!(
                "`{instance}` failed to {stage} at {time} s: {}; the rows until {} s are kept",
                chain(source.as_ref()),
                run.time
            );
            ("failed", "error", Some(message))
        }
    };
    EndingWords {
        status,
        severity,
        message,
    }
}

/// An error with all that caused it.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        text += &format!(": {cause}");
        next = cause.source();
    }
    text
}

fn to_json(
    args: &Args,
    algorithm: Algorithm,
    run: &Run,
    elapsed: Duration,
    ending: &EndingWords,
    converted: &[[String; 4]],
) -> serde_json::Value {
    let signals: Vec<_> = (run.signals.iter())
        .map(|signal| json!({ "name": signal.name, "unit": signal.unit }))
        .collect();
    let conversions: Vec<_> = (converted.iter())
        .map(|[from, from_unit, to, to_unit]| {
            json!({ "from": from, "fromUnit": from_unit, "to": to, "toUnit": to_unit })
        })
        .collect();
    json!({
        "status": ending.status,
        "message": ending.message,
        "algorithm": algorithm.to_string(),
        "order": run.order,
        "steps": run.steps,
        "step": args.step,
        "report": report::to_json(&run.report),
        "time": run.time,
        "seconds": elapsed.as_secs_f64(),
        "signals": signals,
        "unrecorded": run.unrecorded,
        "conversions": conversions,
        "output": args.output.display().to_string(),
    })
}

fn to_text(
    args: &Args,
    algorithm: Algorithm,
    run: &Run,
    open_inputs: &[String],
    converted: &[[String; 4]],
) -> String {
    let order = match algorithm {
        Algorithm::Jacobi | Algorithm::Strong => String::new(),
        Algorithm::GaussSeidel => format!(", in the order {}", run.order.join(", ")),
    };
    let mut text = format!(
        "{} steps of {} s from {} s to {} s ({algorithm}{order})\n{} rows of {} signals in {}\n",
        run.steps,
        args.step,
        args.start_time,
        run.time,
        run.steps + 1,
        run.signals.len(),
        args.output.display()
    );
    for [from, from_unit, to, to_unit] in converted {
        text += &format!("note: `{from}` [{from_unit}] is converted for `{to}` [{to_unit}]\n");
    }
    for input in open_inputs {
        text += &format!("note: nothing feeds `{input}`; it keeps its start value\n");
    }
    text += &report::to_text(&run.report, args.report);
    for output in &run.unrecorded {
        text += &format!("note: `{output}` is text and not in the table\n");
    }
    text
}

/// A recorder that shows how far the run is, on a terminal and if it takes long.
struct WithProgress<R> {
    inner: R,
    bar: ProgressBar,
    steps: u64,
    rows: u64,
    started: Instant,
}

impl<R> WithProgress<R> {
    fn new(inner: R, steps: u64) -> Self {
        Self {
            inner,
            bar: ProgressBar::hidden(),
            steps,
            rows: 0,
            started: Instant::now(),
        }
    }

    /// Shows the bar when the run has taken longer than patience lasts. indicatif itself shows nothing
    /// where stderr is no terminal.
    fn tick(&mut self) {
        const PATIENCE: Duration = Duration::from_secs(2);
        const ROWS_BETWEEN_LOOKS: u64 = 1024;
        self.rows += 1;
        if !self.rows.is_multiple_of(ROWS_BETWEEN_LOOKS) {
            return;
        }
        if self.bar.is_hidden() && self.started.elapsed() > PATIENCE {
            let target = ProgressDrawTarget::stderr_with_hz(5);
            self.bar = ProgressBar::with_draw_target(Some(self.steps), target);
            let style = ProgressStyle::with_template("{wide_bar} {percent} %, {eta} left");
            self.bar
                .set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        }
        self.bar.set_position(self.rows);
    }
}

impl<R: Recorder> Recorder for WithProgress<R> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        self.inner.begin(signals)
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        self.tick();
        self.inner.row(time, values)
    }
}
