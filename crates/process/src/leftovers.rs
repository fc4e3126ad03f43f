//! Files that are removed and processes that are killed when a signal ends this process.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What is removed or killed.
#[derive(Debug, Clone)]
pub enum Kind {
    /// A file.
    File(PathBuf),
    /// A folder with its contents.
    Folder(PathBuf),
    /// A process group, by the ID of its leader, which is killed.
    Group(u32),
    /// A process, by its ID, which is asked to end.
    Process(u32),
}

#[derive(Debug)]
struct All {
    next: u64,
    kinds: BTreeMap<u64, Kind>,
    /// Whether the process is ending: nothing more is created.
    is_ending: bool,
}

static ALL: Mutex<All> = Mutex::new(All {
    next: 0,
    kinds: BTreeMap::new(),
    is_ending: false,
});

fn all() -> MutexGuard<'static, All> {
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Registration of something that a signal removes, until this is dropped.
#[derive(Debug)]
pub struct Leftover(u64);

/// Creates something that a signal removes, atomically: it never exists without being registered. Does not return while
/// the process is being ended.
///
/// # Errors
/// If it cannot be created.
pub fn make<T>(
    make: impl FnOnce() -> std::io::Result<T>,
    kind: impl FnOnce(&T) -> Kind,
) -> std::io::Result<(T, Leftover)> {
    let mut all = loop {
        stay_if_ending();
        let all = all();
        if !all.is_ending {
            break all;
        }
    };
    let made = make()?;
    all.next += 1;
    let number = all.next;
    all.kinds.insert(number, kind(&made));
    Ok((made, Leftover(number)))
}

impl Drop for Leftover {
    fn drop(&mut self) {
        all().kinds.remove(&self.0);
    }
}

/// Does not return while a signal ends this process: the removal must finish.
pub fn stay_if_ending() {
    while crate::page::is_stopped() || all().is_ending {
        std::thread::sleep(std::time::Duration::from_secs(1));
    }
}

/// Kills and removes everything registered, and prevents further creation: this process is about to end.
pub fn remove() {
    let kinds: Vec<Kind> = {
        let mut all = all();
        all.is_ending = true;
        all.kinds.values().cloned().collect()
    };
    // First the processes that might still write.
    for kind in &kinds {
        #[cfg(unix)]
        match kind {
            Kind::Group(leader) => crate::child::kill_group(*leader),
            Kind::Process(number) => crate::child::end(*number),
            Kind::File(_) | Kind::Folder(_) => {}
        }
        #[cfg(not(unix))]
        let _ = kind;
    }
    for kind in kinds {
        #[cfg(unix)]
        if let Kind::Group(leader) = kind {
            crate::folder::sweep_of(leader);
        }
        let _ = match kind {
            Kind::File(path) => std::fs::remove_file(path),
            Kind::Folder(path) => remove_folder(&path),
            Kind::Group(_) | Kind::Process(_) => Ok(()),
        };
    }
}

/// Renames a folder before removing it, so that other threads of this process, still running, create nothing in it.
fn remove_folder(path: &Path) -> std::io::Result<()> {
    let mut name = path.as_os_str().to_owned();
    name.push("-gone");
    let gone = PathBuf::from(name);
    std::fs::rename(path, &gone)?;
    std::fs::remove_dir_all(gone)
}

/// Whether another part of the program handles SIGINT.
static INTERRUPTS_ARE_HEARD: AtomicBool = AtomicBool::new(false);

/// Leaves SIGINT to another handler from now on.
pub fn leave_interrupts() {
    INTERRUPTS_ARE_HEARD.store(true, Ordering::SeqCst);
}

/// From now on SIGTERM and SIGHUP, and SIGINT until it has another handler ([`leave_interrupts`]), first [remove]
/// everything registered and then end the process as by default.
///
/// A signal that is ignored, e.g. by `nohup`, stays ignored.
///
/// # Errors
/// If the signal handlers cannot be registered.
#[cfg(unix)]
pub fn remove_on_signals() -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    fn is_left(signal: i32) -> bool {
        signal == SIGINT && INTERRUPTS_ARE_HEARD.load(Ordering::SeqCst)
    }
    let at_once = |signal| {
        if !is_left(signal) {
            crate::page::stop();
        }
    };
    let end = |signal| {
        // A signal that arrived before the other handler was registered still ends the process.
        if is_left(signal) && !crate::page::is_stopped() {
            return;
        }
        remove();
        let _ = signal_hook::low_level::emulate_default_handler(signal);
    };
    // SAFETY: it reads atomics and stores into one.
    unsafe { crate::signals::listen_at_once(&[SIGTERM, SIGHUP, SIGINT], at_once, end) }
}

/// Does nothing: these signals do not exist on this system.
///
/// # Errors
/// None.
#[cfg(not(unix))]
pub fn remove_on_signals() -> std::io::Result<()> {
    Ok(())
}
