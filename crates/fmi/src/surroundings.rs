//! State of the process that an FMU must not change: rounding mode, working folder, umask, signals, locale.
//!
//! The rounding mode is restored after each call, the working folder and the umask after loading and instantiation: the
//! results of other code must not depend on an FMU. Other changes are only [detected](Surroundings).

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::DirEntry;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether an FMU has changed the rounding mode.
static CHANGED: AtomicBool = AtomicBool::new(false);
/// Whether an FMU has changed the working folder.
static LEFT: AtomicBool = AtomicBool::new(false);

/// Whether an FMU has changed the umask.
static MASKED: AtomicBool = AtomicBool::new(false);

/// Makes the call, then restores the working folder and rounding mode from before it, and the program's initial umask.
pub(crate) fn kept<T>(call: impl FnOnce() -> T) -> T {
    let folder = std::env::current_dir().ok();
    let done = call();
    keep();
    if pilotage_process::own::restore_umask() {
        MASKED.store(true, Ordering::Release);
    }
    if let Some(folder) =
        folder.filter(|folder| std::env::current_dir().ok().as_ref() != Some(folder))
    {
        LEFT.store(true, Ordering::Release);
        // If the folder no longer exists, the paths of outputs do not depend on it.
        let _ = std::env::set_current_dir(folder);
    }
    done
}

/// A snapshot of the process state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Surroundings {
    folder: Option<PathBuf>,
    locale: Option<String>,
    /// The system's values for this process, by name; empty if the system does not report them.
    status: Vec<String>,
    /// Target of each open descriptor.
    open: BTreeMap<OsString, PathBuf>,
}

const UMASK: &str = "the umask";

/// Entries of `/proc/self/status` on Linux, with their descriptions.
const STATUS: [(&str, &str); 4] = [
    ("Umask:", UMASK),
    ("SigIgn:", "which signals are ignored"),
    ("SigCgt:", "which signals are handled"),
    ("SigBlk:", "which signals are blocked"),
];

impl Surroundings {
    /// Takes a snapshot, and clears the changes recorded before.
    pub fn look() -> Self {
        CHANGED.store(false, Ordering::Release);
        LEFT.store(false, Ordering::Release);
        MASKED.store(false, Ordering::Release);
        Self::now()
    }

    fn now() -> Self {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let value = |name: &str| status.lines().find_map(|line| line.strip_prefix(name));
        let values = STATUS.map(|(name, _)| value(name).unwrap_or_default().trim().to_owned());
        Self {
            folder: std::env::current_dir().ok(),
            locale: locale(),
            status: values.into(),
            open: open(),
        }
    }

    /// What FMUs have changed since the snapshot.
    pub fn changed(&self) -> Vec<&'static str> {
        let now = Self::now();
        let is_masked = MASKED.load(Ordering::Acquire);
        let status = (STATUS.iter().zip(&self.status).zip(&now.status))
            .filter(|(((_, what), before), after)| before != after || is_masked && *what == UMASK)
            .map(|(((_, what), _), _)| *what);
        let is_lost = (self.open.iter()).any(|(number, path)| now.open.get(number) != Some(path));
        let folder = LEFT.load(Ordering::Acquire) || self.folder != now.folder;
        [
            (CHANGED.load(Ordering::Acquire), "how numbers are rounded"),
            (folder, "the working folder"),
            (self.locale != now.locale, "the locale"),
            (
                is_lost,
                "which files are open (it has closed descriptors that are not its own)",
            ),
        ]
        .into_iter()
        .filter_map(|(is_changed, what)| is_changed.then_some(what))
        .chain(status)
        .collect()
    }
}

/// Target of each open descriptor; empty if the system does not report them.
fn open() -> BTreeMap<OsString, PathBuf> {
    let entries = std::fs::read_dir("/proc/self/fd").into_iter().flatten();
    let lead = |entry: std::io::Result<DirEntry>| {
        let entry = entry.ok()?;
        Some((entry.file_name(), entry.path().read_link().ok()?))
    };
    // Excludes the descriptor used to read the folder.
    let is_others = |(_, path): &(OsString, PathBuf)| !path.starts_with("/proc");
    entries.filter_map(lead).filter(is_others).collect()
}

/// The C locale; `None` if it cannot be queried on this system.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn locale() -> Option<String> {
    use std::ffi::{c_char, c_int};
    const LC_ALL: c_int = 6;
    unsafe extern "C" {
        /// C library: with NULL, returns the locale.
        fn setlocale(category: c_int, locale: *const c_char) -> *const c_char;
    }
    // SAFETY: NULL only queries; the result is copied at once.
    unsafe { crate::binding::owned(setlocale(LC_ALL, std::ptr::null())) }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn locale() -> Option<String> {
    None
}

/// Restores the rounding mode that Rust expects after a call of an FMU: round to nearest, subnormal numbers kept,
/// exceptions masked.
#[inline(always)]
pub(crate) fn keep() {
    #[cfg(target_arch = "x86_64")]
    if mxcsr::control() != mxcsr::DEFAULT {
        reset();
    }
}

#[cfg(target_arch = "x86_64")]
#[cold]
fn reset() {
    mxcsr::set(mxcsr::DEFAULT);
    CHANGED.store(true, Ordering::Release);
}

/// Control register of the SSE unit, which computes all `f64` (Intel SDM, volume 1, section 10.2.3).
#[cfg(target_arch = "x86_64")]
mod mxcsr {
    use std::arch::asm;

    /// All exceptions masked, no other bit set.
    pub(super) const DEFAULT: u32 = 0x1f80;
    /// All bits except the exception flags.
    const CONTROL: u32 = 0xffc0;

    #[inline(always)]
    pub(super) fn control() -> u32 {
        let mut value = 0u32;
        // SAFETY: writes four bytes to the address of `value`.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut value, options(nostack, preserves_flags)) };
        value & CONTROL
    }

    pub(super) fn set(value: u32) {
        // SAFETY: reads four bytes; the value is the one that Rust expects.
        unsafe {
            asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack, preserves_flags))
        };
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use std::hint::black_box;

    #[test]
    fn a_changed_rounding_is_set_back_and_told() {
        let third = black_box(1.0) / black_box(3.0);
        let before = Surroundings::look();
        keep();
        assert_eq!(before.changed(), [""; 0]);
        // Towards zero.
        mxcsr::set(0x7f80);
        keep();
        assert_eq!(black_box(1.0) / black_box(3.0), third);
        assert_eq!(before.changed(), ["how numbers are rounded"]);
        assert_eq!(Surroundings::look().changed(), [""; 0]);
    }
}
