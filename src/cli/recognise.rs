//! Recognises files by their content, to explain where a misplaced file belongs.

use super::Failure;
use super::overwrite::head;
use crate::document::Document;
use crate::file;
use crate::flights::kind::Kind;
use crate::series::Rows;
use pilotage_systems::is_foreign;
use std::fs::File;
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// Kind of a file, determined by its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// A zip archive or a folder with a model description: an FMU.
    Fmu,
    /// Another zip archive.
    Archive,
    /// Another folder.
    Folder,
    /// A result of `pilotage fit`.
    Pilot,
    /// The coefficients of a vehicle.
    Vehicle,
    /// A model file: equations.
    Model,
    /// A system file: instances and connections; of pilotage, or an SSP.
    System,
    /// A problem file: measurements and parameters to estimate.
    Problem,
    /// A list of trials.
    Manifest,
    /// A table over time with the columns of a trial.
    Trial,
    /// Another table over time: the result of a co-simulation.
    Table,
    /// A web page.
    Page,
    /// A shared library.
    Library,
}

/// Refuses files that are recognised as another kind than expected. Unrecognised files pass: reading them reports what
/// is wrong.
pub fn expect<'a>(
    paths: impl IntoIterator<Item = &'a PathBuf>,
    expected: &[FileKind],
    what: &str,
) -> Result<(), Failure> {
    for path in paths {
        if let Some(kind) = of(path).filter(|kind| !expected.contains(kind)) {
            let shown = path.display();
            let message = format!("{shown} is {}; expected {what}", kind.words());
            return Err(Failure::new(message).hint(kind.belongs(&shown.to_string())));
        }
    }
    Ok(())
}

/// Whether a file is a model file.
pub fn is_model(path: &Path) -> bool {
    of(path) == Some(FileKind::Model)
}

/// Whether a file is a problem file.
pub fn is_problem(path: &Path) -> bool {
    of(path) == Some(FileKind::Problem)
}

/// Whether a file is a system file.
pub fn is_system(path: &Path) -> bool {
    of(path) == Some(FileKind::System)
}

/// Whether a file is a system file, or unrecognised TOML: reading it as a system file reports what is wrong.
pub fn may_be_system(path: &Path) -> bool {
    is_system(path) || (is_toml(path) && path.is_file() && of(path).is_none())
}

/// Whether a file is TOML, by its name.
pub fn is_toml(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension == "toml")
}

/// Whether a file is an FMU.
pub fn is_fmu(path: &Path) -> bool {
    of(path) == Some(FileKind::Fmu)
}

/// The kind of a file; `None` if it is not recognised, or can be read only once (a pipe).
pub fn of(path: &Path) -> Option<FileKind> {
    if path.is_dir() {
        let is_fmu = path.join("modelDescription.xml").is_file();
        return Some(match is_fmu {
            true => FileKind::Fmu,
            false if is_foreign(path) => FileKind::System,
            false => FileKind::Folder,
        });
    }
    if !path.is_file() {
        return None;
    }
    if is_foreign(path) {
        return Some(FileKind::System);
    }
    // TOML must be read as a whole: its beginning alone may be invalid.
    let text = match is_toml(path) {
        true => file::peek(path).unwrap_or_else(|_| head(path)),
        false => head(path),
    };
    if text.starts_with("PK\u{3}\u{4}") {
        return Some(archive(path));
    }
    if text.starts_with("\u{7f}ELF") || text.starts_with("MZ") {
        return Some(FileKind::Library);
    }
    let begin = text.trim_start().to_ascii_lowercase();
    if begin.starts_with("<!doctype html") || begin.starts_with("<html") {
        return Some(FileKind::Page);
    }
    toml(&text).or_else(|| table(&text))
}

