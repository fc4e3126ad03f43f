//! A loaded shared library of an FMU, with the addresses of its functions.

pub(super) mod fmi2;
pub(super) mod fmi3;
mod missing;
mod open;

pub use missing::Missing;

use crate::archive::Unpacked;
use crate::description::FmiVersion;
use crate::misuse::{Misuse, note};
use crate::surroundings;
use crate::version::{Function, InterfaceType, LOADING, UNLOADING};
use libloading::Library;
use pilotage_abi::{Part, fmi2 as abi2, fmi3 as abi3};
use pilotage_process::Place;
use pilotage_text::error_chain::error_chain;
use std::ffi::{CStr, c_char, c_void};
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

/// Why a library cannot be used although its headers are valid.
#[derive(Debug, Error)]
pub enum BindingError {
    /// The system cannot load it.
    #[error("the system cannot load it")]
    Load {
        /// The cause.
        source: libloading::Error,
    },
    /// The system cannot load it because something is missing.
    #[error("{missing}")]
    Missing {
        /// What is missing.
        missing: Missing,
    },
    /// It lacks a function of the standard that this kind of FMU always needs.
    #[error("it has no function `{symbol}`")]
    MissingSymbol {
        /// Name of the function.
        symbol: &'static str,
    },
    /// Its version of FMI differs from that of the description.
    #[error("its FMI version is {found:?}, expected {expected:?}")]
    Version {
        /// The return value of `fmi2GetVersion` or `fmi3GetVersion`.
        found: String,
        /// The expected value.
        expected: &'static str,
    },
    /// Its C types differ in size from those of the standard.
    #[error("it is built for the types platform {found:?}, expected {expected:?}")]
    TypesPlatform {
        /// The return value of `fmi2GetTypesPlatform`.
        found: String,
        /// The expected value.
        expected: &'static str,
    },
}

impl BindingError {
    fn of_loader(source: libloading::Error) -> Self {
        match Missing::in_message(&error_chain(&source)) {
            Some(missing) => Self::Missing { missing },
            None => Self::Load { source },
        }
    }
}

/// Declares the table of a version's function pointers. Any may be absent: some FMUs lack functions.
macro_rules! table {
    ($($field:ident: $Name:ident,)*) => {
        /// The functions; valid as long as the library is loaded.
        pub(crate) struct Functions {
            $(pub(crate) $field: Option<pointers::$Name>,)*
        }

        impl Functions {
            pub(super) fn of(library: &libloading::Library) -> Self {
                Self {
                    // SAFETY: the pointer has the type that the standard defines for the function of this name.
                    $($field: unsafe { super::symbol(library, Function::$Name.symbol()) },)*
                }
            }
        }
    };
}
use table;

/// The functions of the FMU's FMI version.
#[expect(
    clippy::large_enum_variant,
    reason = "there is one for each library, behind a pointer"
)]
pub(super) enum Functions {
    /// FMI 2.0.
    Fmi2(fmi2::Functions),
    /// FMI 3.0.
    Fmi3(fmi3::Functions),
}

/// A loaded library and its functions. The pointers are valid until it is dropped.
pub struct Binding {
    pub(super) functions: Functions,
    kinds: Vec<InterfaceType>,
    /// The first symbol that the library needs and that was not found when it was loaded.
    unresolved: Option<String>,
    path: PathBuf,
    /// Identifies the library to the watching process.
    place: Place,
    /// Last field, so that the library is unloaded after all else is dropped.
    library: ManuallyDrop<Library>,
}

impl Drop for Binding {
    fn drop(&mut self) {
        // SAFETY: it is not used again.
        let unload = || unsafe { ManuallyDrop::drop(&mut self.library) };
        self.place.call(UNLOADING, unload);
        surroundings::keep();
    }
}

/// A loaded library and the folder into which it was unpacked.
#[derive(Debug)]
pub(super) struct Loaded {
    // Fields drop in this order: the library is unloaded before its folder is removed.
    pub(super) binding: Binding,
    pub(super) folder: Arc<Unpacked>,
    /// The file.
    pub(super) fmu: PathBuf,
}

/// Looks up a function.
///
/// # Safety
/// `T` must be the pointer type of this function.
unsafe fn symbol<T: Copy>(library: &Library, name: &CStr) -> Option<T> {
    const { assert!(size_of::<T>() == size_of::<*mut c_void>()) };
    // SAFETY: the caller vouches for the type, which is that of a pointer.
    address(library, name).map(|address| unsafe { std::mem::transmute_copy(&address) })
}

