//! The archive (FMI 2.0.5, section 2.3).

use super::{EXTRA, Provenance, binary, description, documentation, picture};
use crate::models::{Model, ValueError};
use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use std::path::PathBuf;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// Why an FMU could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A start value that its variable cannot have.
    #[error("the model cannot be exported")]
    Value(#[from] ValueError),
    /// The archive cannot be built.
    #[error("the archive cannot be built at {entry}")]
    Archive {
        /// The entry at which it failed.
        entry: String,
        /// Why.
        source: zip::result::ZipError,
    },
    /// The file cannot be written.
    #[error("{} cannot be written", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// The bytes of a model's FMU. Entries are sorted and have one fixed time, so that equal models and
/// provenance give equal bytes.
///
/// # Errors
/// When a start value is not finite or out of range.
pub fn package(model: &Model, provenance: &Provenance) -> Result<Vec<u8>, ExportError> {
    model.check()?;
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in entries(model, provenance) {
        let mode = if name.starts_with("binaries/") {
            0o755
        } else {
            0o644
        };
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(DateTime::default())
            .unix_permissions(mode);
        let written = zip
            .start_file(name.as_str(), options)
            .and_then(|()| Ok(zip.write_all(&content)?));
        written.map_err(|source| ExportError::Archive {
            entry: name,
            source,
        })?;
    }
    let archive = zip.finish().map_err(|source| ExportError::Archive {
        entry: "the end".into(),
        source,
    })?;
    Ok(archive.into_inner())
}

/// All files by name.
fn entries(model: &Model, provenance: &Provenance) -> BTreeMap<String, Vec<u8>> {
    let description = description(model, provenance);
    let mut entries = BTreeMap::from([
        (
            "modelDescription.xml".to_owned(),
            description.to_xml().into_bytes(),
        ),
        (
            "resources/model.toml".to_owned(),
            model.to_file().into_bytes(),
        ),
        ("model.png".to_owned(), picture::png(model)),
        (
            format!("{EXTRA}/provenance.txt"),
            documentation::provenance(model, provenance).into_bytes(),
        ),
    ]);
    for path in binary::paths(model.kind().name()) {
        entries.insert(path, binary::LIBRARY.to_vec());
    }
    for (name, text) in documentation::files(model, provenance) {
        entries.insert(format!("documentation/{name}"), text.into_bytes());
    }
    if let Some((name, text)) = &provenance.source {
        entries.insert(format!("{EXTRA}/{name}"), text.clone().into_bytes());
    }
    entries
}
