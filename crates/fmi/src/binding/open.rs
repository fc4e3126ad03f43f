//! Loads a library.

use libloading::Library;
use std::path::Path;

/// Loads a library; also returns the first symbol that it needs and no library provides.
///
/// Some FMUs use functions of libm (`ceil`, `tanh`, `fmin`) without linking to it. Therefore libm is loaded globally;
/// if that does not help, symbols are resolved lazily, since an FMU may never call a missing one.
///
/// # Safety
/// The library's initialization runs.
#[cfg(unix)]
pub(super) unsafe fn open(path: &Path) -> Result<(Library, Option<String>), libloading::Error> {
    use libloading::os::unix::{Library as Unix, RTLD_LAZY, RTLD_LOCAL, RTLD_NOW};
    // SAFETY: the obligation is passed to the caller, here and below.
    let load = |flags| unsafe { Unix::open(Some(path), flags | RTLD_LOCAL) }.map(Library::from);
    if let Ok(library) = load(RTLD_NOW) {
        return Ok((library, None));
    }
    load_libm_for_all();
    match load(RTLD_NOW) {
        Ok(library) => Ok((library, None)),
        Err(error) => {
            let source = std::error::Error::source(&error);
            let unresolved = source.map_or_else(|| error.to_string(), ToString::to_string);
            load(RTLD_LAZY).map(|library| (library, Some(unresolved)))
        }
    }
}

/// Makes the functions of libm visible to libraries loaded later.
#[cfg(unix)]
fn load_libm_for_all() {
    use libloading::os::unix::{Library as Unix, RTLD_GLOBAL, RTLD_NOW};
    #[cfg(target_os = "linux")]
    const LIBM: &str = "libm.so.6";
    #[cfg(not(target_os = "linux"))]
    const LIBM: &str = "libm.dylib";
    // SAFETY: a system library, whose initialization has no visible effects.
    if let Ok(libm) = unsafe { Unix::open(Some(LIBM), RTLD_NOW | RTLD_GLOBAL) } {
        // It stays loaded until the process ends: FMUs may hold addresses in it.
        std::mem::forget(libm);
    }
}

/// Loads a library; libraries in the same folder are found too.
///
/// # Safety
/// The library's initialization runs.
#[cfg(windows)]
pub(super) unsafe fn open(path: &Path) -> Result<(Library, Option<String>), libloading::Error> {
    use libloading::os::windows::{LOAD_WITH_ALTERED_SEARCH_PATH, Library as Windows};
    // SAFETY: the obligation is passed to the caller.
    let library = unsafe { Windows::load_with_flags(path, LOAD_WITH_ALTERED_SEARCH_PATH) }?;
    Ok((library.into(), None))
}
