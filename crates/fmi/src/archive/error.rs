//! Why an archive is refused.

use std::io;
use std::path::PathBuf;
use thiserror::Error;
use zip::result::ZipError;

/// Why an archive is refused.
#[derive(Debug, Error)]
pub enum ArchiveError {
    /// The file cannot be opened.
    #[error("cannot open {}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is no zip file, or a damaged one.
    #[error("{} is no zip archive, or a damaged one", path.display())]
    NotAnArchive {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ZipError,
    },
    /// More entries than the limit.
    #[error("{} has {found} entries, more than the limit of {limit}", path.display())]
    TooManyEntries {
        /// The file.
        path: PathBuf,
        /// Number of entries.
        found: usize,
        /// Largest number allowed.
        limit: usize,
    },
    /// Unpacked, it would be larger than the limit.
    #[error("{} would unpack to {found} bytes, more than the limit of {limit}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Unpacked size \[bytes\].
        found: u64,
        /// Largest size allowed \[bytes\].
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
    /// An entry's name has empty parts or control characters.
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
    /// Two entries have one name, so that tools read different files.
    #[error("{}: entry `{entry}` is there twice", path.display())]
    DuplicateName {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
    },
    /// Two entries differ by upper and lower case alone: on Windows and macOS they are one file.
    #[error("{}: entries `{first}` and `{entry}` differ by upper and lower case alone; rename one of them", path.display())]
    CaseDuplicate {
        /// The file.
        path: PathBuf,
        /// Name of the first entry.
        first: String,
        /// Name of the second entry.
        entry: String,
    },
    /// An entry is a file, and another one lies in it as if it were a folder.
    #[error("{}: entry `{entry}` is a file, and `{inner}` would lie in it", path.display())]
    FileAsFolder {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
        /// Name of an entry in it.
        inner: String,
    },
    /// An entry's name, or a part of it, is longer than file systems allow.
    #[error("{}: the name of an entry has {found} bytes, more than the limit of {limit}: `{}...`", path.display(), begin.escape_debug())]
    NameTooLong {
        /// The file.
        path: PathBuf,
        /// Begin of the name.
        begin: String,
        /// Its length, or that of its longest part \[bytes\].
        found: usize,
        /// Largest length allowed \[bytes\].
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
    /// An entry is compressed by another method than those allowed.
    #[error("{}: entry `{entry}` is compressed by {method}; the standard allows `deflate` and `store`", path.display())]
    Method {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
        /// The method.
        method: String,
    },
    /// An entry has another name where it stands than in the archive's directory, so that tools read different
    /// files.
    #[error("{}: entry `{entry}` has another name where it stands: `{}`", path.display(), local.escape_debug())]
    LocalName {
        /// The file.
        path: PathBuf,
        /// Name of the entry in the directory.
        entry: String,
        /// Name where it stands.
        local: String,
    },
    /// An entry that is read as a whole is larger than the limit.
    #[error("{}: entry `{entry}` has {found} bytes, more than the limit of {limit}", path.display())]
    EntryTooLarge {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
        /// Its size \[bytes\].
        found: u64,
        /// Largest size allowed \[bytes\].
        limit: u64,
    },
    /// An entry cannot be read: its data are damaged, or its checksum is another one.
    #[error("{}: entry `{entry}` cannot be unpacked", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
        /// Why.
        source: io::Error,
    },
    /// An entry holds more bytes than the archive's directory says.
    #[error("{}: entry `{entry}` holds more than the {declared} bytes that the archive declares", path.display())]
    LyingSize {
        /// The file.
        path: PathBuf,
        /// Name of the entry.
        entry: String,
        /// Size in the directory \[bytes\].
        declared: u64,
    },
    /// An entry that is needed is not there.
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
        /// Why.
        source: io::Error,
    },
}
