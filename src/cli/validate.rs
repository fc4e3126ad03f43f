//! `pilotage validate`: FMUs against the standard, and a short try of each.
//!
//! The binary is tried in a process of its own, so that one that crashes is a finding and not the end.

use super::{Failure, Outcome, terminal};
use crate::fmi::archive::{Archive, ArchiveError, DESCRIPTION, Limits};
use crate::fmi::description::{BaseType, Causality, Finding, Precision, Severity, read, validate};
use crate::fmi::{Fmu, Step};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Arguments of `pilotage validate`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  pilotage validate pilot.fmu quadcopter.fmu\n\nExit codes: 0 every FMU is valid (there may be warnings), 1 one is not, 2 bad use or input."
)]
pub struct Args {
    /// The FMUs.
    #[arg(required = true)]
    fmus: Vec<PathBuf>,
    /// Check the files only, do not run the binaries.
    #[arg(long)]
    no_run: bool,
    /// Print one JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// Arguments of the hidden `pilotage probe`.
#[derive(Debug, clap::Args)]
pub struct ProbeArgs {
    /// The FMU.
    fmu: PathBuf,
}

/// What was found in one FMU.
pub(super) struct Report {
    path: PathBuf,
    /// Why the archive or the description cannot be read at all.
    unreadable: Option<String>,
    findings: Vec<Finding>,
    /// What was tried with the binary; `None` if it was not.
    trial: Option<Trial>,
}

/// What was tried with the binary.
struct Trial {
    warnings: Vec<String>,
    error: Option<String>,
}

impl Report {
    /// True when nothing at all was found.
    pub(super) fn is_clean(&self) -> bool {
        let has_warning = self.trial.as_ref().is_some_and(|t| !t.warnings.is_empty());
        self.is_valid() && self.findings.is_empty() && !has_warning
    }

