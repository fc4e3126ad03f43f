//! Reads a folder with an unpacked FMU as the equivalent archive, so that all checks and operations are the same.

use super::{ArchiveError, Limits};
use pilotage_text::file;
use std::fs::{self, File, Metadata};
use std::io::{self, Read, Seek};
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Opens an archive; for a folder, creates a temporary uncompressed archive of its contents.
///
/// # Errors
/// If it cannot be read, or the folder contains a link or exceeds the limits.
pub fn open(path: &Path, limits: Limits) -> Result<File, ArchiveError> {
    let failed = |source| ArchiveError::Open {
        path: path.to_owned(),
        source,
    };
    let metadata = fs::metadata(path).map_err(failed)?;
    match (metadata.is_dir(), metadata.is_file()) {
        (true, _) => packed(path, &listed(path, limits)?).map_err(failed),
        (false, true) => file::regular(path).map_err(failed),
        // Opening a pipe would block, and it cannot be read at random offsets.
        (false, false) => Err(failed(io::Error::other("a pipe or a device is no archive"))),
    }
}

/// All files below a folder, sorted by name.
fn listed(path: &Path, limits: Limits) -> Result<Vec<(PathBuf, Metadata)>, ArchiveError> {
    let failed = |source| ArchiveError::Open {
        path: path.to_owned(),
        source,
    };
    let (mut folders, mut files) = (vec![path.to_owned()], Vec::new());
    let mut bytes = 0;
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            // For a link, the metadata of the link itself.
            let metadata = entry.metadata().map_err(failed)?;
            if metadata.is_dir() {
                folders.push(entry.path());
                continue;
            }
            if !metadata.is_file() {
                return Err(ArchiveError::Link {
                    path: path.to_owned(),
                    entry: name(path, &entry.path()),
                });
            }
            bytes += metadata.len();
            files.push((entry.path(), metadata));
            // Checked before anything is copied.
            limits.check(path, files.len(), bytes)?;
        }
    }
    files.sort_unstable_by(|a, b| a.0.cmp(&b.0));
    Ok(files)
}

/// Name of a file in the folder's archive.
fn name(folder: &Path, file: &Path) -> String {
    let inside = file.strip_prefix(folder).unwrap_or(file);
    let parts = inside.iter().map(|part| part.to_string_lossy());
    parts.collect::<Vec<_>>().join("/")
}

/// Creates the archive in an unnamed temporary file.
fn packed(folder: &Path, files: &[(PathBuf, Metadata)]) -> io::Result<File> {
    let mut zip = ZipWriter::new(tempfile::tempfile()?);
    for (file, metadata) in files {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .unix_permissions(mode(metadata));
        zip.start_file(name(folder, file), options)?;
        // It may have become another one since it was listed, or be growing.
        let file = file::found(File::options().read(true), file)?;
        io::copy(&mut file.take(metadata.len()), &mut zip)?;
    }
    let mut archive = zip.finish()?;
    archive.rewind()?;
    Ok(archive)
}

/// Some FMUs start helper programs, which must stay executable.
#[cfg(unix)]
fn mode(metadata: &Metadata) -> u32 {
    use std::os::unix::fs::PermissionsExt;
    metadata.permissions().mode() & 0o777
}

#[cfg(not(unix))]
fn mode(_metadata: &Metadata) -> u32 {
    0o644
}
