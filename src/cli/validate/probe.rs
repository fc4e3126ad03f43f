//! Tests of the binary in separate processes, one for each check, so that a crash affects only one check.

use super::text::{finding_from_json, finding_to_json};
use crate::cli::progress::Spinner;
use crate::cli::{Failure, Outcome, terminal};
use crate::error_chain::error_chain;
use crate::fmi::archive::{ArchiveError, Unpacked};
use crate::fmi::description::{ModelDescription, Severity};
use crate::fmi::{Fmu, FmuError};
use crate::fmi_check::Finding;
use crate::fmi_check::behaviour::{self, BehaviourCheck, Report, What};
use pilotage_process::{Child, Ended, program};
use serde_json::{Value, json};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Arguments of the hidden `pilotage probe`.
#[derive(Debug, clap::Args)]
pub struct ProbeArgs {
    /// The FMU.
    fmu: PathBuf,
    /// What to try, for example cs:simulate.
    #[arg(long)]
    check: BehaviourCheck,
    /// Where it is unpacked.
    #[arg(long)]
    unpacked: Option<PathBuf>,
}

/// FMUs with more entries than this are unpacked once for all checks; others for each check, so that no check sees
/// changes made by another.
const MANY: usize = 1000;

/// Runs the hidden command: records each stage before it begins, since a binary may end the process, and each finding.
/// Records are JSON objects in shared memory, which an FMU cannot close or print into.
pub fn probe(args: ProbeArgs) -> Result<Outcome, Failure> {
    let ours = behaviour::run(&args.fmu, args.unpacked, args.check, &mut |report| {
        write_record(&match report {
            Report::Stage(stage) => json!({ "stage": stage }),
            Report::Finding(finding) => json!({ "finding": finding_to_json(&finding) }),
        });
    });
    if let Err(trouble) = ours {
        write_record(&json!({ "trouble": error_chain(&trouble) }));
    }
    Ok(Outcome::Done)
}

/// Passes a line to the supervising process, or prints it if there is none (manual use, as under a debugger).
fn write_record(line: &Value) {
    match pilotage_process::is_attached() {
        true => pilotage_process::record(&line.to_string()),
        false => drop(terminal::print(&format!("{line}\n"))),
    }
}

/// Results of the tests of a binary.
pub(super) struct Tried {
    /// The findings without duplicates.
    pub findings: Vec<Finding>,
    /// Whether it could be loaded here, so that the other tests were run.
    pub is_loaded: bool,
}

/// Runs all tests.
pub(super) fn try_all(
    path: &Path,
    description: &ModelDescription,
    limit: Duration,
) -> Result<Tried, Failure> {
    let mut findings: Vec<Finding> = Vec::new();
    let mut is_loaded = true;
    let progress = Spinner::new(format!("{}: unpacking", path.display()));
    let unpacked = unpacked(path)?;
    for check in behaviour::all(description) {
        progress.show(format!("{}: {check}", path.display()));
        let found = try_one((path, unpacked.as_ref()), description, check, limit)?;
        // Warnings of the load check concern a library that was loaded.
        let ends = |f: &Finding| f.severity != Severity::Warning;
        if check.what == What::Load && found.iter().any(ends) {
            is_loaded = false;
        }
        for finding in found {
            if !findings.contains(&finding) {
                findings.push(finding);
            }
        }
        // A library that cannot be loaded cannot be tested further.
        if !is_loaded {
            break;
        }
    }
    Ok(Tried {
        findings,
        is_loaded,
    })
}

/// Unpacks an FMU with many files; `None` for others.
fn unpacked(path: &Path) -> Result<Option<Unpacked>, Failure> {
    let Ok(mut fmu) = Fmu::open(path) else {
        // The first check reports why.
        return Ok(None);
    };
    match fmu.entries() > MANY {
        true => match fmu.unpack() {
            Err(FmuError::Archive(ArchiveError::Write { path, source })) => {
                let failure = Failure::cannot_write(&path, &source);
                Err(failure.hint("this is no fault of the FMU"))
            }
            unpacked => Ok(unpacked.ok()),
        },
        false => Ok(None),
    }
}

