//! What is this process's own, and foreign code in it may change: stdout, stderr, and the umask.

#[cfg(unix)]
pub use unix::{remember, restore_streams, restore_umask};

/// Nothing: see the other systems.
#[cfg(not(unix))]
pub fn remember() {}

/// Nothing: see the other systems.
#[cfg(not(unix))]
pub fn restore_streams() {}

/// Nothing: see the other systems.
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

    /// What a descriptor leads to: device and file.
    type Identity = Option<(u64, u64)>;

    struct Own {
        umask: Mode,
        streams: [Identity; 2],
    }

    static OWN: OnceLock<Own> = OnceLock::new();

    /// Keeps in mind what there is, before foreign code comes in and while there is one thread.
    pub fn remember() {
        let umask = rustix::process::umask(Mode::empty());
        rustix::process::umask(umask);
        let streams = [identity(stdout()), identity(stderr())];
        let _ = OWN.set(Own { umask, streams });
    }

    fn identity(stream: BorrowedFd<'_>) -> Identity {
        let told = rustix::fs::fstat(stream).ok()?;
        Some((told.st_dev, told.st_ino))
    }

    /// Sets the umask of the begin; whether it was another.
    pub fn restore_umask() -> bool {
        let own = OWN.get();
        own.is_some_and(|own| rustix::process::umask(own.umask) != own.umask)
    }

    /// In a watched process: makes stdout and stderr lead to where they led at the begin, which the process that watches
    /// still has open.
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

    /// What the parent has open as this stream, if here it leads elsewhere than before.
    fn theirs(stream: BorrowedFd<'_>, before: Identity) -> Option<File> {
        if before.is_none() || identity(stream) == before {
            return None;
        }
        let parent = rustix::process::getppid()?.as_raw_nonzero();
        let path = format!("/proc/{parent}/fd/{}", stream.as_raw_fd());
        // What is in a file already stays there.
        let flags = OFlags::WRONLY | OFlags::APPEND | OFlags::CLOEXEC | OFlags::NOCTTY;
        let file = rustix::fs::open(path, flags, Mode::empty()).ok()?;
        (identity(file.as_fd()) == before).then(|| file.into())
    }

    /// Where a stream was closed, this one may have got its number, and is to stay open.
    fn keep(file: File) {
        if file.as_raw_fd() <= stderr().as_raw_fd() {
            std::mem::forget(file);
        }
    }
}
