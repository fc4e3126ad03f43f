//! An FMU's zip archive, treated as untrusted input and unpacked into a separate folder. A folder with an unpacked FMU
//! is read as the equivalent archive.
//!
//! Everything is checked on opening, before any byte is written: names that would leave the folder, links, duplicates,
//! and sizes beyond the [`Limits`].

mod entries;
mod error;
pub mod folder;

pub use entries::{NameFault, name_fault, plain_name};
pub use error::ArchiveError;

use self::entries::{Entry, check_local_names, first_duplicate, list_entries, plain};
use pilotage_process::Folder;
use std::fs::{self, File};
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// Name of the description in the archive.
pub const DESCRIPTION: &str = "modelDescription.xml";

/// Folders that a running FMU does not need (FMI 2.0.4, section 2.3; FMI 3.0.2, section 2.5).
const AT_REST: [&str; 2] = ["documentation", "sources"];

/// Maximum sizes of an FMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Number of entries.
    pub entries: usize,
    /// Total unpacked size of all entries \[bytes\].
    pub bytes: u64,
    /// Size of an entry that [`Archive::read`] reads into memory \[bytes\].
    pub read: u64,
    /// Length of a name \[bytes\].
    pub name: usize,
    /// Length of a path component of a name \[bytes\].
    pub part: usize,
}

impl Default for Limits {
    /// 100,000 entries and 2 GiB; 256 MiB read into memory; names that Linux and macOS support.
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

impl Limits {
    /// Checks the number of entries and their total size.
    fn check(&self, path: &Path, entries: usize, bytes: u64) -> Result<(), ArchiveError> {
        let path = path.to_owned();
        if entries > self.entries {
            let (found, limit) = (entries, self.entries);
            return Err(ArchiveError::TooManyEntries { path, found, limit });
        }
        if bytes > self.bytes {
            let (found, limit) = (bytes, self.bytes);
            return Err(ArchiveError::TooLarge { path, found, limit });
        }
        Ok(())
    }
}

/// An FMU's archive, checked.
#[derive(Debug)]
pub struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
    entries: Vec<Entry>,
    limits: Limits,
    /// Folders that are not unpacked.
    at_rest: &'static [&'static str],
}

impl Archive {
    /// Opens an archive, or a folder as one, and checks all its entries.
    ///
    /// # Errors
    /// See [`ArchiveError`]; includes a missing modelDescription.xml.
    pub fn open(path: &Path, limits: Limits) -> Result<Self, ArchiveError> {
        let mut archive = Self::of_any(path, limits)?;
        archive.position(DESCRIPTION)?;
        archive.at_rest = &AT_REST;
        Ok(archive)
    }

    /// As [`open`](Self::open), for an archive of another kind, of which all files are unpacked.
    ///
    /// # Errors
    /// See [`ArchiveError`].
    pub fn of_any(path: &Path, limits: Limits) -> Result<Self, ArchiveError> {
        let owned = path.to_owned();
        let open_error = |source| ArchiveError::Open {
            path: owned.clone(),
            source,
        };
        let file = folder::open(path, limits)?;
        let second = file.try_clone().map_err(open_error)?;
        let not_an_archive = |source| ArchiveError::NotAnArchive {
            path: owned.clone(),
            source,
        };
        let mut zip = ZipArchive::new(BufReader::new(file)).map_err(not_an_archive)?;
        limits.check(path, zip.len(), 0)?;
        if zip.has_duplicate_names() {
            let entry = first_duplicate(second, zip.central_directory_start()).unwrap_or_default();
            return Err(ArchiveError::DuplicateName { path: owned, entry });
        }
        let entries = list_entries(path, &mut zip, limits)?;
        check_local_names(path, second, &entries)?;
        let declared = entries.iter().map(|e| e.declared);
        limits.check(path, entries.len(), declared.fold(0, u64::saturating_add))?;
        Ok(Self {
            path: owned,
            zip,
            entries,
            limits,
            at_rest: &[],
        })
    }

    /// The file or folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of all files in the archive, in archive order.
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

    /// The files that cannot be unpacked, each with the reason: they are damaged or their declared size is wrong.
    pub fn damaged(&mut self) -> Vec<(String, ArchiveError)> {
        let all = 0..self.entries.len();
        let faults = all.filter_map(|index| {
            let is_file = !self.entries[index].is_folder;
            let error = is_file.then(|| self.copy(index, &mut io::sink()).err())??;
            Some((self.entries[index].name.clone(), error))
        });
        faults.collect()
    }

    /// Number of entries, including folders.
    pub fn entries(&self) -> usize {
        self.entries.len()
    }

    /// Unpacks the files that a running FMU may need into a new temporary folder, which is removed when the result is
    /// dropped: all except `sources` and `documentation`, in which some tools write hundreds of files.
    ///
    /// # Errors
    /// If an entry is damaged, or the folder cannot be written.
    pub fn unpack(&mut self) -> Result<Unpacked, ArchiveError> {
        let write_error = |path: &Path| {
            let path = path.to_owned();
            move |source| ArchiveError::Write { path, source }
        };
        let folder = Unpacked::create().map_err(write_error(&std::env::temp_dir()))?;
        for index in 0..self.entries.len() {
            let entry = &self.entries[index];
            let first = entry.name.split('/').next().unwrap_or_default();
            if self.at_rest.contains(&first) {
                continue;
            }
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

    /// Unpacks an entry, at most the number of bytes that it declares.
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

/// A temporary folder with an unpacked FMU.
#[derive(Debug)]
pub struct Unpacked {
    /// `None` if the caller keeps the folder.
    _folder: Option<Folder>,
    path: PathBuf,
}

impl Unpacked {
    fn create() -> io::Result<Self> {
        let folder = Folder::create()?;
        let path = folder.path().join("fmu");
        fs::create_dir(&path)?;
        Ok(Self {
            _folder: Some(folder),
            path,
        })
    }

    /// A folder into which the caller has unpacked the FMU; it is not removed.
    pub fn of_others(path: PathBuf) -> Self {
        Self {
            _folder: None,
            path,
        }
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Makes a file executable if it is so in the archive: some FMUs start helper programs.
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
