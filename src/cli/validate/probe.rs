//! The binary, tried in processes of its own: one for each check, so that a crash costs one check.

use super::text::{finding_from_json, finding_to_json};
use crate::cli::progress::Spinner;
use crate::cli::{Failure, Outcome, terminal};
use crate::fmi::description::{ModelDescription, Severity};
use crate::fmi_check::Finding;
use crate::fmi_check::behaviour::{self, BehaviourCheck, Told, What};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
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
}

/// Runs the hidden command: tells each stage before it begins, since a binary may end the process, and
/// each finding; one JSON object a line.
pub fn probe(args: ProbeArgs) -> Result<Outcome, Failure> {
    let mut broken = None;
    behaviour::run(&args.fmu, args.check, &mut |told| {
        let line = match told {
            Told::Stage(stage) => json!({ "stage": stage }),
            Told::Finding(finding) => json!({ "finding": finding_to_json(&finding) }),
        };
        // The FMU may have printed, too, without ending its line.
        if let Err(failure) = terminal::print(&format!("\n{line}\n")) {
            broken.get_or_insert(failure);
        }
    });
    match broken {
        Some(failure) => Err(failure),
        None => Ok(Outcome::Done),
    }
}

/// What came of trying a binary.
pub(super) struct Tried {
    /// The findings, each once.
    pub findings: Vec<Finding>,
    /// Whether it could be loaded here, so that the rest was tried.
    pub is_loaded: bool,
}

/// Tries everything.
pub(super) fn try_all(
    path: &Path,
    description: &ModelDescription,
    limit: Duration,
) -> Result<Tried, Failure> {
    let mut findings: Vec<Finding> = Vec::new();
    let mut is_loaded = true;
    let mut progress = Spinner::new();
    for check in behaviour::all(description) {
        progress.show(format!("{}: {check}", path.display()));
        let found = try_one(path, description, check, limit)?;
        // A warning of that check is about a library that was loaded.
        let ends = |f: &Finding| f.severity != Severity::Warning;
        if check.what == What::Load && found.iter().any(ends) {
            is_loaded = false;
        }
        for finding in found {
            if !findings.contains(&finding) {
                findings.push(finding);
            }
        }
        // What cannot be loaded cannot be tried any further.
        if !is_loaded {
            break;
        }
    }
    progress.clear();
    Ok(Tried {
        findings,
        is_loaded,
    })
}

/// One check in a process of its own.
fn try_one(
    path: &Path,
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
    let program = std::env::current_exe().map_err(failed)?;
    let mut child = Command::new(program)
        .arg("probe")
        .arg(path)
        .args(["--check", &check.to_string()])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(failed)?;
    // Read while it runs: a chatty FMU must not fill the pipe and wait.
    let said = child
        .stdout
        .take()
        .map(|from| thread::spawn(|| lines(from)));
    let noise = child
        .stderr
        .take()
        .map(|from| thread::spawn(|| lines(from)));
    let status = wait(&mut child, limit).map_err(failed)?;
    // A grandchild may keep the pipe open after a kill; then what was said is not waited for.
    let collect = |thread: Option<thread::JoinHandle<Vec<String>>>| {
        thread.and_then(|t| t.join().ok()).unwrap_or_default()
    };
    let (said, noise) = (collect(said), collect(noise));
    let mut findings = Vec::new();
    let mut stage = "starting".to_owned();
    for value in said
        .iter()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
    {
        if let Some(text) = value["stage"].as_str() {
            stage = text.to_owned();
        }
        findings.extend(finding_from_json(&value["finding"]));
    }
    if let Some(why) = ended_badly(status, &noise, limit) {
        findings.push(Finding::behaviour(
            description,
            check.kind,
            behaviour::severity_of_crash(&stage),
            format!("{why} while {stage}"),
        ));
    }
    Ok(findings)
}

fn lines(from: impl Read) -> Vec<String> {
    BufReader::new(from).lines().map_while(Result::ok).collect()
}

/// Why the process ended, if it did not end by itself.
fn ended_badly(status: Option<ExitStatus>, noise: &[String], limit: Duration) -> Option<String> {
    match status {
        None => Some(format!(
            "it did not come back within {} s",
            limit.as_secs_f64()
        )),
        Some(status) if status.success() => None,
        Some(status) => {
            let last = noise.iter().rev().find(|line| !line.trim().is_empty());
            let said = last.map(|line| format!(", saying {line:?},"));
            Some(format!(
                "it ended the process ({status}){}",
                said.unwrap_or_default()
            ))
        }
    }
}

/// Waits for a process; kills it if it takes too long, and then gives no status.
fn wait(child: &mut Child, limit: Duration) -> std::io::Result<Option<ExitStatus>> {
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if started.elapsed() > limit {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        thread::sleep(Duration::from_millis(2));
    }
}
