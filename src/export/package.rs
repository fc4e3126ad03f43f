//! The FMU archive (FMI 2.0.5, section 2.3; FMI 3.0, section 2.5).

use super::{
    EXTRA, ExportError, Platform, Provenance, description, documentation, platform, source,
    terminals,
};
use crate::fmi::description::{FmiVersion, ModelDescription};
use maud::Markup;
use pilotage_sdk::{Interface, Role, Variable};
use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// The contents of an FMU from which its files are generated.
#[derive(Debug, Clone)]
pub struct Contents<'c> {
    /// Name of the FMU: its `modelName`.
    pub name: &'c str,
    /// Interface of the model.
    pub interface: &'c Interface,
    /// Origin of the model.
    pub provenance: &'c Provenance,
    /// Version of the standard.
    pub version: FmiVersion,
    /// A library for each platform.
    pub binaries: Vec<(Platform, Vec<u8>)>,
    /// Equations and advice for the documentation.
    pub about: Markup,
    /// model.png, the picture that tools show as the model's icon.
    pub picture: &'static [u8],
    /// Files in `resources`.
    pub resources: BTreeMap<String, Vec<u8>>,
    /// Files in `sources`; none if the FMU has binaries alone.
    pub sources: BTreeMap<String, Vec<u8>>,
}

/// Creates the FMU archive. Entries are sorted and have a fixed time, so that equal contents give equal bytes.
///
/// # Errors
/// If a library does not fit its platform, or a platform is given twice.
pub fn archive(contents: &Contents<'_>) -> Result<Vec<u8>, ExportError> {
    zipped(entries(contents)?)
}

/// An archive of files by name; what an FMU runs is executable.
pub(super) fn zipped(entries: BTreeMap<String, Vec<u8>>) -> Result<Vec<u8>, ExportError> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in entries {
        let is_run = name.starts_with("binaries/") || name.starts_with("resources/parts/");
        let mode = if is_run { 0o755 } else { 0o644 };
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

/// Default picture of a model.
pub const BLOCK: &[u8] = include_bytes!("pictures/block.png");

/// Path of the picture in the archive.
pub(super) fn picture_path(version: FmiVersion) -> String {
    match version {
        FmiVersion::V2 => "model.png".to_owned(),
        FmiVersion::V3 => format!("{}/icon.png", terminals::FOLDER),
    }
}

/// All files, by name.
fn entries(contents: &Contents<'_>) -> Result<BTreeMap<String, Vec<u8>>, ExportError> {
    let Contents {
        interface,
        provenance,
        version,
        ..
    } = *contents;
    let mut description = ModelDescription {
        model_name: contents.name.to_owned(),
        ..description(interface, provenance, version)
    };
    if !contents.sources.is_empty() && version == FmiVersion::V2 {
        let files = vec![source::main_file(&interface.name)];
        if let Some(own) = &mut description.model_exchange {
            own.source_files.clone_from(&files);
        }
        if let Some(own) = &mut description.co_simulation {
            own.source_files = files;
        }
    }
    let mut entries = BTreeMap::from([
        (
            "modelDescription.xml".to_owned(),
            description.to_xml().into_bytes(),
        ),
        (
            format!("{EXTRA}/provenance.txt"),
            documentation::provenance(interface, provenance).into_bytes(),
        ),
    ]);
    entries.extend(binaries(&contents.binaries, (version, &interface.name))?);
    for (name, content) in documentation::files(contents) {
        entries.insert(format!("documentation/{name}"), content.into_bytes());
    }
    for (name, content) in &contents.resources {
        entries.insert(format!("resources/{name}"), content.clone());
    }
    for (name, content) in &contents.sources {
        entries.insert(format!("sources/{name}"), content.clone());
    }
    entries.insert(picture_path(version), contents.picture.to_vec());
    if version == FmiVersion::V3 {
        let path = format!("{}/terminalsAndIcons.xml", terminals::FOLDER);
        let is_outside = |v: &&Variable| v.role == Role::Input || v.is_output();
        entries.insert(
            path,
            terminals::file(
                (interface.variables.iter())
                    .filter(is_outside)
                    .map(|v| v.name.as_str()),
            )
            .into_bytes(),
        );
    }
    if let Some((name, text)) = &provenance.source {
        entries.insert(format!("{EXTRA}/{name}"), text.clone().into_bytes());
    }
    Ok(entries)
}

/// The libraries for a model of that name, by their names in the archive.
pub(super) fn binaries(
    binaries: &[(Platform, Vec<u8>)],
    (version, name): (FmiVersion, &str),
) -> Result<BTreeMap<String, Vec<u8>>, ExportError> {
    let mut entries = BTreeMap::new();
    let mut aliases = Vec::new();
    for (platform, bytes) in binaries {
        platform::check(platform, bytes, version)?;
        let mut paths = platform.paths(version, name).into_iter();
        if let Some(path) = paths.next()
            && entries.insert(path.clone(), bytes.clone()).is_some()
        {
            return Err(ExportError::TwoBinaries { path });
        }
        aliases.extend(paths.map(|path| (path, platform, bytes)));
    }
    for (alias, platform, bytes) in aliases {
        // FMI 2.0 has one folder for all Macs: a universal library is for both processors, and needs no folder beside.
        let other = binaries.iter().find(|(other, _)| {
            other.tuple != platform.tuple && other.paths(version, name)[0] == alias
        });
        let content = match other {
            Some((other, theirs)) => {
                entries.remove(&platform.paths(version, name)[0]);
                platform::universal(&[(*other, theirs), (*platform, bytes)])?
            }
            None => bytes.clone(),
        };
        entries.insert(alias, content);
    }
    Ok(entries)
}