/// The kind of a zip archive, by its entries. An unreadable one counts as an FMU, so that opening it reports the error.
fn archive(path: &Path) -> FileKind {
    let entries = file::regular(path)
        .ok()
        .and_then(|file| ZipArchive::new(file).ok());
    let is_fmu = |archive: ZipArchive<File>| {
        let mut names = archive.file_names();
        names.any(|name| name.is_ok_and(|name| name.ends_with("modelDescription.xml")))
    };
    match entries.is_none_or(is_fmu) {
        true => FileKind::Fmu,
        false => FileKind::Archive,
    }
}

/// The kind of a TOML file, by its fields.
fn toml(text: &str) -> Option<FileKind> {
    let document = Document::parse(text, "").ok()?;
    Some(match Kind::of(document.root())? {
        Kind::Pilot => FileKind::Pilot,
        Kind::Vehicle => FileKind::Vehicle,
        Kind::Model => FileKind::Model,
        Kind::System => FileKind::System,
        Kind::Problem => FileKind::Problem,
        Kind::Manifest => FileKind::Manifest,
    })
}

/// The kind of a CSV file, by its header.
fn table(text: &str) -> Option<FileKind> {
    let mut rows = Rows::new(text.as_bytes(), "").ok()?;
    rows.advance().ok().filter(|is_there| *is_there)?;
    let names = rows.cells().map(|cell| name(cell).to_ascii_lowercase());
    let names: Vec<String> = names.collect();
    let has = |wanted: &str| names.iter().any(|own| own == wanted);
    match names.len() > 1 && names[0] == "time" {
        true if has("target") && has("position") => Some(FileKind::Trial),
        true => Some(FileKind::Table),
        false => None,
    }
}

/// A header cell without its unit.
fn name(cell: &str) -> &str {
    cell.split([' ', '[', '(']).next().unwrap_or(cell)
}

impl FileKind {
    fn words(self) -> &'static str {
        match self {
            Self::Fmu => "an FMU",
            Self::Archive => "a zip archive without a modelDescription.xml",
            Self::Folder => "a folder",
            Self::Pilot => "a pilot file",
            Self::Vehicle => "a vehicle file",
            Self::Model => "a model file",
            Self::System => "a system file",
            Self::Problem => "a problem file",
            Self::Manifest => "a list of trials",
            Self::Trial => "a recorded flight",
            Self::Table => "a table over time",
            Self::Page => "a web page",
            Self::Library => "a shared library",
        }
    }

    /// Hint on what the file can be used for.
    fn belongs(self, file: &str) -> String {
        match self {
            Self::Fmu => format!("an FMU belongs to `pilotage cosim {file}`, `info` or `validate`"),
            Self::Archive => {
                "a spreadsheet is to be saved as CSV, an archive to be unpacked".into()
            }
            Self::Folder => format!("name the files in it: {file}/*"),
            Self::Pilot => format!(
                "a pilot belongs to `pilotage export pilot {file}` or `pilotage cosim {file}`"
            ),
            Self::Vehicle => format!(
                "a vehicle belongs to `--vehicle {file}`, `pilotage export quadcopter {file}` or `pilotage cosim {file}`"
            ),
            Self::Model => format!(
                "a model file belongs to `pilotage model check {file}`, `pilotage export {file}` or `pilotage cosim {file}`"
            ),
            Self::System => {
                format!("a system belongs to `pilotage cosim {file}`, `linearize` or `info`")
            }
            Self::Problem => format!("a problem belongs to `pilotage fit {file}`"),
            Self::Manifest => format!("trials belong to `pilotage fit {file}` or `trials check`"),
            Self::Trial => format!(
                "a flight belongs to `pilotage fit {file}`, or feeds an FMU by `cosim --input {file}`"
            ),
            Self::Table => format!("a table feeds FMUs by `pilotage cosim --input {file}`"),
            Self::Page => {
                format!("open {file} in a browser, or draw its figures by `pilotage plot {file}`")
            }
            Self::Library => format!("a library becomes an FMU by `pilotage pack {file}`"),
        }
    }
}
