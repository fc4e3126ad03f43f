//! State of this process that foreign code in it may change: stdout, stderr, and the umask.

#[cfg(unix)]
pub use unix::{remember, restore_streams, restore_umask, separate_stdout, write_separated};

/// Does nothing on this system.
#[cfg(not(unix))]
pub fn remember() {}

/// Does nothing on this system.
#[cfg(not(unix))]
pub fn restore_streams() {}

/// Does nothing on this system, which has no umask.
#[cfg(not(unix))]
pub fn restore_umask() -> bool {
    false
}

/// Does nothing on this system.
#[cfg(not(unix))]
pub fn separate_stdout() {}

/// Does nothing on this system.
#[cfg(not(unix))]
pub fn write_separated(_bytes: &[u8]) -> Option<std::io::Result<usize>> {
    None
}

#[cfg(unix)]
mod unix {
    use rustix::fd::{AsFd, AsRawFd, BorrowedFd};
    use rustix::fs::{Mode, OFlags};
    use rustix::stdio::{dup2_stderr, dup2_stdout, stderr, stdout};
    use std::fs::File;
    use std::io::{self, Write};
    use std::sync::{Mutex, OnceLock, PoisonError};

    /// The file behind a descriptor: device and inode.
    type Identity = Option<(u64, u64)>;

    struct Own {
        umask: Mode,
        streams: [Identity; 2],
    }

    static OWN: OnceLock<Own> = OnceLock::new();

    /// The initial stdout, where it is kept apart from descriptor 1.
    static SEPARATED: OnceLock<Mutex<File>> = OnceLock::new();

    /// Stores the current state, before foreign code is loaded and while there is one thread.
    pub fn remember() {
        let umask = rustix::process::umask(Mode::empty());
        rustix::process::umask(umask);
        let streams = [identity(stdout()), identity(stderr())];
        let _ = OWN.set(Own { umask, streams });
    }

    fn identity(stream: BorrowedFd<'_>) -> Identity {
        let stat = rustix::fs::fstat(stream).ok()?;
        #[allow(clippy::unnecessary_cast, reason = "it is an i32 on macOS")]
        Some((stat.st_dev as u64, stat.st_ino))
    }

    /// Restores the initial umask. Returns whether it had changed.
    pub fn restore_umask() -> bool {
        let own = OWN.get();
        own.is_some_and(|own| rustix::process::umask(own.umask) != own.umask)
    }

    /// In a watched process: what foreign code prints goes to stderr from now on, so that stdout holds alone what
    /// [`write_separated`] writes.
    pub fn separate_stdout() {
        let Ok(own) = rustix::io::fcntl_dupfd_cloexec(stdout(), 3) else {
            return;
        };
        if dup2_stdout(stderr()).is_ok() {
            let _ = SEPARATED.set(Mutex::new(own.into()));
        }
    }

    /// Writes to the initial stdout if that is [kept apart](separate_stdout); returns how many of these bytes were written.
    pub fn write_separated(bytes: &[u8]) -> Option<io::Result<usize>> {
        let file = SEPARATED.get()?;
        let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
        let before = OWN.get().and_then(|own| own.streams[0]);
        if let Some(found) = theirs(file.as_fd(), stdout().as_raw_fd(), before) {
            // The old number may belong to another file by now, which is not ours to close.
            std::mem::forget(std::mem::replace(&mut *file, found));
        }
        Some(file.write(bytes))
    }

    /// In a watched process: redirects stdout and stderr to their files, which the watching process still has open.
    pub fn restore_streams() {
        let Some(own) = OWN.get().filter(|_| crate::is_attached()) else {
            return;
        };
        if let Some(file) = theirs(stderr(), stderr().as_raw_fd(), own.streams[1]) {
            let _ = dup2_stderr(&file);
            keep(file);
        }
        if SEPARATED.get().is_none()
            && let Some(file) = theirs(stdout(), stdout().as_raw_fd(), own.streams[0])
        {
            let _ = dup2_stdout(&file);
            keep(file);
        }
    }

    /// The parent's file with this number, if the stream no longer refers to its initial file.
    fn theirs(stream: BorrowedFd<'_>, number: i32, before: Identity) -> Option<File> {
        if before.is_none() || identity(stream) == before {
            return None;
        }
        let parent = rustix::process::getppid()?.as_raw_nonzero();
        let path = format!("/proc/{parent}/fd/{number}");
        // Existing contents of a file are kept.
        let flags = OFlags::WRONLY | OFlags::APPEND | OFlags::CLOEXEC | OFlags::NOCTTY;
        let file = rustix::fs::open(path, flags, Mode::empty()).ok()?;
        (identity(file.as_fd()) == before).then(|| file.into())
    }

    /// If a stream was closed, this file may have got its number and must stay open.
    fn keep(file: File) {
        if file.as_raw_fd() <= stderr().as_raw_fd() {
            std::mem::forget(file);
        }
    }
}
