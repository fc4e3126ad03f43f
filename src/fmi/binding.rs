//! An FMU's shared library, loaded, with the addresses of its functions.

use libloading::Library;
use pilotage_abi::Part;
use pilotage_abi::fmi2::functions::pointers;
use pilotage_abi::fmi2::{Function, TYPES_PLATFORM, VERSION};
use std::ffi::{CStr, c_char};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a library cannot be used, though its headers are good.
#[derive(Debug, Error)]
pub enum BindingError {
    /// The system cannot load it.
    #[error("the system cannot load it")]
    Load {
        /// Why: most often a library or a symbol that it needs and that is not there.
        source: libloading::Error,
    },
    /// A function of the standard that every co-simulation needs is not in it.
    #[error("it has no function `{symbol}`")]
    MissingSymbol {
        /// Name of the function.
        symbol: &'static str,
    },
    /// It speaks another version of FMI than the description says.
    #[error("it speaks FMI {found:?}, expected {expected:?}")]
    Version {
        /// What `fmi2GetVersion` returns.
        found: String,
        /// What it should return.
        expected: &'static str,
    },
    /// Its C types are of other sizes than the standard's.
    #[error("it is built for the types platform {found:?}, expected {expected:?}")]
    TypesPlatform {
        /// What `fmi2GetTypesPlatform` returns.
        found: String,
        /// What it should return.
        expected: &'static str,
    },
}

/// Declares the table of function pointers: required ones are pointers, optional ones may be absent.
macro_rules! binding {
    (required { $($required:ident: $R:ident,)* } optional { $($optional:ident: $O:ident,)* }) => {
        /// A loaded library and its functions. The pointers are valid as long as it lives.
        pub struct Binding {
            $(pub(super) $required: pointers::$R,)*
            $(pub(super) $optional: Option<pointers::$O>,)*
            /// Whether some symbol that the library needs could not be found when it was loaded.
            pub(super) unresolved: Option<String>,
            path: PathBuf,
            /// Kept last, so that it is unloaded after all else is gone.
            _library: Library,
        }

        impl Binding {
            fn bind(library: Library, unresolved: Option<String>, path: &Path) -> Result<Self, BindingError> {
                Ok(Self {
                    $($required: required(&library, Function::$R)?,)*
                    // SAFETY: the pointer's type is the one that the standard gives to the
                    // function of this name.
                    $($optional: unsafe { symbol(&library, Function::$O) },)*
                    unresolved,
                    path: path.to_owned(),
                    _library: library,
                })
            }
        }
    };
}

binding! {
    required {
        instantiate: Instantiate,
        free_instance: FreeInstance,
        setup_experiment: SetupExperiment,
        enter_initialization_mode: EnterInitializationMode,
        exit_initialization_mode: ExitInitializationMode,
        terminate: Terminate,
        do_step: DoStep,
    }
    optional {
        get_types_platform: GetTypesPlatform,
        get_version: GetVersion,
        set_debug_logging: SetDebugLogging,
        reset: Reset,
        get_real: GetReal,
        get_integer: GetInteger,
        get_boolean: GetBoolean,
        get_string: GetString,
        set_real: SetReal,
        set_integer: SetInteger,
        set_boolean: SetBoolean,
        set_string: SetString,
        get_fmu_state: GetFmuState,
        set_fmu_state: SetFmuState,
        free_fmu_state: FreeFmuState,
        get_status: GetStatus,
        get_real_status: GetRealStatus,
        get_boolean_status: GetBooleanStatus,
    }
}

/// Looks a function up.
///
/// # Safety
/// `T` must be the pointer type of this function.
unsafe fn symbol<T: Copy>(library: &Library, function: Function) -> Option<T> {
    // SAFETY: the caller vouches for the type; the copy of the pointer is kept beside the library.
    unsafe { library.get::<T>(function.symbol()) }
        .ok()
        .map(|symbol| *symbol)
}

fn required<T: Copy>(library: &Library, function: Function) -> Result<T, BindingError> {
    // SAFETY: `binding!` takes function and pointer type from one name.
    unsafe { symbol(library, function) }.ok_or_else(|| BindingError::MissingSymbol {
        symbol: function.name(),
    })
}

