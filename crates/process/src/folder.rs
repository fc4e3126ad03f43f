//! Temporary folders that do not outlive their process for long, however it ends.
//!
//! Each has its process ID in its name and holds a file `lock` that the process keeps locked. A folder whose process
//! has ended and whose lock is free is a leftover: the first folder that a process creates removes all leftovers.

use crate::child::is_alive;
use crate::leftovers::{self, Kind, Leftover};
use pilotage_text::file;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::Once;
use std::time::Duration;
use tempfile::TempDir;

/// Prefix of the names of these folders.
const PREFIX: &str = "pilotage-run-";

/// A temporary folder that only its user can access.
#[derive(Debug)]
pub struct Folder {
    // Windows removes no folder in which a file is open.
    #[cfg(windows)]
    _lock: File,
    // Fields drop in this order, so that no process takes the folder for a leftover before it is removed.
    folder: TempDir,
    _leftover: Leftover,
    #[cfg(not(windows))]
    _lock: File,
}

impl Folder {
    /// Creates a folder, and removes those that dead processes left.
    ///
    /// # Errors
    /// If it cannot be created.
    pub fn create() -> io::Result<Self> {
        static SWEPT: Once = Once::new();
        SWEPT.call_once(sweep);
        let mut builder = tempfile::Builder::new();
        let prefix = format!("{PREFIX}{}-", std::process::id());
        builder.prefix(&prefix);
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o700));
        let make = || {
            let folder = builder.tempdir()?;
            let lock = File::create_new(folder.path().join("lock"))?;
            // On a file system without locks, other processes' folders are never free, and stay.
            let _ = lock.try_lock();
            Ok((folder, lock))
        };
        let kind = |(folder, _): &(TempDir, File)| Kind::Folder(folder.path().to_owned());
        let ((folder, lock), leftover) = leftovers::make(make, kind)?;
        Ok(Self {
            folder,
            _leftover: leftover,
            _lock: lock,
        })
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Removes the folders of processes that no longer exist.
pub fn sweep() {
    sweep_if(|number| !is_alive(number));
}

/// Removes the folders of a process that was just killed; waits briefly until it has ended.
pub(crate) fn sweep_of(process: u32) {
    for _ in 0..50 {
        if sweep_if(|number| number == process) {
            return;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Removes the folders of these processes whose locks are free. Returns whether none are left.
fn sweep_if(is_dead: impl Fn(u32) -> bool) -> bool {
    let entries = fs::read_dir(std::env::temp_dir()).into_iter().flatten();
    let mut is_clean = true;
    for entry in entries.flatten() {
        let is_meant = process_of(&entry.file_name()).is_some_and(&is_dead);
        // Anybody may create anything in the temporary folder.
        if !is_meant || !entry.metadata().is_ok_and(|about| is_own_folder(&about)) {
            continue;
        }
        let folder = entry.path();
        match is_free(&folder) {
            true => drop(fs::remove_dir_all(folder)),
            false => is_clean = false,
        }
    }
    is_clean
}

/// The process ID in the name of a folder of this program.
fn process_of(name: &OsStr) -> Option<u32> {
    let (number, _) = name.to_str()?.strip_prefix(PREFIX)?.split_once('-')?;
    number.parse().ok()
}

/// Whether it is a folder, and no link to one, of the user of this process.
#[cfg(unix)]
fn is_own_folder(about: &fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    about.is_dir() && about.uid() == rustix::process::geteuid().as_raw()
}

/// The temporary folder of other systems is that of one user.
#[cfg(not(unix))]
fn is_own_folder(about: &fs::Metadata) -> bool {
    about.is_dir()
}

/// Whether the lock is free: another process with the same ID and temporary folder (in a container) may hold it.
fn is_free(folder: &Path) -> bool {
    match file::found(File::options().read(true), &folder.join("lock")) {
        Ok(lock) => lock.try_lock().is_ok(),
        // The process was killed while creating or removing the folder.
        Err(error) => error.kind() == io::ErrorKind::NotFound,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    /// A folder in the temporary folder, as created by the process of that ID. It has its name last: other tests of this
    /// process sweep, too.
    fn folder(process: u32, fill: impl FnOnce(&Path)) -> PathBuf {
        let made = tempfile::tempdir().unwrap().keep();
        fill(&made);
        let name = made.file_name().unwrap().to_string_lossy().into_owned();
        let named = made.with_file_name(format!("{PREFIX}{process}-{name}"));
        fs::rename(&made, &named).unwrap();
        named
    }

    #[test]
    fn folders_of_the_dead_are_removed_and_no_others() {
        // A process that has ended.
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let dead = child.id();
        child.wait().unwrap();
        let own = std::process::id();
        let empty = |_: &Path| {};
        let with_lock = |path: &Path| _ = File::create(path.join("lock")).unwrap();
        let (left, half) = (folder(dead, with_lock), folder(dead, empty));
        // Whoever opens the lock for reading waits for ever.
        let piped = folder(dead, |path| {
            let mut command = std::process::Command::new("mkfifo");
            assert!(command.arg(path.join("lock")).status().unwrap().success());
        });
        let mut lock = None;
        let held = folder(dead, |path| {
            with_lock(path);
            let own = File::open(path.join("lock")).unwrap();
            own.try_lock().unwrap();
            lock = Some(own);
        });
        let (new, unlocked) = (folder(own, empty), folder(own, with_lock));
        let mine = Folder::create().unwrap();
        sweep();
        let all = [&left, &half, &piped, &held, &new, &unlocked];
        let there = all.map(|own| own.exists());
        for own in all {
            // Those that are swept are gone.
            _ = fs::remove_dir_all(own);
        }
        assert_eq!(there, [false, false, true, true, true, true]);
        drop(lock);
        assert!(mine.path().exists());
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = fs::metadata(mine.path()).unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o700);
        }
    }
}
