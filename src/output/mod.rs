//! Files that appear complete or not at all ([`Output`]), or grow beside their place until they are
//! complete ([`GrowingFile`]).

mod growing;

pub use growing::GrowingFile;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// An output that is opened before long work and put in its place at the end.
///
/// Until [`save`](Self::save) nothing stands at the path, or the file that stood there before.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    file: NamedTempFile,
}

impl Output {
    /// Opens a temporary file beside `path`, so that a wrong folder shows before the work is done.
    ///
    /// # Errors
    /// When the folder does not exist or cannot be written, or when `path` is a folder.
    pub fn create(path: &Path) -> io::Result<Self> {
        // Before tempfile, whose message would name the temporary file.
        let folder = folder_of(path)?;
        let mut builder = tempfile::Builder::new();
        builder.prefix(".pilotage-");
        // As any program's output: readable by whom the user's umask allows, not by the user alone.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        Ok(Self {
            path: path.to_owned(),
            file: builder.tempfile_in(folder)?,
        })
    }

    /// Writes the content and puts the file in its place.
    ///
    /// # Errors
    /// When the content cannot be written; what stood at the path before is still there.
    pub fn save(mut self, content: &[u8]) -> io::Result<()> {
        self.file.write_all(content)?;
        self.finish()
    }

    /// Puts what was written so far in its place.
    ///
    /// # Errors
    /// When the file cannot be renamed; what stood at the path before is still there.
    pub fn finish(mut self) -> io::Result<()> {
        self.file.flush()?;
        self.file.persist(&self.path).map_err(|error| error.error)?;
        Ok(())
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// The folder of a file to be written.
fn folder_of(path: &Path) -> io::Result<&Path> {
    if path.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    std::fs::metadata(folder)?;
    Ok(folder)
}

/// Writes a whole file at once: see [`Output`].
///
/// # Errors
/// As [`Output::create`] and [`Output::save`].
pub fn write(path: &Path, content: &[u8]) -> io::Result<()> {
    Output::create(path)?.save(content)
}
