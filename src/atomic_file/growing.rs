//! A file that grows beside its place and is put there when it is complete.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A result that is written as the work goes: into `FILE.part`, which becomes `FILE` at the end.
///
/// So what was written so far survives the end of the process, whatever ends it, and what stands at
/// `FILE` is never half a result. A part that a process left behind is put aside by the next one that
/// writes the same file, never overwritten.
#[derive(Debug)]
pub struct GrowingFile {
    path: PathBuf,
    part: PathBuf,
    file: File,
    /// What the descriptor leads to, where the system tells.
    identity: Option<Identity>,
    left_behind: Option<PathBuf>,
    /// Whether the user said a relative path.
    is_relative: bool,
    /// How many bytes were written.
    written: u64,
}

impl GrowingFile {
    /// Opens the part of `path`.
    ///
    /// # Errors
    /// When the folder does not exist or cannot be written, `path` is a folder
    /// ([`io::ErrorKind::IsADirectory`]), or another process is writing the same file
    /// ([`io::ErrorKind::ResourceBusy`]).
    pub fn create(path: &Path) -> io::Result<Self> {
        let is_relative = path.is_relative();
        let path = &super::anchored(path);
        if let Some(device) = super::device(path)? {
            return Ok(Self::straight(path, device));
        }
        let path = super::place(path)?;
        let part = part_of(&path);
        let mut left_behind = None;
        let file = loop {
            // Whoever else writes or cuts changes how long it is.
            match OpenOptions::new().append(true).create_new(true).open(&part) {
                Ok(file) => break file,
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                    left_behind = Some(put_aside(&path, &part)?);
                }
                Err(error) => return Err(error),
            }
        };
        // Held until the file is closed: how others tell a part that grows from one left behind. Where
        // the file system knows no locks, they cannot.
        let _ = file.try_lock();
        Ok(Self {
            path,
            part,
            identity: identity(&file),
            file,
            left_behind,
            is_relative,
            written: 0,
        })
    }

    /// A device or a pipe has no part.
    fn straight(path: &Path, file: File) -> Self {
        Self {
            path: path.to_owned(),
            part: path.to_owned(),
            identity: identity(&file),
            file,
            left_behind: None,
            is_relative: false,
            written: 0,
        }
    }

    /// Where the part of an earlier process, which did not come to its end, has been put.
    pub fn left_behind(&self) -> Option<&Path> {
        self.left_behind.as_deref().map(|path| self.as_said(path))
    }

    /// Where the file is until it is complete.
    pub fn part(&self) -> &Path {
        self.as_said(&self.part)
    }

    fn as_said<'a>(&self, path: &'a Path) -> &'a Path {
        match self.is_relative {
            true => super::as_said(path),
            false => path,
        }
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// When it cannot be renamed, or somebody else has written into it or cut it ([`io::ErrorKind::InvalidData`]), as foreign
    /// code in this process can; it is still there as the part.
    pub fn finish(self) -> io::Result<()> {
        let length = std::fs::metadata(&self.part).map_or(self.written, |told| told.len());
        if self.part != self.path && length != self.written {
            let why = format!(
                "{} has {length} bytes where {} were written: other code in this process has written into it, or cut it",
                self.part().display(),
                self.written
            );
            return Err(io::Error::new(io::ErrorKind::InvalidData, why));
        }
        match self.part == self.path {
            true => Ok(()),
            false => std::fs::rename(&self.part, &self.path).map_err(|error| match error.kind() {
                io::ErrorKind::NotFound => {
                    let why = format!("{} has been removed by somebody", self.part().display());
                    io::Error::new(error.kind(), why)
                }
                _ => error,
            }),
        }
    }

    /// Removes it: nothing worth keeping was written.
    pub fn discard(self) {
        if self.part == self.path {
            return;
        }
        // Should this fail, an empty part stays, which the next run puts aside.
        let _ = std::fs::remove_file(&self.part);
    }
}

impl GrowingFile {
    /// Foreign code in this process may close a descriptor that is not its own, and open another file, which then has
    /// its number: our rows go into ours.
    fn stay_open(&mut self) -> io::Result<()> {
        let Some(before) = self.identity else {
            return Ok(());
        };
        if identity(&self.file) == Some(before) {
            return Ok(());
        }
        let again = OpenOptions::new().append(true).open(&self.part)?;
        if identity(&again) != Some(before) {
            let why = "somebody has closed it in this process, and has put another in its place";
            return Err(io::Error::other(why));
        }
        let _ = again.try_lock();
        // The old number is somebody else's now, to close or not.
        std::mem::forget(std::mem::replace(&mut self.file, again));
        Ok(())
    }
}

