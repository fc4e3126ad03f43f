//! Files that appear complete or not at all ([`AtomicFile`]), or grow beside their place until they are
//! complete ([`GrowingFile`]); and whether they may ([`check`]).

mod growing;
mod guard;

pub use growing::GrowingFile;
pub use guard::{Planned, Refusal, check};

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// An output that is opened before long work and put in its place at the end.
///
/// Until [`save`](Self::save) nothing stands at the path, or the file that stood there before. A link keeps
/// its place: the file to which it leads is written. A device or a pipe is written straight.
#[derive(Debug)]
pub struct AtomicFile(Place);

#[derive(Debug)]
enum Place {
    /// A temporary file, and its name when it is complete.
    Beside(NamedTempFile, PathBuf),
    Straight(File),
}

impl AtomicFile {
    /// Opens a temporary file beside `path`, so that a wrong folder shows before the work is done.
    ///
    /// # Errors
    /// When the folder does not exist or cannot be written, or when `path` is a folder.
    pub fn create(path: &Path) -> io::Result<Self> {
        if let Some(device) = device(path)? {
            return Ok(Self(Place::Straight(device)));
        }
        // Before tempfile, whose message would name the temporary file.
        let path = place(path)?;
        let mut builder = tempfile::Builder::new();
        builder.prefix(".pilotage-");
        // As any program's output: readable by whom the user's umask allows, not by the user alone.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.tempfile_in(guard::parent(&path))?;
        Ok(Self(Place::Beside(file, path)))
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
        if let Place::Beside(file, path) = self.0 {
            file.persist(&path).map_err(|error| error.error)?;
        }
        Ok(())
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.0 {
            Place::Beside(file, _) => file.write(bytes),
            Place::Straight(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.0 {
            Place::Beside(file, _) => file.flush(),
            Place::Straight(file) => file.flush(),
        }
    }
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
