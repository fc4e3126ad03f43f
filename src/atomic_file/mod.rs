//! Atomic file output: files that appear complete or not at all ([`AtomicFile`]), files that are written next to their
//! final path until they are complete ([`GrowingFile`]), and the check whether they may be written ([`check`]).

mod growing;
mod guard;
mod part;

pub use growing::GrowingFile;
pub use guard::{Planned, Refusal, check};

use pilotage_process::leftovers::{self, Kind, Leftover};
use pilotage_text::file;
use std::collections::BTreeSet;
use std::fs::{DirEntry, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, SystemTime};
use tempfile::NamedTempFile;

/// An output file that is opened before a long computation and moved into place at the end.
///
/// Until [`save`](Self::save) the path holds no file, or the previous file. A symbolic link is kept: its target is
/// written. Devices and pipes are written directly.
#[derive(Debug)]
pub struct AtomicFile(Place);

#[derive(Debug)]
enum Place {
    /// A temporary file, and its final path. A signal removes it; after a kill, the next file written into the same
    /// folder does.
    Beside(NamedTempFile, PathBuf, Leftover),
    Straight(File),
}

impl AtomicFile {
    /// Opens a temporary file next to `path`, so that an invalid folder is reported before the work is done.
    ///
    /// # Errors
    /// If the folder does not exist or is not writable, or if `path` is a folder.
    pub fn create(path: &Path) -> io::Result<Self> {
        let path = &anchored(path);
        if let Some(device) = device(path)? {
            return Ok(Self(Place::Straight(device)));
        }
        // Checked before tempfile, whose error message would name the temporary file.
        let path = place(path)?;
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX);
        // Permissions as for any program's output: governed by the user's umask, not restricted to the user.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let parent = guard::parent(&path);
        remove_left_behind(parent);
        let make = || {
            let file = builder.tempfile_in(parent)?;
            // Held until the file is in place. On file systems without locks nothing is removed.
            let _ = file.as_file().try_lock();
            Ok(file)
        };
        let kind = |file: &NamedTempFile| Kind::File(file.path().to_owned());
        let (file, leftover) = leftovers::make(make, kind)?;
        Ok(Self(Place::Beside(file, path, leftover)))
    }

    /// Writes the content and moves the file into place.
    ///
    /// # Errors
    /// If the content cannot be written; the previous file at the path is kept.
    pub fn save(mut self, content: &[u8]) -> io::Result<()> {
        self.write_all(content)?;
        self.finish()
    }

    /// Moves what has been written so far into place.
    ///
    /// # Errors
    /// If the file cannot be renamed; the previous file at the path is kept.
    pub fn finish(mut self) -> io::Result<()> {
        self.flush()?;
        if let Place::Beside(file, path, _leftover) = self.0 {
            file.persist(&path).map_err(|error| error.error)?;
        }
        Ok(())
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.0 {
            Place::Beside(file, ..) => file.write(bytes),
            Place::Straight(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.0 {
            Place::Beside(file, ..) => file.flush(),
            Place::Straight(file) => file.flush(),
        }
    }
}

/// Name prefix of temporary files.
const PREFIX: &str = ".pilotage-";
/// Age below which a temporary file without a lock may still be under creation.
const GRACE: Duration = Duration::from_secs(10);

/// Removes the temporary files of killed processes; scans each folder once per process.
fn remove_left_behind(folder: &Path) {
    static SEEN: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let mut seen = SEEN.lock().unwrap_or_else(PoisonError::into_inner);
    if !seen.insert(folder.to_owned()) {
        return;
    }
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let is_ours = |entry: &DirEntry| entry.file_name().to_string_lossy().starts_with(PREFIX);
    for file in entries.filter(is_ours).map(|entry| entry.path()) {
        if is_left_behind(&file).unwrap_or(false) {
            let _ = std::fs::remove_file(&file);
        }
    }
}

fn is_left_behind(path: &Path) -> io::Result<bool> {
    let file = file::found(OpenOptions::new().read(true).write(true), path)?;
    let age = SystemTime::now().duration_since(file.metadata()?.modified()?);
    let is_old = age.is_ok_and(|age| age > GRACE);
    Ok(is_old && file.try_lock().is_ok())
}

/// Opens a device or a pipe such as `/dev/stdout`, if the path is one: it holds no earlier file that a partial result
/// could destroy.
fn device(path: &Path) -> io::Result<Option<File>> {
    match std::fs::metadata(path) {
        Ok(place) if !place.is_file() && !place.is_dir() => {
            OpenOptions::new().write(true).open(path).map(Some)
        }
        _ => Ok(None),
    }
}

/// The working folder at program start.
static BEGUN_IN: OnceLock<PathBuf> = OnceLock::new();

/// Fixes the folder to which relative output paths refer to the current working folder, whatever changes it later.
pub fn stay() {
    if let Ok(folder) = std::env::current_dir() {
        let _ = BEGUN_IN.set(folder);
    }
}

/// Restores the initial working folder and umask if other code has changed them.
pub fn go_back() {
    pilotage_process::own::restore_umask();
    if let Some(folder) = BEGUN_IN.get() {
        // If the folder no longer exists, outputs go where they would have gone anyway.
        let _ = std::env::set_current_dir(folder);
    }
}

/// The path relative to the initial working folder, made independent of the current one.
fn anchored(path: &Path) -> PathBuf {
    match BEGUN_IN.get() {
        Some(folder) => folder.join(path),
        None => path.to_owned(),
    }
}

/// The path as the user gave it.
fn as_given(path: &Path) -> &Path {
    let folder = BEGUN_IN.get();
    let inside = folder.and_then(|folder| path.strip_prefix(folder).ok());
    inside.unwrap_or(path)
}

/// Path at which a file is to be written, links resolved.
fn place(path: &Path) -> io::Result<PathBuf> {
    if path.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let path = match path.is_symlink() {
        true => guard::resolved(path),
        false => path.to_owned(),
    };
    std::fs::metadata(guard::parent(&path))?;
    Ok(path)
}

/// Writes a whole file at once; see [`AtomicFile`].
///
/// # Errors
/// See [`AtomicFile::create`] and [`AtomicFile::save`].
pub fn write(path: &Path, content: &[u8]) -> io::Result<()> {
    AtomicFile::create(path)?.save(content)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn links_stay_and_lead_to_what_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("file"), "old").unwrap();
        symlink("file", at("link")).unwrap();
        symlink("new", at("dangling")).unwrap();
        for (link, file) in [("link", "file"), ("dangling", "new")] {
            write(&at(link), b"text").unwrap();
            assert!(at(link).is_symlink());
            assert_eq!(std::fs::read(at(file)).unwrap(), b"text");
            let mut growing = GrowingFile::create(&at(link)).unwrap();
            growing.write_all(b"rows").unwrap();
            growing.finish().unwrap();
            assert!(at(link).is_symlink());
            assert_eq!(std::fs::read(at(file)).unwrap(), b"rows");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4);
    }

    #[test]
    fn what_a_killed_process_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let old = SystemTime::now() - 2 * GRACE;
        for name in [
            ".pilotage-dead",
            ".pilotage-alive",
            ".pilotage-young",
            ".other",
        ] {
            let file = File::create(at(name)).unwrap();
            if name != ".pilotage-young" {
                file.set_modified(old).unwrap();
            }
        }
        let alive = File::open(at(".pilotage-alive")).unwrap();
        alive.try_lock().unwrap();
        write(&at("new"), b"text").unwrap();
        let mut names: Vec<_> = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|e| e.unwrap().file_name())
            .collect();
        names.sort();
        assert_eq!(
            names,
            [".other", ".pilotage-alive", ".pilotage-young", "new"]
        );
    }

    /// Uses its own pipe: a failure with a system device would destroy the device.
    #[test]
    fn a_pipe_stays_one() {
        use std::io::Read;
        use std::os::unix::fs::FileTypeExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        // Opened for both directions, so that neither side waits for the other.
        let both = OpenOptions::new().read(true).write(true).open(&path);
        write(&path, b"text").unwrap();
        assert!(std::fs::metadata(&path).unwrap().file_type().is_fifo());
        let mut read = [0; 4];
        both.unwrap().read_exact(&mut read).unwrap();
        assert_eq!(&read, b"text");
    }
}
