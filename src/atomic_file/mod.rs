//! Files that appear complete or not at all ([`AtomicFile`]), or grow beside their place until they are
//! complete ([`GrowingFile`]); and whether they may ([`check`]).

mod growing;
mod guard;

pub use growing::GrowingFile;
pub use guard::{Planned, Refusal, check};

use pilotage_process::leftovers::{self, Kind, Leftover};
use std::collections::BTreeSet;
use std::fs::{DirEntry, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, SystemTime};
use tempfile::NamedTempFile;

/// An output that is opened before long work and put in its place at the end.
///
/// Until [`save`](Self::save) nothing stands at the path, or the file that stood there before. A link keeps
/// its place: the file to which it leads is written. A device or a pipe is written straight.
#[derive(Debug)]
pub struct AtomicFile(Place);

#[derive(Debug)]
enum Place {
    /// A temporary file, and its name when it is complete. A signal removes it; what a kill leaves, the next file that is
    /// written into the folder.
    Beside(NamedTempFile, PathBuf, Leftover),
    Straight(File),
}

impl AtomicFile {
    /// Opens a temporary file beside `path`, so that a wrong folder shows before the work is done.
    ///
    /// # Errors
    /// When the folder does not exist or cannot be written, or when `path` is a folder.
    pub fn create(path: &Path) -> io::Result<Self> {
        let path = &anchored(path);
        if let Some(device) = device(path)? {
            return Ok(Self(Place::Straight(device)));
        }
        // Before tempfile, whose message would name the temporary file.
        let path = place(path)?;
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX);
        // As any program's output: readable by whom the user's umask allows, not by the user alone.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let parent = guard::parent(&path);
        remove_left_behind(parent);
        let make = || {
            let file = builder.tempfile_in(parent)?;
            // Held until the file is in its place. Where the file system knows no locks, nothing is removed.
            let _ = file.as_file().try_lock();
            Ok(file)
        };
        let kind = |file: &NamedTempFile| Kind::File(file.path().to_owned());
        let (file, leftover) = leftovers::make(make, kind)?;
        Ok(Self(Place::Beside(file, path, leftover)))
    }

    /// Writes the content and puts the file in its place.
    ///
    /// # Errors
    /// When the content cannot be written; what stood at the path before is still there.
    pub fn save(mut self, content: &[u8]) -> io::Result<()> {
        self.write_all(content)?;
        self.finish()
    }

    /// Puts what was written so far in its place.
    ///
    /// # Errors
    /// When the file cannot be renamed; what stood at the path before is still there.
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

/// How the names of our temporary files begin.
const PREFIX: &str = ".pilotage-";
/// A temporary file without a lock may be one that is just being made, unless it is that old.
const GRACE: Duration = Duration::from_secs(10);

/// Removes the temporary files of processes that were killed; looks into each folder once.
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
    let metadata = path.symlink_metadata()?;
    let age = SystemTime::now().duration_since(metadata.modified()?);
    let is_old = age.is_ok_and(|age| age > GRACE);
    Ok(metadata.is_file() && is_old && File::open(path)?.try_lock().is_ok())
}

/// A device or a pipe, such as `/dev/stdout`, if the path is one: nothing stands there that half a result
/// could spoil.
fn device(path: &Path) -> io::Result<Option<File>> {
    match std::fs::metadata(path) {
        Ok(place) if !place.is_file() && !place.is_dir() => {
            OpenOptions::new().write(true).open(path).map(Some)
        }
        _ => Ok(None),
    }
}

/// The working folder when the program began.
static BEGUN_IN: OnceLock<PathBuf> = OnceLock::new();

/// From now on relative paths of outputs are those from the present working folder, whoever changes it.
pub fn stay() {
    if let Ok(folder) = std::env::current_dir() {
        let _ = BEGUN_IN.set(folder);
    }
}

/// Goes back to the working folder and the umask of the begin, if somebody has changed them.
pub fn go_back() {
    pilotage_process::own::restore_umask();
    if let Some(folder) = BEGUN_IN.get() {
        // Where it is gone, outputs go where they would have gone all the same.
        let _ = std::env::set_current_dir(folder);
    }
}

/// The path from wherever the process is.
fn anchored(path: &Path) -> PathBuf {
    match BEGUN_IN.get() {
        Some(folder) => folder.join(path),
        None => path.to_owned(),
    }
}

/// The path as the user says it.
fn as_said(path: &Path) -> &Path {
    let folder = BEGUN_IN.get();
    let inside = folder.and_then(|folder| path.strip_prefix(folder).ok());
    inside.unwrap_or(path)
}

/// Where a file is to be written, links followed.
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

/// Writes a whole file at once: see [`AtomicFile`].
///
/// # Errors
/// As [`AtomicFile::create`] and [`AtomicFile::save`].
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

    /// A pipe of our own: of a device of the system a failure would leave nothing.
    #[test]
    fn a_pipe_stays_one() {
        use std::io::Read;
        use std::os::unix::fs::FileTypeExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        // Open for both, so that neither side waits for the other.
        let both = OpenOptions::new().read(true).write(true).open(&path);
        write(&path, b"text").unwrap();
        assert!(std::fs::metadata(&path).unwrap().file_type().is_fifo());
        let mut read = [0; 4];
        both.unwrap().read_exact(&mut read).unwrap();
        assert_eq!(&read, b"text");
    }
}
