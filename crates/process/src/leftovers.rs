//! What is removed, and who is killed, when a signal ends this process.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What is removed or killed.
#[derive(Debug, Clone)]
pub enum Kind {
    /// A file.
    File(PathBuf),
    /// A folder with all that is in it.
    Folder(PathBuf),
    /// A process group, by the number of its leader.
    Group(u32),
    /// A process that is asked to end, by its number.
    Process(u32),
}

#[derive(Debug)]
struct All {
    next: u64,
    kinds: BTreeMap<u64, Kind>,
    /// Nothing is made any more.
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

/// Something that a signal removes, as long as this lives.
#[derive(Debug)]
pub struct Leftover(u64);

/// Makes something that a signal removes, atomically: it never exists without being registered. Does not
/// come back when the process is being ended.
///
/// # Errors
/// When it cannot be made.
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

/// Kills and removes what there is, and lets nothing be made any more: this process is to end.
pub fn remove() {
    let kinds: Vec<Kind> = {
        let mut all = all();
        all.is_ending = true;
        all.kinds.values().cloned().collect()
    };
    // First those who might still write.
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

/// Removes a folder by another name, so that other threads of this process, which go on, create nothing in it.
fn remove_folder(path: &Path) -> std::io::Result<()> {
    let mut name = path.as_os_str().to_owned();
    name.push("-gone");
    let gone = PathBuf::from(name);
    std::fs::rename(path, &gone)?;
    std::fs::remove_dir_all(gone)
}

/// Whether another part of the program handles SIGINT.
static INTERRUPTS_ARE_HEARD: AtomicBool = AtomicBool::new(false);

/// Leaves SIGINT to its other handler from now on.
pub fn leave_interrupts() {
    INTERRUPTS_ARE_HEARD.store(true, Ordering::SeqCst);
}

/// From now on SIGTERM and SIGHUP, and SIGINT until it has another handler ([`leave_interrupts`]), first [remove] what
/// there is, and then end the process as they would have.
///
/// A signal that is ignored, as `nohup` does, stays ignored.
///
/// # Errors
/// When the system does not let it listen.
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
        // What came before somebody else listened still ends the process.
        if is_left(signal) && !crate::page::is_stopped() {
            return;
        }
        remove();
        let _ = signal_hook::low_level::emulate_default_handler(signal);
    };
    // SAFETY: it looks at atomics, and stores into one.
    unsafe { crate::signals::listen_at_once(&[SIGTERM, SIGHUP, SIGINT], at_once, end) }
}

/// Nothing: there are no such signals here.
///
/// # Errors
/// None.
#[cfg(not(unix))]
pub fn remove_on_signals() -> std::io::Result<()> {
    Ok(())
}
