//! The part of a growing file: who writes it, and what becomes of one that was left behind.

use pilotage_process::lock;
use pilotage_text::file;
use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// Device and inode number of a file.
pub(super) type Identity = (u64, u64);

pub(super) fn identity(file: &File) -> Option<Identity> {
    file.metadata().ok().and_then(|about| identity_of(&about))
}

#[cfg(unix)]
fn identity_of(about: &Metadata) -> Option<Identity> {
    use std::os::unix::fs::MetadataExt;
    Some((about.dev(), about.ino()))
}

#[cfg(not(unix))]
fn identity_of(_: &Metadata) -> Option<Identity> {
    None
}

/// Whether a file is still the one at a path.
pub(super) fn is_at(file: Option<Identity>, path: &Path) -> bool {
    let there = path.symlink_metadata();
    there.is_ok_and(|about| identity_of(&about) == file)
}

/// Path of the part of the file at `path`.
pub(super) fn part_of(path: &Path) -> PathBuf {
    let path = match path.is_symlink() {
        true => super::guard::resolved(path),
        false => path.to_owned(),
    };
    with_ending(&path, ".part")
}

fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

/// How often a part is created anew if other processes remove it before it is locked.
const TRIES: u32 = 100;

/// Creates a part and locks it until it is closed. Returns it with the new name of one that was left behind.
pub(super) fn begin(path: &Path, part: &Path) -> io::Result<(File, Option<PathBuf>)> {
    let mut left_behind = None;
    for _ in 0..TRIES {
        // Append mode: `finish` detects writes or truncation by other code from the length.
        match OpenOptions::new().append(true).create_new(true).open(part) {
            // The lock distinguishes a part being written from an abandoned one. Until it is taken, another process may
            // take the part for one of the latter, and remove it.
            Ok(file) if lock::take(&file).is_ok() && is_at(identity(&file), part) => {
                return Ok((file, left_behind));
            }
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                left_behind = clear(path, part)?.or(left_behind);
            }
            Err(error) => return Err(error),
        }
    }
    let why = "other processes are creating it";
    Err(io::Error::new(ErrorKind::ResourceBusy, why))
}

/// Renames a part that no process is writing to the first free `FILE.interrupted-N`, and removes one without content.
/// Returns the new name, if any: the process that was writing it may have completed it.
fn clear(path: &Path, part: &Path) -> io::Result<Option<PathBuf>> {
    let named = |error: io::Error| {
        let why = format!(
            "{}, left there or being written: {error}",
            super::as_given(part).display()
        );
        io::Error::new(error.kind(), why)
    };
    // Opened to be written, since some file systems lock no others.
    let open = match file::found(OpenOptions::new().read(true).write(true), part) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        opened => opened.map_err(named)?,
    };
    lock::take(&open)?;
    if !is_at(identity(&open), part) {
        return Ok(None);
    }
    // From here on the lock keeps all other processes from this part.
    if open.metadata()?.len() == 0 {
        return std::fs::remove_file(part).map(|()| None);
    }
    let mut number = 1;
    let aside = loop {
        let aside = with_ending(path, &format!(".interrupted-{number}"));
        // A link that leads nowhere is there, too.
        match aside.symlink_metadata() {
            Err(error) if error.kind() == ErrorKind::NotFound => break aside,
            Err(error) => return Err(error),
            Ok(_) => {}
        }
        number += 1;
    };
    std::fs::rename(part, &aside)?;
    Ok(Some(aside))
}
