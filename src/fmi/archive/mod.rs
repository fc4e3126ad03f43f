//! The zip file that an FMU is: opened with mistrust, unpacked into a folder of its own.
//!
//! Everything is checked on opening, before a single byte is written: names that would leave the
//! folder, links, duplicates, and sizes beyond the [`Limits`].

mod error;

pub use error::ArchiveError;

use std::collections::{HashMap, HashSet};
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

/// Name of the description in the archive.
pub const DESCRIPTION: &str = "modelDescription.xml";

/// How large an FMU may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Number of entries.
    pub entries: usize,
    /// Unpacked size of all entries together [bytes].
    pub bytes: u64,
    /// Size of an entry that [`Archive::read`] reads as a whole [bytes].
    pub read: u64,
    /// Length of a name [bytes].
    pub name: usize,
    /// Length of a part of a name between `/` [bytes].
    pub part: usize,
}

impl Default for Limits {
    /// 100,000 entries and 2 GiB; 256 MiB to be read at once; names that Linux and macOS can hold.
    fn default() -> Self {
        Self {
            entries: 100_000,
            bytes: 2 << 30,
            read: 256 << 20,
            name: 2048,
            part: 255,
        }
    }
}

/// An FMU's archive, checked.
#[derive(Debug)]
pub struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
    entries: Vec<Entry>,
    limits: Limits,
}

/// One entry of the archive.
#[derive(Debug)]
struct Entry {
    name: String,
    /// The name's bytes in the directory, and where the entry stands.
    raw: Vec<u8>,
    start: u64,
    is_folder: bool,
    declared: u64,
    mode: Option<u32>,
}

impl Archive {
    /// Opens an archive and checks all its entries.
    ///
    /// # Errors
    /// See [`ArchiveError`]; a missing modelDescription.xml is among them.
    pub fn open(path: &Path, limits: Limits) -> Result<Self, ArchiveError> {
        let owned = path.to_owned();
        let file = File::open(path).map_err(|source| ArchiveError::Open {
            path: owned.clone(),
            source,
        })?;
        let not_an_archive = |source| ArchiveError::NotAnArchive {
            path: owned.clone(),
            source,
        };
        let mut zip = ZipArchive::new(BufReader::new(file)).map_err(not_an_archive)?;
        if zip.len() > limits.entries {
            return Err(ArchiveError::TooManyEntries {
                path: owned,
                found: zip.len(),
                limit: limits.entries,
            });
        }
        if zip.has_duplicate_names() {
            let entry = first_duplicate(path, zip.central_directory_start()).unwrap_or_default();
            return Err(ArchiveError::DuplicateName { path: owned, entry });
        }
        let entries = list_entries(path, &mut zip, limits)?;
        check_local_names(path, &entries)?;
        let found = entries
            .iter()
            .map(|e| e.declared)
            .fold(0, u64::saturating_add);
        if found > limits.bytes {
            return Err(ArchiveError::TooLarge {
                path: owned,
                found,
                limit: limits.bytes,
            });
        }
        let archive = Self {
            path: owned,
            zip,
            entries,
            limits,
        };
        archive.position(DESCRIPTION)?;
        Ok(archive)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of all files in the archive, in its order.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        let files = self.entries.iter().filter(|e| !e.is_folder);
        files.map(|e| e.name.as_str())
    }

    /// The content of a file.
    ///
    /// # Errors
    /// If it is missing, damaged or too large.
    pub fn read(&mut self, name: &str) -> Result<Vec<u8>, ArchiveError> {
        let index = self.position(name)?;
        let found = self.entries[index].declared;
        if found > self.limits.read {
            return Err(ArchiveError::EntryTooLarge {
                path: self.path.clone(),
                entry: name.to_owned(),
                found,
                limit: self.limits.read,
            });
        }
        let mut bytes = Vec::new();
        self.copy(index, &mut bytes)?;
        Ok(bytes)
    }

