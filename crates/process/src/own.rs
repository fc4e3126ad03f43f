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
    use rustix::fd::{AsFd, AsRawFd, FromRawFd, OwnedFd};
    use rustix::fs::{Mode, OFlags};
    use std::fs::File;
    use std::os::unix::fs::MetadataExt;
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
        let streams = [identity(std::io::stdout()), identity(std::io::stderr())];
        let _ = OWN.set(Own { umask, streams });
    }

    fn identity(stream: impl AsFd) -> Identity {
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
        restore(&std::io::stdout(), own.streams[0]);
        restore(&std::io::stderr(), own.streams[1]);
    }

    fn restore(stream: &impl AsFd, before: Identity) {
        if before.is_none() || identity(stream) == before {
            return;
        }
        let number = stream.as_fd().as_raw_fd();
        let Some(parent) = rustix::process::getppid() else {
            return;
        };
        let theirs = format!("/proc/{}/fd/{number}", parent.as_raw_nonzero());
        // What is in a file already stays there.
        let flags = OFlags::WRONLY | OFlags::APPEND | OFlags::CLOEXEC | OFlags::NOCTTY;
        let Ok(file) = rustix::fs::open(theirs, flags, Mode::empty()).map(File::from) else {
            return;
        };
        let found = file.metadata().ok().map(|told| (told.dev(), told.ino()));
        if found != before {
            return;
        }
        if file.as_raw_fd() == number {
            // It was closed, and this one has got its number.
            std::mem::forget(file);
            return;
        }
        // SAFETY: the number is that of the stream, which is nobody's to close: it is forgotten again.
        let mut to = unsafe { OwnedFd::from_raw_fd(number) };
        let _ = rustix::io::dup2(&file, &mut to);
        std::mem::forget(to);
    }
}