/// Runs one check in a separate process.
fn try_one(
    (path, unpacked): (&Path, Option<&Unpacked>),
    description: &ModelDescription,
    check: BehaviourCheck,
    limit: Duration,
) -> Result<Vec<Finding>, Failure> {
    let failed = |error: std::io::Error| {
        Failure::new(format!(
            "cannot start a process to try {}: {error}",
            path.display()
        ))
    };
    let mut command = program::command().map_err(failed)?;
    command.args(["probe", "--check", &check.to_string()]);
    if let Some(unpacked) = unpacked {
        command.arg("--unpacked").arg(unpacked.path());
    }
    command
        .arg("--")
        .arg(path)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    let mut child = Child::start(command, true).map_err(failed)?;
    // Read concurrently: an FMU with much output must not block on a full pipe.
    let noise = child.process().stderr.take().map(Tail::of);
    let ended = child
        .wait(Some(limit), AFTERWARDS, |_| {})
        .map_err(failed)?;
    let (records, lost) = child.page().records();
    let mut findings = Vec::new();
    let mut stage = "starting".to_owned();
    for value in records
        .iter()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
    {
        if let Some(text) = value["stage"].as_str() {
            stage = text.to_owned();
        }
        if let Some(trouble) = value["trouble"].as_str() {
            return Err(Failure::new(trouble).hint("this is no fault of the FMU"));
        }
        findings.extend(finding_from_json(&value["finding"]));
    }
    let mut find = |severity, what| {
        findings.push(Finding::behaviour(description, check.kind, severity, what));
    };
    if lost > 0 {
        find(
            Severity::Note,
            format!("there is no room for {lost} more findings of {check}"),
        );
    }
    if let Some(why) = ended_badly(ended, limit, noise) {
        let severity = behaviour::severity_of_crash(&stage);
        find(severity, format!("{why} while {stage}"));
    }
    Ok(findings)
}

/// Maximum time for the process to end after its last record.
const AFTERWARDS: Duration = Duration::from_secs(2);

/// The last output of a process to a pipe.
struct Tail {
    last: Arc<Mutex<Vec<u8>>>,
    /// None where no thread could be had for it: then nothing is kept.
    reader: Option<thread::JoinHandle<()>>,
}

impl Tail {
    /// Number of bytes kept \[bytes\].
    const KEPT: usize = 4096;

    fn of(mut from: impl Read + Send + 'static) -> Self {
        let last = Arc::new(Mutex::new(Vec::new()));
        let kept = last.clone();
        let reader = thread::Builder::new().spawn(move || {
            let mut room = vec![0; 1 << 16];
            while let Ok(n @ 1..) = from.read(&mut room) {
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend_from_slice(&room[..n]);
                let beyond = kept.len().saturating_sub(Self::KEPT);
                kept.drain(..beyond);
            }
        });
        Self {
            last,
            reader: reader.ok(),
        }
    }

    /// The last non-empty line. A process outside the group may keep the pipe open, so the wait is short.
    fn line(self) -> Option<String> {
        let begun = Instant::now();
        let is_reading = || self.reader.as_ref().is_some_and(|own| !own.is_finished());
        while is_reading() && begun.elapsed() < Duration::from_millis(200) {
            thread::sleep(Duration::from_millis(1));
        }
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let text = String::from_utf8_lossy(&last);
        let mut lines = text.lines().rev().filter(|line| !line.trim().is_empty());
        lines.next().map(str::to_owned)
    }
}

/// Why the process ended, if it did not end normally.
fn ended_badly(ended: Ended, limit: Duration, noise: Option<Tail>) -> Option<String> {
    let early = |status: ExitStatus| {
        let last_line = noise.and_then(Tail::line);
        let last_line = last_line.map(|line| format!(", saying {line:?},"));
        format!(
            "it ended the process ({status}){}",
            last_line.unwrap_or_default()
        )
    };
    match ended {
        Ended::Late => Some(format!(
            "it did not come back within {} s",
            limit.as_secs_f64()
        )),
        Ended::Early(status) => Some(early(status)),
        Ended::Done { badly: None, .. } => None,
        Ended::Done {
            badly: Some(Some(status)),
            ..
        } => Some(format!("{} after everything was done,", early(status))),
        Ended::Done {
            badly: Some(None), ..
        } => Some(format!(
            "it kept the process from ending for {} s",
            AFTERWARDS.as_secs()
        )),
    }
}