    /// Unpacks everything into a new temporary folder, which lives as long as what is returned.
    ///
    /// # Errors
    /// If an entry is damaged, or the folder cannot be written.
    pub fn unpack(&mut self) -> Result<TempDir, ArchiveError> {
        let write_error = |path: &Path| {
            let path = path.to_owned();
            move |source| ArchiveError::Write { path, source }
        };
        let folder = tempfile::Builder::new()
            .prefix("pilotage-fmu-")
            .tempdir()
            .map_err(write_error(&std::env::temp_dir()))?;
        for index in 0..self.entries.len() {
            let entry = &self.entries[index];
            let target = folder.path().join(&entry.name);
            let parent = match entry.is_folder {
                true => Some(target.as_path()),
                false => target.parent(),
            };
            if let Some(parent) = parent {
                fs::create_dir_all(parent).map_err(write_error(parent))?;
            }
            if entry.is_folder {
                continue;
            }
            let mode = entry.mode;
            let mut file = File::create_new(&target).map_err(write_error(&target))?;
            self.copy(index, &mut file)?;
            keep_executable(&file, mode).map_err(write_error(&target))?;
        }
        Ok(folder)
    }

    fn position(&self, name: &str) -> Result<usize, ArchiveError> {
        let found = self.entries.iter().position(|e| e.name == name);
        found.ok_or_else(|| ArchiveError::Missing {
            path: self.path.clone(),
            entry: name.to_owned(),
        })
    }

    /// Unpacks an entry, and not one byte more than it declares.
    fn copy(&mut self, index: usize, to: &mut impl io::Write) -> Result<(), ArchiveError> {
        let entry = &self.entries[index];
        let unreadable = |source| ArchiveError::Unreadable {
            path: self.path.clone(),
            entry: entry.name.clone(),
            source,
        };
        let file = self.zip.by_index(index).map_err(|e| unreadable(plain(e)))?;
        let written = io::copy(&mut file.take(entry.declared + 1), to).map_err(unreadable)?;
        if written > entry.declared {
            return Err(ArchiveError::LyingSize {
                path: self.path.clone(),
                entry: entry.name.clone(),
                declared: entry.declared,
            });
        }
        Ok(())
    }
}

fn list_entries(
    path: &Path,
    zip: &mut ZipArchive<BufReader<File>>,
    limits: Limits,
) -> Result<Vec<Entry>, ArchiveError> {
    let mut entries = Vec::with_capacity(zip.len());
    for index in 0..zip.len() {
        let unreadable = |source| ArchiveError::Unreadable {
            path: path.to_owned(),
            entry: format!("#{index}"),
            source: plain(source),
        };
        let raw = zip.by_index_raw(index).map_err(unreadable)?;
        let name = raw.name().map_err(unreadable)?.into_owned();
        check_name(path, &name, limits)?;
        check_storage(path, &name, &raw)?;
        entries.push(Entry {
            is_folder: raw.is_dir(),
            declared: raw.size(),
            mode: raw.unix_mode(),
            raw: raw.name_raw().to_vec(),
            start: raw.header_start(),
            name,
        });
    }
    check_collisions(path, &entries)?;
    Ok(entries)
}

/// Whether an entry is a plain file or folder, stored as the standard wants.
fn check_storage<R: Read>(
    path: &Path,
    name: &str,
    raw: &zip::read::ZipFile<'_, R>,
) -> Result<(), ArchiveError> {
    let (path, entry) = (path.to_owned(), name.to_owned());
    if raw.is_symlink() {
        return Err(ArchiveError::Link { path, entry });
    }
    if raw.encrypted() {
        return Err(ArchiveError::Encrypted { path, entry });
    }
    match raw.compression() {
        CompressionMethod::Stored | CompressionMethod::Deflated => Ok(()),
        method => Err(ArchiveError::Method {
            path,
            entry,
            method: method.to_string(),
        }),
    }
}

/// Whether each entry has the name of the directory where it stands, too (APPNOTE 4.3.7).
fn check_local_names(path: &Path, entries: &[Entry]) -> Result<(), ArchiveError> {
    const LENGTH: usize = 26;
    const NAME: usize = 30;
    let open_error = |source| ArchiveError::Open {
        path: path.to_owned(),
        source,
    };
    let mut file = BufReader::new(File::open(path).map_err(open_error)?);
    for entry in entries {
        let unreadable = |source| ArchiveError::Unreadable {
            path: path.to_owned(),
            entry: entry.name.clone(),
            source,
        };
        let mut header = [0; NAME];
        file.seek(SeekFrom::Start(entry.start))
            .map_err(unreadable)?;
        file.read_exact(&mut header).map_err(unreadable)?;
        let length = u16::from_le_bytes([header[LENGTH], header[LENGTH + 1]]);
        let mut local = vec![0; length.into()];
        file.read_exact(&mut local).map_err(unreadable)?;
        if local != entry.raw {
            return Err(ArchiveError::LocalName {
                path: path.to_owned(),
                entry: entry.name.clone(),
                local: String::from_utf8_lossy(&local).into_owned(),
            });
        }
    }
    Ok(())
}