    /// True when nothing but warnings was found.
    pub(super) fn is_valid(&self) -> bool {
        let has_error = self
            .findings
            .iter()
            .any(|f| f.severity() == Severity::Error);
        let has_failed = self.trial.as_ref().is_some_and(|t| t.error.is_some());
        self.unreadable.is_none() && !has_error && !has_failed
    }
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let reports = (args.fmus.iter())
        .map(|path| check(path, !args.no_run))
        .collect::<Result<Vec<Report>, Failure>>()?;
    let text = match args.json {
        true => format!(
            "{:#}\n",
            json!({ "fmus": reports.iter().map(to_json).collect::<Vec<_>>() })
        ),
        false => reports.iter().map(to_text).collect(),
    };
    terminal::print(&text)?;
    Ok(match reports.iter().all(Report::is_valid) {
        true => Outcome::Done,
        false => Outcome::No,
    })
}

/// Checks one FMU; `may_run` says whether its binary is tried.
pub(super) fn check(path: &Path, may_run: bool) -> Result<Report, Failure> {
    let mut report = Report {
        path: path.to_owned(),
        unreadable: None,
        findings: Vec::new(),
        trial: None,
    };
    let archive = match Archive::open(path, Limits::default()) {
        // Not an FMU that is wrong, but a file that is not there.
        Err(error @ ArchiveError::Open { .. }) => return Err(error.into()),
        Err(error) => Err(Failure::from(error)),
        Ok(mut archive) => archive.read(DESCRIPTION).map_err(Failure::from),
    };
    let reading = archive.and_then(|bytes| read(&bytes).map_err(Failure::from));
    match reading {
        Err(failure) => report.unreadable = Some(failure.message().to_owned()),
        Ok(reading) => {
            report.findings = validate(&reading);
            let can_run = reading.description.co_simulation.is_some();
            let is_usable = reading.into_usable().is_ok();
            if may_run && can_run && is_usable {
                report.trial = Some(try_binary(path)?);
            }
        }
    }
    Ok(report)
}

/// Loads and steps the FMU in a process of its own.
fn try_binary(path: &Path) -> Result<Trial, Failure> {
    let failed = |error: std::io::Error| {
        Failure::new(format!(
            "cannot start a process to try {}: {error}",
            path.display()
        ))
    };
    let program = std::env::current_exe().map_err(failed)?;
    let mut child = Command::new(program)
        .arg("probe")
        .arg(path)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(failed)?;
    let is_in_time = wait(&mut child).map_err(failed)?;
    let output = child.wait_with_output().map_err(failed)?;
    let stdout = String::from_utf8_lossy(&output.stdout);
    let stderr = String::from_utf8_lossy(&output.stderr);
    let with = |prefix: &str| -> Vec<String> {
        let lines = stdout.lines().filter_map(|line| line.strip_prefix(prefix));
        lines.map(str::to_owned).collect()
    };
    let stage = with(STAGE).pop().unwrap_or_else(|| "starting".to_owned());
    let error = match (is_in_time, output.status.code()) {
        (false, _) => Some(format!(
            "it did not come back within {LIMIT:?} while {stage}"
        )),
        (true, Some(0)) => None,
        (true, Some(2)) => Some(format!("while {stage}: {}", said(&stderr))),
        (true, _) => Some(format!(
            "it ended the process ({}) while {stage}",
            output.status
        )),
    };
    let warnings = with(WARNING);
    Ok(Trial { warnings, error })
}

/// Longest time that a trial may take.
const LIMIT: Duration = Duration::from_secs(60);

/// Waits for a process; kills it if it takes too long.
fn wait(child: &mut Child) -> std::io::Result<bool> {
    let started = Instant::now();
    while child.try_wait()?.is_none() {
        if started.elapsed() > LIMIT {
            child.kill()?;
            return Ok(false);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(true)
}

/// The message of a failure that the probe printed.
fn said(stderr: &str) -> &str {
    let line = stderr
        .lines()
        .rev()
        .find_map(|line| line.strip_prefix("error: "));
    line.unwrap_or(stderr.trim())
}

/// How the probe's lines begin.
const STAGE: &str = "stage: ";
const WARNING: &str = "warning: ";

/// Runs the hidden command: tells each stage before it begins, since a binary may end the process.
pub fn probe(args: ProbeArgs) -> Result<Outcome, Failure> {
    let stage = |text: &str| terminal::print(&format!("{STAGE}{text}\n"));
    let warn = |text: &str| terminal::print(&format!("{WARNING}{text}\n"));
    stage("opening")?;
    let mut fmu = Fmu::open(&args.fmu)?;
    stage("loading")?;
    let library = fmu.load()?;
    if let Some(unresolved) = library.binding().unresolved() {
        warn(&format!(
            "a symbol is missing, calling it would end the process: {unresolved}"
        ))?;
    }
    for function in library.binding().missing() {
        warn(&format!("the binary has no function `{function}`"))?;
    }
    stage("instantiating")?;
    let mut instance = library.instantiate("probe")?;
    let description = fmu.description();
    let cs = description.co_simulation.as_ref();
    if !cs.is_some_and(|cs| cs.can_be_instantiated_only_once_per_process) {
        stage("instantiating with a wrong guid")?;
        if library.accepts_wrong_guid() {
            warn("an instance is made though the guid is wrong")?;
        }
    }
    let experiment = description.default_experiment.unwrap_or_default();
    let start = experiment.start_time.unwrap_or(0.0);
    let stop = experiment
        .stop_time
        .filter(|&stop| stop > start)
        .unwrap_or(start + 1.0);
    let step = experiment
        .step_size
        .filter(|&h| h > 0.0)
        .unwrap_or((stop - start) / 100.0);
    let outputs: Vec<u32> = (description.variables.iter())
        .filter(|v| {
            v.causality == Causality::Output
                && v.kind.base_type() == BaseType::Real(Precision::Double)
        })
        .map(|v| v.value_reference)
        .collect();
    let mut values = vec![0.0; outputs.len()];
    stage("initializing")?;
    instance.setup_experiment(experiment.tolerance, start, stop)?;
    instance.enter_initialization_mode()?;
    instance.exit_initialization_mode()?;
    stage("reading the outputs")?;
    instance.get_real(&outputs, &mut values)?;
    stage("stepping")?;
    if instance.do_step(start, step)? != Step::Done {
        warn(&format!("the first step of {step} s was discarded"))?;
    }
    instance.get_real(&outputs, &mut values)?;
    stage("terminating")?;
    instance.terminate()?;
    drop(instance);
    drop(library);
    Ok(Outcome::Done)
}

fn to_json(report: &Report) -> Value {
    let findings: Vec<Value> = (report.findings.iter())
        .map(|finding| {
            json!({
                "severity": finding.severity().to_string(),
                "line": finding.place.line,
                "column": finding.place.column,
                "variable": finding.variable,
                "message": finding.rule.to_string(),
                "section": finding.section(),
            })
        })
        .collect();
    json!({
        "file": report.path.display().to_string(),
        "valid": report.is_valid(),
        "unreadable": report.unreadable,
        "findings": findings,
        "run": report.trial.as_ref().map(|t| json!({ "warnings": t.warnings, "error": t.error })),
    })
}

/// The findings in words.
pub(super) fn to_text(report: &Report) -> String {
    let mut lines = Vec::new();
    lines.extend(report.unreadable.iter().map(|why| format!("error: {why}")));
    for finding in &report.findings {
        let variable = finding.variable.as_ref();
        let variable = variable.map(|name| format!(" (variable `{name}`)"));
        lines.push(format!("{finding}{}", variable.unwrap_or_default()));
    }
    if let Some(trial) = &report.trial {
        lines.extend(
            trial
                .warnings
                .iter()
                .map(|text| format!("warning: binary: {text}")),
        );
        lines.extend(
            trial
                .error
                .iter()
                .map(|text| format!("error: binary: {text}")),
        );
    }
    let verdict = match (report.is_valid(), &report.trial) {
        (true, Some(_)) => "valid, and runs",
        (true, None) => "valid; not run",
        (false, _) => "not valid",
    };
    let mut text = format!("{}: {verdict}\n", report.path.display());
    for line in lines {
        text += &format!("  {line}\n");
    }
    text
}
