//! Errors of archives.

use std::io;
use std::path::PathBuf;
use thiserror::Error;
use zip::result::ZipError;

/// Why an archive is rejected.
#[derive(Debug, Error)]
pub enum ArchiveError {
    /// The file cannot be opened.
    #[error("cannot open {}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// It is not a zip file, or is damaged.
    #[error("{} is no zip archive, or a damaged one (copy it again, or name another file)", path.display())]
    NotAnArchive {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: ZipError,
    },
    /// More entries than the limit.
    #[error("{} has {found} entries, more than the limit of {limit}", path.display())]
    TooManyEntries {
        /// The file.
        path: PathBuf,
        /// Number of entries.
        found: usize,
        /// Maximum number.
        limit: usize,
    },
    /// Its unpacked size is larger than the limit.
    #[error("{} would unpack to {found} bytes, more than the limit of {limit}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Unpacked size \[bytes\].
        found: u64,
        /// Maximum size \[bytes\].
        limit: u64,
    },
    /// An entry would be written outside the folder.
    #[error("{}: entry `{entry}` leaves the archive's folder by `..`; nothing was unpacked", path.display())]
    Traversal {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
    },
    /// An entry has an absolute path.
    #[error("{}: entry `{entry}` has an absolute path; nothing was unpacked", path.display())]
    AbsolutePath {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
    },
    /// An entry's name has empty components or control characters.
    #[error("{}: entry `{}` is not a file name", path.display(), entry.escape_debug())]
    BadName {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
    },
    /// An entry is a link.
    #[error("{}: entry `{entry}` is a link; nothing was unpacked", path.display())]
    Link {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
    },
    /// Two entries have the same name: tools would read different files.
    #[error("{}: entry `{entry}` is there twice", path.display())]
    DuplicateName {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
    },
    /// Two entries differ only in case: on Windows and macOS they are one file.
    #[error("{}: entries `{first}` and `{entry}` differ by upper and lower case alone; rename one of them", path.display())]
    CaseDuplicate {
        /// The file.
        path: PathBuf,
        /// Name of the first entry.
        first: String,
        /// Name of the second entry.
        entry: String,
    },
    /// An entry is a file, but another entry lies in it as in a folder.
    #[error("{}: entry `{entry}` is a file, and `{inner}` would lie in it", path.display())]
    FileAsFolder {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
        /// Name of the entry in it.
        inner: String,
    },
    /// An entry's name, or a component of it, is longer than file systems allow.
    #[error("{}: the name of an entry has {found} bytes, more than the limit of {limit}: `{}...`", path.display(), begin.escape_debug())]
    NameTooLong {
        /// The file.
        path: PathBuf,
        /// Beginning of the name.
        begin: String,
        /// Its length, or that of its longest component \[bytes\].
        found: usize,
        /// Maximum length \[bytes\].
        limit: usize,
    },
    /// An entry is encrypted.
    #[error("{}: entry `{entry}` is encrypted; FMUs must not be", path.display())]
    Encrypted {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
    },
    /// An entry is compressed by a method that is not allowed.
    #[error("{}: entry `{entry}` is compressed by {method}; the standard allows `deflate` and `store`", path.display())]
    Method {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
        /// The method.
        method: String,
    },
    /// An entry's local header has another name than the central directory: tools would read different files.
    #[error("{}: entry `{entry}` has another name where it stands: `{}`", path.display(), local.escape_debug())]
    LocalName {
        /// The file.
        path: PathBuf,
        /// Name of the entry in the central directory.
        entry: String,
        /// Name in the local header.
        local: String,
    },
    /// An entry to be read into memory is larger than the limit.
    #[error("{}: entry `{entry}` has {found} bytes, more than the limit of {limit}", path.display())]
    EntryTooLarge {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
        /// Its size \[bytes\].
        found: u64,
        /// Maximum size \[bytes\].
        limit: u64,
    },
    /// An entry cannot be read: its data are damaged, or its checksum is wrong.
    #[error("{}: entry `{entry}` cannot be unpacked", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
        /// The cause.
        source: io::Error,
    },
    /// An entry contains more bytes than the central directory declares.
    #[error("{}: entry `{entry}` holds more than the {declared} bytes that the archive declares", path.display())]
    LyingSize {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
        /// Size in the central directory \[bytes\].
        declared: u64,
    },
    /// A required entry is missing.
    #[error("{} has no {entry}: it is not an FMU", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
    },
    /// An unpacked file cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file being written.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
}
