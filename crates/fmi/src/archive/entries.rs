//! The entries of an archive, treated as untrusted input.

use super::{ArchiveError, Limits};
use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

/// One entry of the archive.
#[derive(Debug)]
pub(super) struct Entry {
    /// Path with `/` as separator, without components `.`.
    pub(super) name: String,
    /// The name's bytes in the central directory, and the offset of the local header.
    pub(super) raw: Vec<u8>,
    pub(super) start: u64,
    pub(super) is_folder: bool,
    pub(super) declared: u64,
    pub(super) mode: Option<u32>,
}

/// Lists the entries; checks each of them and that they do not collide.
pub(super) fn list_entries(
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
        let written = raw.name().map_err(unreadable)?;
        check_length(path, &written, limits)?;
        let name = plain_name(&written);
        check_name(path, &name, &written)?;
        check_storage(path, &written, &raw)?;
        entries.push(Entry {
            is_folder: raw.is_dir() || name.is_empty() || name.ends_with('/'),
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

/// Checks that an entry is a plain file or folder, stored as required by the standard.
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

/// Checks that the name in each local header equals that in the central directory (APPNOTE 4.3.7).
pub(super) fn check_local_names(
    path: &Path,
    file: File,
    entries: &[Entry],
) -> Result<(), ArchiveError> {
    const LENGTH: usize = 26;
    const NAME: usize = 30;
    let mut file = BufReader::new(file);
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

/// Checks that no two entries map to the same file, here or on case-insensitive systems.
fn check_collisions(path: &Path, entries: &[Entry]) -> Result<(), ArchiveError> {
    let path = || path.to_owned();
    // By the lower-case name: the name, and whether it is a file.
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

/// The error without a wrapper that repeats its message.
pub(super) fn plain(error: ZipError) -> io::Error {
    match error {
        ZipError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// The normalised name: some tools write `\` for `/`, or a leading `./`.
pub fn plain_name(written: &str) -> String {
    let name = written.replace('\\', "/");
    let parts: Vec<&str> = name.split('/').filter(|part| *part != ".").collect();
    parts.join("/")
}

fn check_length(path: &Path, name: &str, limits: Limits) -> Result<(), ArchiveError> {
    let longest = name.split('/').map(str::len).max().unwrap_or(0);
    for (found, limit) in [(name.len(), limits.name), (longest, limits.part)] {
        if found > limit {
            let begin = name.chars().take(60).collect();
            return Err(ArchiveError::NameTooLong {
                path: path.to_owned(),
                begin,
                found,
                limit,
            });
        }
    }
    Ok(())
}

/// Checks that a name is a plain relative path; an empty one is the archive's root folder.
fn check_name(path: &Path, name: &str, written: &str) -> Result<(), ArchiveError> {
    let (path, entry) = (path.to_owned(), written.to_owned());
    Err(match name_fault(name) {
        None => return Ok(()),
        Some(NameFault::Absolute) => ArchiveError::AbsolutePath { path, entry },
        Some(NameFault::Traversal) => ArchiveError::Traversal { path, entry },
        Some(NameFault::Odd) => ArchiveError::BadName { path, entry },
    })
}

/// Why a name is not a plain relative path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NameFault {
    /// It leads out of the folder.
    Traversal,
    /// It starts at a root or a drive.
    Absolute,
    /// A component is empty or has control characters.
    Odd,
}

/// The fault of a [normalised](plain_name) name, if any; an empty name is the archive's root folder.
pub fn name_fault(name: &str) -> Option<NameFault> {
    let mut parts = name.strip_suffix('/').unwrap_or(name).split('/');
    let is_odd = |part: &str| part.is_empty() || part.contains(char::is_control);
    if parts.clone().any(|part| part == "..") {
        Some(NameFault::Traversal)
    } else if name.starts_with('/') || name.as_bytes().get(1) == Some(&b':') {
        Some(NameFault::Absolute)
    } else if !name.is_empty() && parts.any(is_odd) {
        Some(NameFault::Odd)
    } else {
        None
    }
}

/// The first name that occurs twice in the central directory. `ZipArchive` detects duplicates but keeps each name only
/// once.
pub(super) fn first_duplicate(mut file: File, directory_start: u64) -> Option<String> {
    const HEADER: usize = 46;
    let mut bytes = Vec::new();
    file.rewind().ok()?;
    file.read_to_end(&mut bytes).ok()?;
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
