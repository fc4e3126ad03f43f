//! A folder with an unpacked FMU, as the archive that it would be: then all that is checked and done is the same.

use super::{ArchiveError, Limits};
use std::fs::{self, File, Metadata};
use std::io::{self, Seek};
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Opens an archive; of a folder, a temporary one of all that is in it, not compressed.
///
/// # Errors
/// When it cannot be read, or the folder holds a link or more than the limits allow.
pub fn open(path: &Path, limits: Limits) -> Result<File, ArchiveError> {
    let failed = |source| ArchiveError::Open {
        path: path.to_owned(),
        source,
    };
    let told = fs::metadata(path).map_err(failed)?;
    match (told.is_dir(), told.is_file()) {
        (true, _) => packed(path, &listed(path, limits)?).map_err(failed),
        (false, true) => File::open(path).map_err(failed),
        // A pipe would be waited for, and is read in its order alone.
        (false, false) => Err(failed(io::Error::other("a pipe or a device is no archive"))),
    }
}

/// All files below a folder, in the order of their names.
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
            // Of a link, the link's own.
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
            // Before anything is copied.
            limits.check(path, files.len(), bytes)?;
        }
    }
    files.sort_unstable_by(|a, b| a.0.cmp(&b.0));
    Ok(files)
}

/// Name of a file in the archive of the folder.
fn name(folder: &Path, file: &Path) -> String {
    let inside = file.strip_prefix(folder).unwrap_or(file);
    let parts = inside.iter().map(|part| part.to_string_lossy());
    parts.collect::<Vec<_>>().join("/")
}

/// The archive, in a file without a name.
fn packed(folder: &Path, files: &[(PathBuf, Metadata)]) -> io::Result<File> {
    let mut zip = ZipWriter::new(tempfile::tempfile()?);
    for (file, metadata) in files {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .unix_permissions(mode(metadata));
        zip.start_file(name(folder, file), options)?;
        io::copy(&mut File::open(file)?, &mut zip)?;
    }
    let mut archive = zip.finish()?;
    archive.rewind()?;
    Ok(archive)
}

/// Some FMUs start helpers: these keep the right to be run.
#[cfg(unix)]
fn mode(metadata: &Metadata) -> u32 {
    use std::os::unix::fs::PermissionsExt;
    metadata.permissions().mode() & 0o777
}

#[cfg(not(unix))]
fn mode(_metadata: &Metadata) -> u32 {
    0o644
}
