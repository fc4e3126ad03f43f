//! Output files of the commands, and how they are distinguished from other files at the same path.

use super::Failure;
use super::cosim::STATE;
use super::cosim::metadata::CONTEXT;
use super::fit::{FITTED, REFITS};
use super::recognise::{self, FileKind};
use super::system;
use crate::atomic_file::{self, Planned, Refusal};
use crate::cosim::SystemDescription;
use crate::cosim::description::HEADER;
use crate::estimation::ProblemFile;
use crate::file;
use crate::models::TextModel;
use crate::series::{Rows, Series};
use std::io::Read;
use std::path::{Path, PathBuf};

/// The option of every command that writes files.
#[derive(Debug, Default, clap::Args)]
pub struct Overwrite {
    /// Overwrite a file of another kind than the one written in its place; inputs are never overwritten.
    #[arg(long)]
    pub force: bool,
}

/// Kind of an output file. A command may replace an earlier output of the same kind.
#[derive(Debug, Clone, Copy)]
pub enum OutputKind {
    /// A report page.
    Page,
    /// The log of a fit.
    Log,
    /// An FMU.
    Fmu,
    /// The result of a co-simulation.
    Result,
    /// A linear system as a script.
    Matlab,
    /// A linear system as a table.
    Matrices,
    /// A system file.
    System,
    /// A system as SSP: an archive or an `.ssd`.
    Ssp,
    /// A problem file.
    Problem,
    /// A model file with fitted parameters.
    Fitted,
    /// Refits of a bootstrap, which are read again on resume.
    Refits,
    /// A figure or its table.
    Figure,
    /// The state of a run.
    State,
    /// Units and descriptions of a result.
    Metadata,
}

impl Overwrite {
    /// Refuses outputs that would destroy inputs, files that inputs name, or files of another kind; to be called before
    /// the work.
    pub fn check(
        &self,
        inputs: &[PathBuf],
        outputs: &[(&Path, OutputKind)],
    ) -> Result<(), Failure> {
        if outputs.iter().any(|(path, _)| path.as_os_str() == "-") {
            let message = "`-` is no file, and results are written to files, whole or not at all";
            return Err(Failure::new(message).hint(
                "name a file; --json prints numbers to standard output, where a command has it",
            ));
        }
        let planned: Vec<Planned> = (outputs.iter())
            .map(|(path, kind)| kind.planned(path))
            .collect();
        let is_there = outputs.iter().any(|(path, _)| path.exists());
        let inputs = match is_there {
            true => with_named(inputs),
            false => inputs.to_vec(),
        };
        atomic_file::check(&inputs, &planned, self.force).map_err(refused)
    }
}

/// Files, and the files that they name: tables of models, runs and models of problems, instances of systems.
fn with_named(files: &[PathBuf]) -> Vec<PathBuf> {
    let mut all = Vec::new();
    let mut left = files.to_vec();
    while let Some(file) = left.pop() {
        if !all.contains(&file) {
            // A table names no files.
            let is_table = file
                .extension()
                .is_some_and(|own| own.eq_ignore_ascii_case("csv"));
            left.extend(if is_table {
                Vec::new()
            } else {
                named_by(&file)
            });
            all.push(file);
        }
    }
    all
}

/// Files that a file names. A file with a mistake names none: the command ends when it reads it.
fn named_by(file: &Path) -> Vec<PathBuf> {
    let of_system = |system: &SystemDescription| -> Vec<PathBuf> {
        let sources = system
            .instances
            .iter()
            .filter_map(|own| own.source.value.file());
        sources.map(Path::to_owned).collect()
    };
    match recognise::of(file) {
        Some(FileKind::Model) => TextModel::read(file).map_or(Vec::new(), |model| {
            let names = model.compiled().tables.keys();
            names.map(|name| file.with_file_name(name)).collect()
        }),
        Some(FileKind::Problem) => ProblemFile::read(file).map_or(Vec::new(), |problem| {
            let runs = problem.runs.iter().map(|run| run.file.clone());
            runs.chain(of_system(&problem.system)).collect()
        }),
        Some(FileKind::System) => {
            system::file::read(file, None).map_or(Vec::new(), |read| of_system(&read.description))
        }
        _ => Vec::new(),
    }
}

/// Writes a file, whole or not at all.
pub fn save(path: &Path, content: impl AsRef<[u8]>) -> Result<(), Failure> {
    let written = atomic_file::write(path, content.as_ref());
    written.map_err(|error| Failure::cannot_write(path, &error))
}

/// Whether a table of that name is written as Parquet, not as CSV.
pub fn is_parquet(path: &Path) -> bool {
    path.extension()
        .is_some_and(|own| own.eq_ignore_ascii_case("parquet"))
}

/// Writes a table, as Parquet or as CSV by the ending of its name.
pub fn save_table(path: &Path, table: &Series) -> Result<(), Failure> {
    match is_parquet(path) {
        true => {
            let bytes = table.to_parquet();
            save(
                path,
                bytes.map_err(|error| Failure::cannot_write(path, &error))?,
            )
        }
        false => save(path, table.to_csv()),
    }
}