/// Apart from the type of the function, of which there are many. The address is kept together with the library.
fn address(library: &Library, name: &CStr) -> Option<*mut c_void> {
    // SAFETY: it is only taken, as an address without a type.
    unsafe { library.get::<*mut c_void>(name) }
        .ok()
        .map(|symbol| *symbol)
}

impl Binding {
    /// Loads the library of an FMU that supports these kinds of instances, and looks up its functions.
    ///
    /// # Errors
    /// If it cannot be loaded, lacks a function that is always needed, or is of another version.
    ///
    /// # Safety
    /// The library's initialization runs, and its code will run in this process: the caller trusts it.
    /// [`binary::check`](super::binary::check) detects damaged files beforehand.
    pub(crate) unsafe fn load(
        fmu: &Path,
        path: &Path,
        version: FmiVersion,
        kinds: &[InterfaceType],
    ) -> Result<Self, BindingError> {
        let place = Place::new(&fmu.display().to_string());
        // SAFETY: the obligation is passed to the caller.
        let load = || unsafe { open::open(path) };
        let loaded = surroundings::kept(|| place.call(LOADING, load));
        let (library, unresolved) = loaded.map_err(BindingError::of_loader)?;
        let functions = match version {
            FmiVersion::V2 => Functions::Fmi2(fmi2::Functions::of(&library)),
            FmiVersion::V3 => Functions::Fmi3(fmi3::Functions::of(&library)),
        };
        let binding = Self {
            functions,
            kinds: kinds.to_owned(),
            unresolved,
            path: path.to_owned(),
            place,
            library: ManuallyDrop::new(library),
        };
        let mut needed = binding.needed().into_iter();
        if let Some(symbol) = needed.find(|&name| !binding.has(name)) {
            return Err(BindingError::MissingSymbol {
                symbol: symbol.to_str().unwrap_or_default(),
            });
        }
        binding.check_version()?;
        Ok(binding)
    }

    /// The library.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A symbol that the library needs and that was not found: calling it ends the process.
    pub fn unresolved(&self) -> Option<&str> {
        self.unresolved.as_deref()
    }

    /// Names of optional functions of the standard that the library lacks.
    pub fn missing(&self) -> Vec<&'static str> {
        let is_ours = |part: Part| {
            let of_kind = |kind: &InterfaceType| kind.part() == part;
            part == Part::Common || self.kinds.iter().any(of_kind)
        };
        let others = InterfaceType::ALL
            .iter()
            .filter(|kind| !self.kinds.contains(kind));
        let other_starts: Vec<_> = others.map(|kind| instantiate3(*kind)).collect();
        let names: Vec<&'static CStr> = match self.functions {
            Functions::Fmi2(_) => (abi2::Function::ALL.iter())
                .filter(|f| is_ours(f.part()))
                .map(|f| f.symbol())
                .collect(),
            Functions::Fmi3(_) => (abi3::Function::ALL.iter())
                .filter(|f| is_ours(f.part()) && !other_starts.contains(f))
                .map(|f| f.symbol())
                .collect(),
        };
        let missing = names.into_iter().filter(|&name| !self.has(name));
        missing.filter_map(|name| name.to_str().ok()).collect()
    }

    fn has(&self, name: &CStr) -> bool {
        // SAFETY: the address is not used, so its type does not matter.
        unsafe { symbol::<*const ()>(&self.library, name) }.is_some()
    }

    /// The functions that are always needed.
    fn needed(&self) -> Vec<&'static CStr> {
        let of_kind = |kind: InterfaceType| self.kinds.contains(&kind);
        let me = of_kind(InterfaceType::ModelExchange);
        match self.functions {
            Functions::Fmi2(_) => {
                use abi2::Function::*;
                let common = [
                    Instantiate,
                    FreeInstance,
                    SetupExperiment,
                    EnterInitializationMode,
                    ExitInitializationMode,
                    Terminate,
                ];
                let cs = of_kind(InterfaceType::CoSimulation).then_some(DoStep);
                let me = me.then_some([NewDiscreteStates, EnterContinuousTimeMode, SetTime]);
                let all = common.into_iter().chain(cs).chain(me.into_iter().flatten());
                all.map(|f| f.symbol()).collect()
            }
            Functions::Fmi3(_) => {
                use abi3::Function::*;
                let common = [
                    FreeInstance,
                    EnterInitializationMode,
                    ExitInitializationMode,
                    Terminate,
                ];
                let starts = self.kinds.iter().map(|&kind| instantiate3(kind));
                let cs = of_kind(InterfaceType::CoSimulation).then_some(DoStep);
                let me = me.then_some([UpdateDiscreteStates, EnterContinuousTimeMode, SetTime]);
                let se =
                    of_kind(InterfaceType::ScheduledExecution).then_some(ActivateModelPartition);
                let of_kinds = starts.chain(cs).chain(me.into_iter().flatten()).chain(se);
                let all = common.into_iter().chain(of_kinds);
                all.map(|f| f.symbol()).collect()
            }
        }
    }

    /// Makes a call and records it for the watching process.
    fn during<T>(&self, function: Function, call: impl FnOnce() -> T) -> T {
        let done = self.place.call(function.number(), call);
        surroundings::keep();
        done
    }

    /// The text that a function without arguments returns; `None` if the library has no such function, or it returns NULL.
    ///
    /// # Safety
    /// The function may be called now.
    unsafe fn text_of(
        &self,
        function: Function,
        call: Option<unsafe extern "C" fn() -> *const c_char>,
    ) -> Option<String> {
        // SAFETY: the caller vouches for it.
        let text = self.during(function, || call.map(|call| unsafe { call() }))?;
        // SAFETY: it is NULL or a static string (FMI 2.0, section 2.1.4).
        unsafe { owned_result(text, function.name()) }
    }

    fn check_version(&self) -> Result<(), BindingError> {
        // SAFETY: these functions take no argument and need no instance (FMI 2.0, section 2.1.4; FMI 3.0, section
        // 2.2.4).
        let (version, platform, expected) = unsafe {
            match &self.functions {
                Functions::Fmi2(f) => {
                    let of = Function::Fmi2;
                    (
                        self.text_of(of(abi2::Function::GetVersion), f.get_version),
                        self.text_of(of(abi2::Function::GetTypesPlatform), f.get_types_platform),
                        abi2::VERSION,
                    )
                }
                Functions::Fmi3(f) => {
                    let function = Function::Fmi3(abi3::Function::GetVersion);
                    (self.text_of(function, f.get_version), None, abi3::VERSION)
                }
            }
        };
        let expected = expected.to_str().unwrap_or_default();
        // Releases 2.0.1 to 2.0.5 all return "2.0", those of 3.0 likewise; some tools return the release.
        if let Some(found) = version.filter(|v| !v.starts_with(expected)) {
            return Err(BindingError::Version { found, expected });
        }
        let expected = abi2::TYPES_PLATFORM.to_str().unwrap_or_default();
        match platform.filter(|p| p != expected) {
            Some(found) => Err(BindingError::TypesPlatform { found, expected }),
            None => Ok(()),
        }
    }
}