impl Binding {
    /// Loads a library and looks its functions up.
    ///
    /// # Errors
    /// If it cannot be loaded, lacks a function that is always needed, or is of another version.
    ///
    /// # Safety
    /// The library's initialization runs, and its code will run in this process; whoever calls this
    /// trusts it. [`binary::check`](super::binary::check) tells damaged files first.
    pub unsafe fn load(path: &Path) -> Result<Self, BindingError> {
        // SAFETY: handed on to the caller.
        let (library, unresolved) =
            unsafe { open(path) }.map_err(|source| BindingError::Load { source })?;
        let binding = Self::bind(library, unresolved, path)?;
        binding.check_version()?;
        Ok(binding)
    }

    /// The library.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A symbol that the library needs and that could not be found: calling into it ends the
    /// process.
    pub fn unresolved(&self) -> Option<&str> {
        self.unresolved.as_deref()
    }

    /// Names of functions of the standard that the library lacks and that only some need.
    pub fn missing(&self) -> Vec<&'static str> {
        let is_missing = |f: &Function| {
            // SAFETY: the address is not used, so that its type does not matter.
            unsafe { symbol::<*const ()>(&self._library, *f) }.is_none()
        };
        let missing = (Function::ALL.iter())
            .filter(|f| f.part() != Part::ModelExchange)
            .filter(|f| is_missing(f));
        missing.map(|f| f.name()).collect()
    }

    fn check_version(&self) -> Result<(), BindingError> {
        // SAFETY: both take no argument and need no instance (FMI 2.0, section 2.1.4).
        let (version, platform) = unsafe {
            (
                self.get_version.and_then(|f| owned(f())),
                self.get_types_platform.and_then(|f| owned(f())),
            )
        };
        let expected = VERSION.to_str().unwrap_or_default();
        // Releases 2.0.1 to 2.0.5 all say "2.0"; some tools write the release.
        if let Some(found) = version.filter(|v| !v.starts_with(expected)) {
            return Err(BindingError::Version { found, expected });
        }
        let expected = TYPES_PLATFORM.to_str().unwrap_or_default();
        match platform.filter(|p| p != expected) {
            Some(found) => Err(BindingError::TypesPlatform { found, expected }),
            None => Ok(()),
        }
    }
}

impl std::fmt::Debug for Binding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Binding").field("path", &self.path).finish()
    }
}

/// A copy of a C string; `None` if there is none.
///
/// # Safety
/// `text` is NULL or points to a string that ends with a NUL.
pub(super) unsafe fn owned(text: *const c_char) -> Option<String> {
    if text.is_null() {
        return None;
    }
    // SAFETY: not NULL, and the caller vouches for the rest.
    Some(
        unsafe { CStr::from_ptr(text) }
            .to_string_lossy()
            .into_owned(),
    )
}

/// Loads a library; also returns the first symbol that it needs and that nobody has.
///
/// Some FMUs use functions of libm (`ceil`, `tanh`, `fmin`) without saying that they need it. They
/// get it by libm being loaded for all; if that does not help, symbols are looked up when they are
/// called, since an FMU may never call what is missing.
///
/// # Safety
/// The library's initialization runs.
#[cfg(unix)]
unsafe fn open(path: &Path) -> Result<(Library, Option<String>), libloading::Error> {
    use libloading::os::unix::{Library as Unix, RTLD_LAZY, RTLD_LOCAL, RTLD_NOW};
    // SAFETY: handed on to the caller, here and below.
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
    // SAFETY: the system's own library, whose initialization does nothing that we would notice.
    if let Ok(libm) = unsafe { Unix::open(Some(LIBM), RTLD_NOW | RTLD_GLOBAL) } {
        // It stays until the process ends: FMUs may hold addresses in it.
        std::mem::forget(libm);
    }
}

/// Loads a library; libraries beside it are found too.
///
/// # Safety
/// The library's initialization runs.
#[cfg(windows)]
unsafe fn open(path: &Path) -> Result<(Library, Option<String>), libloading::Error> {
    use libloading::os::windows::{LOAD_WITH_ALTERED_SEARCH_PATH, Library as Windows};
    // SAFETY: handed on to the caller.
    let library = unsafe { Windows::load_with_flags(path, LOAD_WITH_ALTERED_SEARCH_PATH) }?;
    Ok((library.into(), None))
}
