//! Memory shared by two processes: one creates it, the other opens it by its [`Name`].
//!
//! A mapping of a file ends its process (SIGBUS) once somebody shortens the file. Where the system can, the memory is
//! therefore no file but sealed (`memfd_create`, `F_SEAL_SHRINK`): nobody can change its length. What is written there,
//! anybody may change.

use crate::folder::Folder;
use memmap2::{MmapOptions, MmapRaw};
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// By this the other process opens the memory, until it is dropped.
#[derive(Debug)]
pub struct Name {
    path: PathBuf,
    _held: Held,
}

/// What holds the memory until the other process has opened it.
#[derive(Debug)]
#[expect(dead_code, reason = "they are dropped")]
enum Held {
    Descriptor(File),
    Folder(Folder),
}

impl Name {
    /// The path to open.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Creates zeroed memory of that length \[bytes\].
///
/// # Errors
/// If there is no space for it: it is written in full, so overcommitted memory does not kill the process.
pub(crate) fn create(length: usize) -> io::Result<(MmapRaw, Name)> {
    // An old kernel, one that forbids such memory, or no /proc: a file does.
    sealed(length).or_else(|_| in_folder(length))
}

/// Memory of fixed length, which the other process finds among the descriptors of this one.
#[cfg(any(target_os = "linux", target_os = "android"))]
fn sealed(length: usize) -> io::Result<(MmapRaw, Name)> {
    use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, memfd_create};
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::MetadataExt;
    let flags = MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING;
    let mut file = File::from(memfd_create("pilotage-run-shared", flags)?);
    file.write_all(&vec![0; length])?;
    fcntl_add_seals(&file, SealFlags::SHRINK | SealFlags::GROW | SealFlags::SEAL)?;
    let path = format!("/proc/{}/fd/{}", std::process::id(), file.as_raw_fd());
    let path = PathBuf::from(path);
    // In a container, /proc may be that of other processes.
    let (own, found) = (file.metadata()?, open_file(&path)?.metadata()?);
    if (own.dev(), own.ino()) != (found.dev(), found.ino()) {
        return Err(io::ErrorKind::NotFound.into());
    }
    let map = MmapOptions::new().map_raw(&file)?;
    let _held = Held::Descriptor(file);
    Ok((map, Name { path, _held }))
}

#[cfg(not(any(target_os = "linux", target_os = "android")))]
fn sealed(_length: usize) -> io::Result<(MmapRaw, Name)> {
    Err(io::ErrorKind::Unsupported.into())
}

/// A file in a temporary folder.
fn in_folder(length: usize) -> io::Result<(MmapRaw, Name)> {
    let folder = Folder::create()?;
    let path = folder.path().join("shared");
    let mut file = (File::options().read(true).write(true))
        .create_new(true)
        .open(&path)?;
    file.write_all(&vec![0; length])?;
    let map = MmapOptions::new().map_raw(&file)?;
    let _held = Held::Folder(folder);
    Ok((map, Name { path, _held }))
}

fn open_file(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).open(path)
}

/// Opens the memory that another process has created, of that length \[bytes\].
///
/// # Errors
/// If it is not there, or has another length.
pub(crate) fn open(path: &Path, length: usize) -> io::Result<MmapRaw> {
    let file = open_file(path)?;
    let found = file.metadata()?.len();
    if found != length as u64 {
        let message = format!("{}: {found} bytes, expected {length}", path.display());
        return Err(io::Error::new(io::ErrorKind::InvalidData, message));
    }
    MmapOptions::new().map_raw(&file)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both kinds are opened by their names; of that which is sealed, nobody changes length or seals.
    #[test]
    fn the_other_side_finds_it_and_cannot_change_its_length() {
        for make in [create, in_folder] {
            let (map, name) = make(8192).unwrap();
            let other = open(name.path(), 8192).unwrap();
            // SAFETY: the byte is within both maps, and no other thread uses it.
            unsafe { map.as_mut_ptr().add(8191).write_volatile(7) };
            // SAFETY: as above.
            assert_eq!(unsafe { other.as_ptr().add(8191).read_volatile() }, 7);
            let wrong = open(name.path(), 8191).unwrap_err().to_string();
            assert!(wrong.ends_with(": 8192 bytes, expected 8191"), "{wrong}");
            let path = name.path().to_owned();
            drop(name);
            assert!(open(&path, 8192).is_err());
        }
        #[cfg(target_os = "linux")]
        {
            use rustix::fs::{SealFlags, fcntl_add_seals};
            let (_map, name) = create(8192).unwrap();
            let file = open_file(name.path()).unwrap();
            for length in [0, 1, 8191, 8193] {
                assert!(file.set_len(length).is_err(), "{length}");
            }
            assert!(fcntl_add_seals(&file, SealFlags::WRITE).is_err());
            // What is opened to be emptied stays as it is.
            let _ = File::create(name.path());
            assert_eq!(file.metadata().unwrap().len(), 8192);
        }
    }
}
