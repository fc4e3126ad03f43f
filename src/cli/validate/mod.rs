//! `pilotage validate`: checks FMUs against the standard and tests their binaries.
//!
//! | module | what it does |
//! | --- | --- |
//! | `probe` | tests a binary in separate processes, so that a crash or hang becomes a finding |
//! | `text` | findings as text and as JSON |

mod probe;
mod text;

pub use probe::{ProbeArgs, probe};
pub(super) use text::to_text;

use super::number::positive;
use super::recognise::{self, FileKind};
use super::system::{Built, file, open};
use super::{Failure, Outcome, terminal};
use crate::cosim::description::Kept;
use crate::fmi::description::Severity;
use crate::fmi_check::{self, Finding};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Arguments of `pilotage validate`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  pilotage validate pilot.fmu quadcopter.fmu\n  pilotage validate system.toml\n  pilotage validate --strict --json *.fmu | jq '.fmus[].findings[]'\n\nIt checks the archive, modelDescription.xml, the other files and the binaries of all platforms, and runs the binary of this platform in separate processes.\n\nErrors violate the standard. Warnings are legal, but cause problems in some tools. Notes are information.\n\nExit codes: 0 every FMU is valid (there may be warnings), 1 one is not, 2 bad use or input."
)]
pub struct Args {
    /// FMUs: files, or folders with unpacked FMUs. For a system file (TOML or SSP), its FMUs with their connections.
    #[arg(required = true)]
    fmus: Vec<PathBuf>,
    /// Variant of an SSP with several .ssd, by its name or its file's.
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
    /// Check the files, but do not run the binaries.
    #[arg(long)]
    no_run: bool,
    /// Treat warnings as errors.
    #[arg(long)]
    strict: bool,
    /// Maximum time of each test of a binary [s].
    #[arg(long, value_name = "SECONDS", default_value = "20", value_parser = seconds, allow_hyphen_values = true)]
    time_limit: Duration,
    /// Print one JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// Parses a positive number of seconds.
fn seconds(text: &str) -> Result<Duration, String> {
    Duration::try_from_secs_f64(positive(text)?).map_err(|error| error.to_string())
}

/// The findings in one FMU.
pub(super) struct Report {
    path: PathBuf,
    findings: Vec<Finding>,
    /// Whether its binary was tested.
    is_tried: bool,
}

impl Report {
    /// Whether there are neither errors nor warnings.
    pub(super) fn is_clean(&self) -> bool {
        self.is_valid() && self.count(Severity::Warning) == 0
    }

    /// Whether there are no errors.
    pub(super) fn is_valid(&self) -> bool {
        self.count(Severity::Error) == 0
    }

    fn count(&self, severity: Severity) -> usize {
        let counted = self.findings.iter().filter(|f| f.severity == severity);
        counted.count()
    }
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let kinds = [FileKind::Fmu, FileKind::Archive, FileKind::System];
    recognise::expect(&args.fmus, &kinds, "an FMU or a system file")?;
    let limit = (!args.no_run).then_some(args.time_limit);
    let asked = (args.fmus.iter())
        .map(|path| asked(path, args.variant.as_deref()))
        .collect::<Result<Vec<Asked>, Failure>>()?;
    let systems: Vec<_> = asked.iter().filter_map(|a| a.system.as_ref()).collect();
    let reports = (asked.iter().flat_map(|asked| &asked.fmus))
        .map(|path| check(path, limit))
        .collect::<Result<Vec<Report>, Failure>>()?;
    let text = match args.json {
        true => {
            let fmus: Vec<_> = reports.iter().map(text::to_json).collect();
            let system = |(file, connections): &&(PathBuf, usize)| json!({ "file": file.display().to_string(), "connections": connections });
            let systems: Vec<_> = systems.iter().map(system).collect();
            format!("{:#}\n", json!({ "fmus": fmus, "systems": systems }))
        }
        false => {
            let line = |(file, n): &&(PathBuf, usize)| match n {
                1 => format!("{}: its connection fits\n", terminal::shown(file)),
                n => format!("{}: its {n} connections fit\n", terminal::shown(file)),
            };
            let lines: String = systems.iter().map(line).collect();
            lines + &reports.iter().map(to_text).collect::<String>()
        }
    };
    terminal::print(&text)?;
    let is_good = |report: &Report| match args.strict {
        true => report.is_clean(),
        false => report.is_valid(),
    };
    Ok(match reports.iter().all(is_good) {
        true => Outcome::Done,
        false => Outcome::No,
    })
}

/// Resolves a path: an FMU, or a system file, whose connections are checked and whose FMUs are listed.
fn asked(path: &Path, variant: Option<&str>) -> Result<Asked, Failure> {
    if !recognise::may_be_system(path) {
        let fmus = vec![path.to_owned()];
        return Ok(Asked {
            system: None,
            fmus,
            _kept: Kept::default(),
        });
    }
    let read = file::read(path, variant)?;
    for note in &read.notes {
        terminal::note(note);
    }
    let built = open(read.description)?;
    let Built {
        files: mut fmus,
        system,
        description,
        ..
    } = built;
    fmus.retain(|file| recognise::is_fmu(file));
    fmus.sort();
    fmus.dedup();
    let connections = system.links().count();
    Ok(Asked {
        system: Some((path.to_owned(), connections)),
        fmus,
        _kept: description.kept,
    })
}

/// The items to check.
struct Asked {
    /// A system file and the number of its connections, all of which fit.
    system: Option<(PathBuf, usize)>,
    fmus: Vec<PathBuf>,
    /// The files of an unpacked archive.
    _kept: Kept,
}

/// Default time limit for each test of a binary.
pub(super) const TIME_LIMIT: Duration = Duration::from_secs(20);

/// Checks one FMU; tests its binary if a time limit is given.
pub(super) fn check(path: &Path, limit: Option<Duration>) -> Result<Report, Failure> {
    let checked = fmi_check::check(path)?;
    let mut findings = checked.findings;
    let mut is_tried = false;
    if let Some((limit, description)) = limit.zip(checked.description.as_ref()) {
        let tried = probe::try_all(path, description, limit)?;
        findings.extend(tried.findings);
        is_tried = tried.is_loaded;
    }
    Ok(Report {
        path: path.to_owned(),
        findings,
        is_tried,
    })
}
