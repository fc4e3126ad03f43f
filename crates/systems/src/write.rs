//! Writes a description as an archive with its FMUs.

use crate::ssd::to_ssd;
use pilotage_cosim::SystemDescription;
use pilotage_cosim::description::{InstanceDescription, InstanceSource};
use pilotage_fmi::FmuError;
use pilotage_fmi::archive::{ArchiveError, Limits, folder};
use std::io::{self, Cursor, Read, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Why a description cannot be written.
#[derive(Debug, Error)]
pub enum WriteError {
    /// An instance that is no FMU.
    #[error("`{instance}` is {what}, and SSP has FMUs alone")]
    NotAnFmu {
        /// Its name.
        instance: String,
        /// What it is.
        what: String,
    },
    /// An FMU that cannot be read.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// The same, of its archive.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// A name without a variable.
    #[error("`{name}` is no variable of an instance")]
    Unknown {
        /// The name.
        name: String,
    },
    /// A name or a value with a character that XML has not.
    #[error(
        "`{}` has a character that XML cannot hold",
        pilotage_text::printable::excerpt(text)
    )]
    Character {
        /// The text.
        text: String,
    },
    /// The archive cannot be made.
    #[error("cannot make the archive")]
    Zip(#[from] io::Error),
}

/// The content of an FMU: that of its file, or of its folder packed.
///
/// # Errors
/// If it cannot be read.
pub fn fmu(path: &Path) -> Result<Vec<u8>, WriteError> {
    let mut bytes = Vec::new();
    folder::open(path, Limits::default())?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The bytes of an archive (`.ssp`) with all FMUs, each once.
///
/// # Errors
/// If SSP cannot say it, or an FMU cannot be read.
pub fn to_ssp(description: &SystemDescription, name: &str) -> Result<Vec<u8>, WriteError> {
    let mut entries: Vec<(PathBuf, String)> = Vec::new();
    let mut sources = Vec::new();
    for instance in &description.instances {
        let file = file_of(instance)?;
        let known = entries.iter().find(|(own, _)| own == file);
        let entry = match known {
            Some((_, entry)) => entry.clone(),
            None => {
                let stem = file
                    .file_stem()
                    .unwrap_or_default()
                    .to_string_lossy()
                    .into_owned();
                let numbers = std::iter::once(String::new()).chain((2..).map(|k| format!("-{k}")));
                let mut names = numbers.map(|end| format!("resources/{stem}{end}.fmu"));
                let is_free = |name: &String| {
                    entries
                        .iter()
                        .all(|(_, own)| own.to_lowercase() != name.to_lowercase())
                };
                let entry = names.find(is_free).unwrap_or_default();
                entries.push((file.to_owned(), entry.clone()));
                entry
            }
        };
        sources.push(entry);
    }
    let text = to_ssd(description, name, &sources)?;
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default();
    let (packed, stored) = (
        options.compression_method(CompressionMethod::Deflated),
        options.compression_method(CompressionMethod::Stored),
    );
    let failed = |error| WriteError::Zip(io::Error::other(error));
    zip.start_file("SystemStructure.ssd", packed)
        .map_err(failed)?;
    zip.write_all(text.as_bytes())?;
    for (file, entry) in &entries {
        zip.start_file(entry.as_str(), stored).map_err(failed)?;
        zip.write_all(&fmu(file)?)?;
    }
    Ok(zip.finish().map_err(failed)?.into_inner())
}

/// The file of an instance that SSP can have.
pub(crate) fn file_of(instance: &InstanceDescription) -> Result<&Path, WriteError> {
    let what = match &instance.source.value {
        InstanceSource::Model(file) => match file.extension().is_some_and(|own| own == "toml") {
            true => format!("a file of pilotage, {}", file.display()),
            false => return Ok(file),
        },
        InstanceSource::BuiltIn(name) => format!("the built-in model `{name}`"),
        InstanceSource::Table(file) => format!("a table, {}", file.display()),
    };
    let instance = instance.name.clone();
    Err(WriteError::NotAnFmu { instance, what })
}