/// Refuses outputs that are inputs; for folders already checked by `folder::create_new`.
pub fn keep(inputs: &[PathBuf], outputs: &[PathBuf]) -> Result<(), Failure> {
    let planned = |path| Planned {
        path,
        what: "a file",
        is_own: |_| true,
        grows: false,
    };
    let planned: Vec<Planned> = outputs.iter().map(|path| planned(path)).collect();
    atomic_file::check(inputs, &planned, true).map_err(refused)
}

fn refused(refusal: Refusal) -> Failure {
    let hint = match refusal {
        Refusal::Input { .. } | Refusal::Part { .. } => "give the output another name",
        Refusal::Twice { .. } => "give each output a name of its own",
        Refusal::Foreign { .. } => {
            "give the output another name, or overwrite that file with --force"
        }
    };
    Failure::from(refusal).hint(hint)
}

impl OutputKind {
    fn planned(self, path: &Path) -> Planned<'_> {
        let (what, is_own): (_, fn(&Path) -> bool) = match self {
            Self::Page => ("a report", |path| {
                let head = head(path);
                head.starts_with("<!DOCTYPE html>") && head.contains("<title>pilotage: ")
            }),
            Self::Log => ("a log", |path| first_line(path).contains("\"event\":\"")),
            Self::Fmu => ("an FMU", is_own_fmu),
            Self::Result => ("a result", is_result),
            Self::Matlab => ("a script", |path| {
                first_line(path).ends_with("made by pilotage linearize")
            }),
            // A problem file is made to be edited.
            Self::Problem => ("the unchanged problem file", |_| false),
            // Fits of flights wrote pilot files before they wrote models.
            Self::Fitted => ("a fitted model", |path| {
                let line = first_line(path);
                line.starts_with(FITTED) || line.starts_with("# A pilot: ")
            }),
            Self::Refits => ("a file of bootstrap refits", |path| {
                let line = first_line(path);
                line.is_empty() || line.starts_with(REFITS)
            }),
            Self::Figure => ("a figure", |path| {
                let head = head(path);
                let is_figure = |begin: &&str| head.starts_with(*begin);
                ["<svg xmlns", "\u{fffd}PNG", "panel,run,series"]
                    .iter()
                    .any(is_figure)
            }),
            Self::Metadata => ("a description of a result", |path| {
                head(path).contains(CONTEXT)
            }),
            Self::State => ("a state of a run", |path| head(path).starts_with(STATE)),
            Self::System => ("a saved system", |path| first_line(path) == HEADER),
            Self::Ssp => ("a system that pilotage wrote", is_own_ssp),
            Self::Matrices => ("a table of matrices", |path| {
                first_line(path).split(',').next() == Some("row")
            }),
        };
        Planned {
            path,
            what,
            is_own,
            grows: matches!(self, Self::Result),
        }
    }
}

/// Number of leading bytes by which a file is recognised.
const HEAD: u64 = 1 << 16;

/// The beginning of a file; empty if it cannot be read.
pub fn head(path: &Path) -> String {
    let mut bytes = Vec::new();
    let read = file::regular(path).and_then(|file| file.take(HEAD).read_to_end(&mut bytes));
    read.map_or_else(
        |_| String::new(),
        |_| String::from_utf8_lossy(&bytes).into_owned(),
    )
}

/// Whether a file has exactly this content.
pub fn holds(path: &Path, content: &str) -> bool {
    let mut bytes = Vec::new();
    let most = content.len() as u64 + 1;
    let read = file::regular(path).and_then(|file| file.take(most).read_to_end(&mut bytes));
    read.is_ok() && bytes == content.as_bytes()
}

fn first_line(path: &Path) -> String {
    head(path).lines().next().unwrap_or_default().to_owned()
}

/// Whether a file is a co-simulation result: `time` without unit, and otherwise only `instance.variable`.
fn is_result(path: &Path) -> bool {
    if is_parquet(path) {
        return crate::series::parquet::is_own(path);
    }
    let line = first_line(path);
    let Ok(mut rows) = Rows::new(line.as_bytes(), "") else {
        return false;
    };
    rows.advance().is_ok_and(|is_there| is_there)
        && rows.separator() == b','
        && rows.cell(0) == "time"
        && rows.cells().skip(1).all(|cell| cell.contains('.'))
}

/// Whether an FMU was generated by pilotage.
fn is_own_fmu(path: &Path) -> bool {
    entry(path, "modelDescription.xml").is_some_and(|text| is_generated(&text))
}

/// Whether an archive or an `.ssd` was written by pilotage.
fn is_own_ssp(path: &Path) -> bool {
    let text = entry(path, "SystemStructure.ssd").unwrap_or_else(|| head(path));
    is_generated(&text)
}

fn is_generated(text: &str) -> bool {
    text.contains("generationTool=\"pilotage ")
}

/// The beginning of an entry of an archive.
fn entry(path: &Path, name: &str) -> Option<String> {
    let mut archive = zip::ZipArchive::new(file::regular(path).ok()?).ok()?;
    let mut text = String::new();
    let file = archive.by_name(name).ok()?;
    file.take(HEAD).read_to_string(&mut text).ok()?;
    Some(text)
}
