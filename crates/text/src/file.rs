//! Files, opened such that no path stops or exhausts the program, whatever is at it.
//!
//! | who chose the path | function | what is opened |
//! | --- | --- | --- |
//! | the user, to be read | [`open`], [`bytes`], [`text`] | anything, at most [`LIMIT`] bytes of it |
//! | the user, to be looked at first | [`regular`], [`peek`] | files alone, also through links |
//! | nobody: it was found | [`found`] | files alone, through no link |
//!
//! A pipe that a user names, such as `<(...)`, is read as far as the limit; opening a named pipe waits until another
//! program writes to it, as with any command. The other two functions never wait.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read, Take};
use std::path::Path;

/// Maximum number of bytes read from one file, device or pipe: 1 GiB.
pub const LIMIT: u64 = 1 << 30;

/// A file that is read up to a limit; beyond it, a read fails.
#[derive(Debug)]
pub struct Input<R = File> {
    from: R,
    left: u64,
}

impl<R: Read> Input<R> {
    /// Reads at most [`LIMIT`] bytes from an open source.
    pub fn of(from: R) -> Self {
        Self { from, left: LIMIT }
    }
}

impl<R: Read> Input<R> {
    /// Reads by `read` at most one byte more than permitted, which tells a source that is too long from one that ends at
    /// the limit.
    fn limited(
        &mut self,
        read: impl FnOnce(&mut Take<&mut R>) -> io::Result<usize>,
    ) -> io::Result<usize> {
        let count = read(&mut self.from.by_ref().take(self.left + 1))?;
        self.left = self.left.checked_sub(count as u64).ok_or_else(too_long)?;
        Ok(count)
    }
}

/// The whole is read as the source itself does it, in memory that need not be initialised.
impl<R: Read> Read for Input<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        self.limited(|from| from.read(to))
    }

    fn read_to_end(&mut self, to: &mut Vec<u8>) -> io::Result<usize> {
        self.limited(|from| from.read_to_end(to))
    }

    fn read_to_string(&mut self, to: &mut String) -> io::Result<usize> {
        self.limited(|from| from.read_to_string(to))
    }
}

fn too_long() -> io::Error {
    let why = format!(
        "more than {} GiB, the most that is read of one file; cut it, record less often, or name a file that ends",
        LIMIT >> 30
    );
    io::Error::new(ErrorKind::FileTooLarge, why)
}

/// Opens what the user named, to read it.
///
/// # Errors
/// If it cannot be opened or is longer than [`LIMIT`]. If the length shows only while reading, reading fails.
pub fn open(path: &Path) -> io::Result<Input> {
    let file = File::open(path)?;
    match file.metadata()?.len() > LIMIT {
        true => Err(too_long()),
        false => Ok(Input::of(file)),
    }
}

/// The content of what the user named.
///
/// # Errors
/// If it cannot be read or is longer than [`LIMIT`].
pub fn bytes(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of what the user named.
///
/// # Errors
/// If it cannot be read, is longer than [`LIMIT`], or is not UTF-8.
pub fn text(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    open(path)?.read_to_string(&mut text)?;
    Ok(text)
}

/// Opens a regular file, without waiting: to look at a file that something else will read or replace.
///
/// # Errors
/// If it cannot be opened, or is no regular file.
pub fn regular(path: &Path) -> io::Result<File> {
    at_once(OpenOptions::new().read(true), path, false)
}

/// The text of a regular file, without waiting.
///
/// # Errors
/// If it cannot be read, is no regular file, is longer than [`LIMIT`], or is not UTF-8.
pub fn peek(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    Input::of(regular(path)?).read_to_string(&mut text)?;
    Ok(text)
}

/// Opens a regular file at a path that nobody named, without waiting and without following a link.
///
/// # Errors
/// If it cannot be opened, or is no regular file.
pub fn found(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    if path.is_symlink() {
        return Err(io::Error::other("it is a link"));
    }
    at_once(options, path, true)
}

fn at_once(options: &mut OpenOptions, path: &Path, is_found: bool) -> io::Result<File> {
    // The flags hold where somebody else replaces the file at this moment.
    #[cfg(unix)]
    {
        use rustix::fs::OFlags;
        let flags = match is_found {
            true => OFlags::NONBLOCK | OFlags::NOFOLLOW,
            false => OFlags::NONBLOCK,
        };
        std::os::unix::fs::OpenOptionsExt::custom_flags(options, flags.bits().cast_signed());
    }
    #[cfg(not(unix))]
    let _ = is_found;
    let no_file = || io::Error::other("it is no regular file");
    // A pipe that nobody reads and a socket cannot even be opened; the system's words would not say why.
    if std::fs::metadata(path).is_ok_and(|about| !about.is_file()) {
        return Err(no_file());
    }
    let file = options.open(path)?;
    match file.metadata()?.is_file() {
        true => Ok(file),
        false => Err(no_file()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::BufReader;

    #[test]
    fn a_source_is_read_to_its_limit_and_no_further() {
        let read = |length: u64, left: u64| {
            let mut to = Vec::new();
            let from = io::repeat(7).take(length);
            let read = Input { from, left }.read_to_end(&mut to);
            let from = io::repeat(7).take(length);
            let mut pieces = BufReader::with_capacity(3, Input { from, left });
            let in_pieces = io::copy(&mut pieces, &mut io::sink());
            let in_pieces = in_pieces.map(|count| count as usize);
            let both = [read, in_pieces].map(|read| read.map_err(|error| error.kind()));
            assert_eq!(both[0], both[1]);
            both[0]
        };
        assert_eq!(read(10, 10), Ok(10));
        assert_eq!(read(11, 10), Err(ErrorKind::FileTooLarge));
        assert_eq!(read(u64::MAX, 100_000), Err(ErrorKind::FileTooLarge));
    }

    /// A sparse file: it takes no room, and nothing of it is read.
    #[test]
    fn a_file_that_is_too_long_is_not_read() {
        let file = tempfile::NamedTempFile::new().unwrap();
        file.as_file().set_len(LIMIT + 1).unwrap();
        for error in [bytes(file.path()).map(drop), text(file.path()).map(drop)] {
            let error = error.unwrap_err();
            assert_eq!(error.kind(), ErrorKind::FileTooLarge);
            assert!(error.to_string().starts_with("more than 1 GiB"), "{error}");
        }
    }

    /// Nothing here waits: a pipe without a writer would do so for ever.
    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_refused_at_once() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("file"), "text").unwrap();
        std::fs::create_dir(at("folder")).unwrap();
        symlink("file", at("link")).unwrap();
        symlink("pipe", at("link-to-pipe")).unwrap();
        let made = std::process::Command::new("mkfifo")
            .arg(at("pipe"))
            .status();
        assert!(made.unwrap().success());
        let _socket = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
        let looked = |name: &str| regular(&at(name)).is_ok();
        let opened =
            |name: &str| found(OpenOptions::new().read(true).write(true), &at(name)).is_ok();
        assert!(looked("file") && opened("file"));
        assert!(looked("link") && !opened("link"));
        for name in ["folder", "pipe", "socket", "link-to-pipe", "none"] {
            assert!(!looked(name) && !opened(name), "{name}");
        }
        let error = regular(&at("socket")).unwrap_err().to_string();
        assert_eq!(error, "it is no regular file");
    }
}