/// Device and number of a file.
type Identity = (u64, u64);

#[cfg(unix)]
fn identity(file: &File) -> Option<Identity> {
    use std::os::unix::fs::MetadataExt;
    let told = file.metadata().ok()?;
    Some((told.dev(), told.ino()))
}

#[cfg(not(unix))]
fn identity(_: &File) -> Option<Identity> {
    None
}

impl Write for GrowingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stay_open()?;
        let written = self.file.write(bytes)?;
        self.written += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Where the file of that path grows.
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

/// Renames a part that nobody writes any more to the first free `FILE.interrupted-N`.
fn put_aside(path: &Path, part: &Path) -> io::Result<PathBuf> {
    match File::open(part)?.try_lock() {
        Err(TryLockError::WouldBlock) => return Err(io::ErrorKind::ResourceBusy.into()),
        Ok(()) | Err(TryLockError::Error(_)) => {}
    }
    let mut number = 1;
    let aside = loop {
        let aside = with_ending(path, &format!(".interrupted-{number}"));
        match aside.try_exists()? {
            true => number += 1,
            false => break aside,
        }
    };
    std::fs::rename(part, &aside)?;
    Ok(aside)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_part_becomes_the_file_and_one_left_behind_is_put_aside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        std::fs::write(&path, "old").unwrap();
        for n in 1..=2 {
            let mut file = GrowingFile::create(&path).unwrap();
            file.write_all(b"rows").unwrap();
            assert_eq!(file.left_behind().is_some(), n == 2);
            assert_eq!(std::fs::read(&path).unwrap(), b"old");
            // Dropped without an end, as by a crash.
        }
        let expected = ["r.csv", "r.csv.interrupted-1", "r.csv.part"];
        assert_eq!(names(folder.path()), expected);
        let mut file = GrowingFile::create(&path).unwrap();
        let aside = file.left_behind().unwrap().to_owned();
        assert!(aside.ends_with("r.csv.interrupted-2"), "{aside:?}");
        file.write_all(b"new").unwrap();
        file.finish().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::read(&aside).unwrap(), b"rows");
        GrowingFile::create(&path).unwrap().discard();
        let expected = ["r.csv", "r.csv.interrupted-1", "r.csv.interrupted-2"];
        assert_eq!(names(folder.path()), expected);
    }

    #[cfg(unix)]
    #[test]
    fn rows_go_into_the_file_whoever_closes_its_descriptor() {
        use std::os::fd::{AsRawFd, FromRawFd, IntoRawFd, OwnedFd};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        let mut file = GrowingFile::create(&path).unwrap();
        file.write_all(b"one\n").unwrap();
        // Another file gets its number, without a moment in which a test beside this one could get it.
        let number = file.file.as_raw_fd();
        let log = File::create(folder.path().join("log")).unwrap();
        // SAFETY: the number is open, and is not closed by this.
        let mut theirs = unsafe { OwnedFd::from_raw_fd(number) };
        rustix::io::dup2(&log, &mut theirs).unwrap();
        let _ = theirs.into_raw_fd();
        file.write_all(b"two\n").unwrap();
        file.finish().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"one\ntwo\n");
        assert_eq!(std::fs::read(folder.path().join("log")).unwrap(), b"");
    }

    #[test]
    fn what_somebody_else_writes_or_cuts_is_no_result() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        for length in [0, 100] {
            let mut file = GrowingFile::create(&path).unwrap();
            file.write_all(b"one\n").unwrap();
            let other = OpenOptions::new().write(true).open(file.part()).unwrap();
            other.set_len(length).unwrap();
            file.write_all(b"two\n").unwrap();
            let error = file.finish().unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::InvalidData);
            let found = format!("has {} bytes where 8 were written", length + 4);
            assert!(error.to_string().contains(&found), "{error}");
            assert!(!path.exists());
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_written_straight() {
        let null = Path::new("/dev/null");
        let mut file = GrowingFile::create(null).unwrap();
        file.write_all(b"rows").unwrap();
        assert_eq!(file.part(), null);
        file.finish().unwrap();
        GrowingFile::create(null).unwrap().discard();
        assert!(!std::fs::metadata(null).unwrap().is_file());
        assert!(!Path::new("/dev/null.part").exists());
    }

    #[test]
    fn two_at_a_time_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        let first = GrowingFile::create(&path).unwrap();
        let error = GrowingFile::create(&path).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::ResourceBusy);
        drop(first);
        let error = GrowingFile::create(folder.path()).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::IsADirectory);
    }
}
