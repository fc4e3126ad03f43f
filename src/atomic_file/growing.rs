//! A file that is written next to its final path and renamed when it is complete.

use super::part::{Identity, begin, identity, is_at, part_of};
use pilotage_text::file;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// A result file that is written incrementally into `FILE.part`, which is renamed to `FILE` at the end.
///
/// Rows written so far survive any termination of the process, and `FILE` never holds a partial result. A part left by
/// an earlier process is renamed by the next process that writes the same file; it is never overwritten.
#[derive(Debug)]
pub struct GrowingFile {
    path: PathBuf,
    part: PathBuf,
    file: File,
    /// Identity of the file behind the descriptor, if the system provides one.
    identity: Option<Identity>,
    left_behind: Option<PathBuf>,
    /// Whether the user gave a relative path.
    is_relative: bool,
    /// Number of bytes written.
    written: u64,
}

impl GrowingFile {
    /// Opens the part of `path`.
    ///
    /// # Errors
    /// If the folder does not exist or is not writable, `path` is a folder ([`ErrorKind::IsADirectory`]), or
    /// another process is writing the same file ([`ErrorKind::ResourceBusy`]).
    pub fn create(path: &Path) -> io::Result<Self> {
        let is_relative = path.is_relative();
        let path = &super::anchored(path);
        if let Some(device) = super::device(path)? {
            return Ok(Self::straight(path, device));
        }
        let path = super::place(path)?;
        let part = part_of(&path);
        let (file, left_behind) = begin(&path, &part)?;
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

    /// A device or a pipe, which is written directly, without a part.
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

    /// Path to which the part of an earlier, interrupted process was renamed.
    pub fn left_behind(&self) -> Option<&Path> {
        self.left_behind.as_deref().map(|path| self.as_given(path))
    }

    /// Path of the file until it is complete.
    pub fn part(&self) -> &Path {
        self.as_given(&self.part)
    }

    fn as_given<'a>(&self, path: &'a Path) -> &'a Path {
        match self.is_relative {
            true => super::as_given(path),
            false => path,
        }
    }

    /// Renames the part to the final path.
    ///
    /// # Errors
    /// If it cannot be renamed, another process has removed or replaced it, or other code in this process has written
    /// into it or truncated it ([`ErrorKind::InvalidData`]). The part is kept.
    pub fn finish(self) -> io::Result<()> {
        if self.part == self.path {
            return Ok(());
        }
        if !is_at(self.identity, &self.part) {
            let shown = self.part().display();
            return Err(io::Error::other(format!(
                "{shown} has been removed or replaced by another process"
            )));
        }
        let length = std::fs::metadata(&self.part)?.len();
        if length != self.written {
            let why = format!(
                "{} has {length} bytes where {} were written: other code in this process has written into it, or cut it",
                self.part().display(),
                self.written
            );
            return Err(io::Error::new(ErrorKind::InvalidData, why));
        }
        // Locked until it has its name: until then nobody else touches the part.
        std::fs::rename(&self.part, &self.path)
    }

    /// Removes the part when nothing worth keeping was written.
    pub fn discard(self) {
        if self.part != self.path && is_at(self.identity, &self.part) {
            // If this fails, an empty part remains, which the next run removes.
            let _ = std::fs::remove_file(&self.part);
        }
    }
}

impl GrowingFile {
    /// Foreign code in this process may close a descriptor it does not own and open another file, which then gets the
    /// same number. This reopens our file in that case.
    fn stay_open(&mut self) -> io::Result<()> {
        let Some(before) = self.identity else {
            return Ok(());
        };
        if identity(&self.file) == Some(before) {
            return Ok(());
        }
        let again = file::found(OpenOptions::new().append(true), &self.part)?;
        if identity(&again) != Some(before) {
            let why =
                "other code in this process has closed it and opened another file in its place";
            return Err(io::Error::other(why));
        }
        let _ = again.try_lock();
        // The old number now belongs to other code, which may close it.
        std::mem::forget(std::mem::replace(&mut self.file, again));
        Ok(())
    }
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
            // Dropped without `finish`, as after a crash.
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
        // Another file gets its number atomically, so that no parallel test can take it in between.
        let number = file.file.as_raw_fd();
        let log = File::create(folder.path().join("log")).unwrap();
        // SAFETY: the number is open, and this does not close it.
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
            assert_eq!(error.kind(), ErrorKind::InvalidData);
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

    /// Whoever succeeds has written a whole file, and nobody takes another's part for one left behind.
    #[test]
    fn many_at_a_time_leave_one_whole_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        let write = |writer: usize| {
            let mut file = GrowingFile::create(&path)?;
            assert_eq!(file.left_behind(), None);
            for _ in 0..20 {
                file.write_all(format!("{writer}\n").as_bytes())?;
            }
            file.finish()
        };
        let done = std::sync::atomic::AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for writer in 10..18 {
                let (write, done) = (&write, &done);
                scope.spawn(move || {
                    for _ in 0..30 {
                        match write(writer) {
                            Ok(()) => drop(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed)),
                            Err(error) => {
                                assert_eq!(error.kind(), ErrorKind::ResourceBusy, "{error}")
                            }
                        }
                    }
                });
            }
        });
        assert!(done.into_inner() > 0);
        assert_eq!(names(folder.path()), ["r.csv"]);
        let text = std::fs::read_to_string(&path).unwrap();
        let first = text.lines().next().unwrap();
        assert_eq!(text, format!("{first}\n").repeat(20));
    }

    /// What stands at the path of a part was found there: it is not waited for, followed or renamed.
    #[cfg(unix)]
    #[test]
    fn a_part_that_is_no_file_is_refused_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        let (path, part) = (
            folder.path().join("r.csv"),
            folder.path().join("r.csv.part"),
        );
        let made = std::process::Command::new("mkfifo").arg(&part).status();
        assert!(made.unwrap().success());
        let refused = |what: &str| {
            let error = GrowingFile::create(&path).unwrap_err().to_string();
            assert!(error.ends_with(what), "{error}");
            assert_eq!(names(folder.path())[..1], ["r.csv.part"]);
        };
        refused("r.csv.part, left there or being written: it is no regular file");
        std::fs::remove_file(&part).unwrap();
        std::fs::write(folder.path().join("theirs"), "rows").unwrap();
        std::os::unix::fs::symlink("theirs", &part).unwrap();
        refused("r.csv.part, left there or being written: it is a link");
        assert!(part.is_symlink());
    }

    #[test]
    fn a_part_that_is_replaced_is_no_result() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        for is_replaced in [false, true] {
            let mut file = GrowingFile::create(&path).unwrap();
            file.write_all(b"one\n").unwrap();
            std::fs::remove_file(file.part()).unwrap();
            if is_replaced {
                std::fs::write(file.part(), "two\n").unwrap();
            }
            let error = file.finish().unwrap_err().to_string();
            let expected = "r.csv.part has been removed or replaced by another process";
            assert!(error.ends_with(expected), "{error}");
        }
        assert_eq!(names(folder.path()), ["r.csv.part"]);
    }

    #[test]
    fn two_at_a_time_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.csv");
        let first = GrowingFile::create(&path).unwrap();
        let error = GrowingFile::create(&path).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::ResourceBusy);
        drop(first);
        let error = GrowingFile::create(folder.path()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::IsADirectory);
    }
}
