//! Locks on files that one process at a time writes.

use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind};
use std::time::Duration;

/// How often a lock is asked for, and the time between: a process that another thread has just started holds the files
/// of this one until it runs its own program.
const ASKED: u32 = 20;
const WAIT: Duration = Duration::from_millis(10);

/// Locks a file until it is closed. On file systems without locks nothing is locked.
///
/// # Errors
/// If another process holds the lock ([`ErrorKind::ResourceBusy`]); the message names it where the system tells.
pub fn take(file: &File) -> io::Result<()> {
    for _ in 0..ASKED {
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => std::thread::sleep(WAIT),
            Ok(()) | Err(TryLockError::Error(_)) => return Ok(()),
        }
    }
    let who = match holder(file) {
        Some(number) => format!("process {number}"),
        None => "another process".to_owned(),
    };
    let why = format!("{who} is writing it");
    Err(io::Error::new(ErrorKind::ResourceBusy, why))
}

/// The process that holds the lock: Linux lists all locks.
fn holder(file: &File) -> Option<u32> {
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::fs::MetadataExt;
        let about = file.metadata().ok()?;
        let (major, minor) = (
            rustix::fs::major(about.dev()),
            rustix::fs::minor(about.dev()),
        );
        let own = format!("{major:02x}:{minor:02x}:{}", about.ino());
        let locks = std::fs::read_to_string("/proc/locks").ok()?;
        // `1: FLOCK  ADVISORY  WRITE 4711 fe:00:131073 0 EOF`
        locks.lines().find_map(|line| {
            let fields: Vec<&str> = line.split_whitespace().collect();
            let [_, "FLOCK", _, _, number, place, ..] = fields[..] else {
                return None;
            };
            number.parse().ok().filter(|_| place == own)
        })
    }
    #[cfg(not(target_os = "linux"))]
    {
        let _ = file;
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_holds_a_lock_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let open = || File::open(file.path()).unwrap();
        let first = open();
        take(&first).unwrap();
        let error = take(&open()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::ResourceBusy);
        let expected = match cfg!(target_os = "linux") {
            true => format!("process {} is writing it", std::process::id()),
            false => "another process is writing it".to_owned(),
        };
        assert_eq!(error.to_string(), expected);
        drop(first);
        take(&open()).unwrap();
    }
}