/// Whether no two entries would be one file, here or on systems that do not tell upper from lower case.
fn check_collisions(path: &Path, entries: &[Entry]) -> Result<(), ArchiveError> {
    let path = || path.to_owned();
    // By the folded name: the name, and whether it is a file.
    let mut seen: HashMap<String, (&str, bool)> = HashMap::new();
    for entry in entries {
        let name = entry.name.trim_end_matches('/');
        let here = (name, !entry.is_folder);
        match seen.insert(name.to_lowercase(), here) {
            None => {}
            Some((first, _)) if first == name => {
                return Err(ArchiveError::DuplicateName {
                    path: path(),
                    entry: entry.name.clone(),
                });
            }
            Some((first, _)) => {
                return Err(ArchiveError::CaseDuplicate {
                    path: path(),
                    first: first.to_owned(),
                    entry: entry.name.clone(),
                });
            }
        }
    }
    for entry in entries {
        let folded = entry.name.trim_end_matches('/').to_lowercase();
        let folders = folded.match_indices('/').map(|(at, _)| &folded[..at]);
        for folder in folders {
            if let Some((file, true)) = seen.get(folder) {
                return Err(ArchiveError::FileAsFolder {
                    path: path(),
                    entry: (*file).to_owned(),
                    inner: entry.name.clone(),
                });
            }
        }
    }
    Ok(())
}

/// The error without a wrapping that says it twice.
fn plain(error: ZipError) -> io::Error {
    match error {
        ZipError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// Whether a name is a plain relative path with `/` between its parts.
fn check_name(path: &Path, name: &str, limits: Limits) -> Result<(), ArchiveError> {
    let path = path.to_owned();
    let longest = name.split('/').map(str::len).max().unwrap_or(0);
    for (found, limit) in [(name.len(), limits.name), (longest, limits.part)] {
        if found > limit {
            let begin = name.chars().take(60).collect();
            return Err(ArchiveError::NameTooLong {
                path,
                begin,
                found,
                limit,
            });
        }
    }
    let entry = name.to_owned();
    let has_drive = name.as_bytes().get(1) == Some(&b':');
    if name.contains('\\') {
        return Err(ArchiveError::Backslash { path, entry });
    }
    if name.starts_with('/') || has_drive {
        return Err(ArchiveError::AbsolutePath { path, entry });
    }
    let mut parts = name.strip_suffix('/').unwrap_or(name).split('/');
    if parts.clone().any(|part| part == "..") {
        return Err(ArchiveError::Traversal { path, entry });
    }
    if parts.any(|part| part.is_empty() || part == "." || part.chars().any(char::is_control)) {
        return Err(ArchiveError::BadName { path, entry });
    }
    Ok(())
}

/// The first name that stands twice in the central directory. `ZipArchive` knows that there is one,
/// but keeps each name once.
fn first_duplicate(path: &Path, directory_start: u64) -> Option<String> {
    const HEADER: usize = 46;
    let bytes = fs::read(path).ok()?;
    let mut rest = bytes.get(usize::try_from(directory_start).ok()?..)?;
    let mut seen = HashSet::new();
    while rest.starts_with(b"PK\x01\x02") {
        let length = |at| {
            Some(usize::from(u16::from_le_bytes([
                *rest.get(at)?,
                *rest.get(at + 1)?,
            ])))
        };
        // Lengths of the name, the extra field and the comment (APPNOTE 4.3.12).
        let (name, extra, comment) = (length(28)?, length(30)?, length(32)?);
        let text = rest.get(HEADER..HEADER + name)?;
        if !seen.insert(text) {
            return Some(String::from_utf8_lossy(text).into_owned());
        }
        rest = rest.get(HEADER + name + extra + comment..)?;
    }
    None
}

/// Gives a file the right to be run that it has in the archive: some FMUs start helpers.
#[cfg(unix)]
fn keep_executable(file: &File, mode: Option<u32>) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    match mode {
        Some(mode) if mode & 0o100 != 0 => file.set_permissions(fs::Permissions::from_mode(0o700)),
        _ => Ok(()),
    }
}

#[cfg(not(unix))]
fn keep_executable(_file: &File, _mode: Option<u32>) -> io::Result<()> {
    Ok(())
}