/// The function of FMI 3.0 that creates an instance of a kind.
fn instantiate3(kind: InterfaceType) -> abi3::Function {
    match kind {
        InterfaceType::CoSimulation => abi3::Function::InstantiateCoSimulation,
        InterfaceType::ModelExchange => abi3::Function::InstantiateModelExchange,
        InterfaceType::ScheduledExecution => abi3::Function::InstantiateScheduledExecution,
    }
}

impl std::fmt::Debug for Binding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Binding").field("path", &self.path).finish()
    }
}

/// A copy of a C string; `None` for NULL.
///
/// # Safety
/// `text` is NULL or points to a NUL-terminated string.
pub(super) unsafe fn owned(text: *const c_char) -> Option<String> {
    if text.is_null() {
        return None;
    }
    // SAFETY: not NULL, and the caller vouches for the rest.
    let bytes = unsafe { CStr::from_ptr(text) }.to_bytes();
    Some(String::from_utf8_lossy(bytes).into_owned())
}

/// As [`owned`], of a text that a function of an FMU returned. Notes if it is NULL or not UTF-8.
///
/// # Safety
/// As [`owned`].
pub(super) unsafe fn owned_result(text: *const c_char, function: &'static str) -> Option<String> {
    if text.is_null() {
        note(Misuse::NoText { function });
        return None;
    }
    // SAFETY: as in [`owned`].
    let text = unsafe { CStr::from_ptr(text) };
    if text.to_str().is_err() {
        note(Misuse::OtherText { function });
    }
    Some(text.to_string_lossy().into_owned())
}

/// As [`owned`], but truncated to a readable length: an FMU may log hundreds of megabytes.
///
/// # Safety
/// As [`owned`].
pub(super) unsafe fn owned_message(text: *const c_char) -> Option<String> {
    const LONGEST: usize = 1 << 16;
    if text.is_null() {
        return None;
    }
    // SAFETY: as in [`owned`].
    let bytes = unsafe { CStr::from_ptr(text) }.to_bytes();
    let mut shown = String::from_utf8_lossy(&bytes[..bytes.len().min(LONGEST)]).into_owned();
    if bytes.len() > LONGEST {
        shown += &format!(" ... ({} bytes in all)", bytes.len());
    }
    Some(shown)
}
