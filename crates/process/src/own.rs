//! State of this process that foreign code in it may change: stdout, stderr, and the umask.

#[cfg(unix)]
pub use unix::{remember, restore_streams, restore_umask};

/// Does nothing on this system.
#[cfg(not(unix))]
pub fn remember() {}

/// Does nothing on this system.
#[cfg(not(unix))]
pub fn restore_streams() {}

/// Does nothing on this system.
#[cfg(not(unix))]
pub fn restore_umask() -> bool {
    false
}

#[cfg(unix)]
mod unix {
    use rustix::fd::{AsFd, AsRawFd, BorrowedFd};
    use rustix::fs::{Mode, OFlags};
    use rustix::stdio::{dup2_stderr, dup2_stdout, stderr, stdout};
    use std::fs::File;
    use std::sync::OnceLock;

    /// The file behind a descriptor: device and inode.
    type Identity = Option<(u64, u64)>;

    struct Own {
        umask: Mode,
        streams: [Identity; 2],
    }

    static OWN: OnceLock<Own> = OnceLock::new();

    /// Stores the current state, before foreign code is loaded and while there is one thread.
    pub fn remember() {
        let umask = rustix::process::umask(Mode::empty());
        rustix::process::umask(umask);
        let streams = [identity(stdout()), identity(stderr())];
        let _ = OWN.set(Own { umask, streams });
    }

    fn identity(stream: BorrowedFd<'_>) -> Identity {
        let stat = rustix::fs::fstat(stream).ok()?;
        Some((stat.st_dev, stat.st_ino))
    }

    /// Restores the initial umask. Returns whether it had changed.
    pub fn restore_umask() -> bool {
        let own = OWN.get();
        own.is_some_and(|own| rustix::process::umask(own.umask) != own.umask)
    }

    /// In a watched process: redirects stdout and stderr to their initial files, which the watching process still has
    /// open.
    pub fn restore_streams() {
        let Some(own) = OWN.get().filter(|_| crate::is_attached()) else {
            return;
        };
        if let Some(file) = theirs(stdout(), own.streams[0]) {
            let _ = dup2_stdout(&file);
            keep(file);
        }
        if let Some(file) = theirs(stderr(), own.streams[1]) {
            let _ = dup2_stderr(&file);
            keep(file);
        }
    }

    /// The parent's file for this stream, if the stream no longer refers to its initial file.
    fn theirs(stream: BorrowedFd<'_>, before: Identity) -> Option<File> {
        if before.is_none() || identity(stream) == before {
            return None;
        }
        let parent = rustix::process::getppid()?.as_raw_nonzero();
        let path = format!("/proc/{parent}/fd/{}", stream.as_raw_fd());
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
