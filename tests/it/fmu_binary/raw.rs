//! The exported library, called as C would call it: nothing is checked on this side.

use libloading::Library;
use pilotage::export::{Export, Platform, Provenance};
use pilotage::fmi::description::FmiVersion;
use pilotage::models::Model;
use pilotage_abi::fmi2::functions::{Function, pointers};
use pilotage_abi::fmi2::types::*;
use pilotage_sdk::variable::reference;
use std::ffi::{CStr, CString, c_void};
use std::io::Cursor;
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::Mutex;
use tempfile::TempDir;

/// An FMU, unpacked and loaded.
pub struct Raw {
    pub library: Library,
    pub model: Model,
    pub folder: TempDir,
}

/// What the logger received: status, category and format, one line each.
#[derive(Default)]
pub struct Messages(Mutex<Vec<String>>);

impl Messages {
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut *self.0.lock().unwrap())
    }

    /// Callbacks that bring messages here.
    pub fn callbacks(&self) -> CallbackFunctions {
        type FiveArguments = unsafe extern "C" fn(
            ComponentEnvironment,
            *const Char,
            Status,
            *const Char,
            *const Char,
        );
        let receive: FiveArguments = receive;
        CallbackFunctions {
            // SAFETY: our library passes no values after the format, and a callee that reads the named
            // arguments alone takes them as a variadic one would.
            logger: Some(unsafe { std::mem::transmute::<FiveArguments, CallbackLogger>(receive) }),
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: std::ptr::from_ref(self).cast_mut().cast(),
        }
    }
}

unsafe extern "C" fn receive(
    environment: ComponentEnvironment,
    name: *const Char,
    status: Status,
    category: *const Char,
    format: *const Char,
) {
    // SAFETY: the environment is the `Messages` that made the callbacks; the rest are C strings.
    let (messages, name, category, format) = unsafe {
        (
            &*environment.cast::<Messages>(),
            CStr::from_ptr(name).to_string_lossy(),
            CStr::from_ptr(category).to_string_lossy(),
            CStr::from_ptr(format).to_string_lossy(),
        )
    };
    let status = status.name().unwrap_or("?");
    let line = format!("{name}: {status} [{category}] {format}");
    messages.0.lock().unwrap().push(line);
}

impl Raw {
    /// Exports, unpacks and loads.
    pub fn new(model: Model) -> Self {
        let bytes = Export::new(&model, &Provenance::default()).bytes().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
        archive.extract(folder.path()).unwrap();
        // SAFETY: the library is ours; its initialization does nothing.
        let library = unsafe { Library::new(Self::binary(&model, folder.path())) }.unwrap();
        Self {
            library,
            model,
            folder,
        }
    }

    pub fn binary(model: &Model, folder: &Path) -> std::path::PathBuf {
        folder.join(
            &Platform::host()
                .unwrap()
                .paths(FmiVersion::V2, model.kind().name())[0],
        )
    }

    /// The address of a function.
    ///
    /// # Safety
    /// `T` is the pointer type of this function.
    pub unsafe fn function<T: Copy>(&self, function: Function) -> T {
        // SAFETY: as the caller promises.
        *unsafe { self.library.get::<T>(function.symbol()) }.unwrap()
    }

    pub fn location(&self) -> String {
        format!("file://{}", self.folder.path().join("resources").display())
    }

    /// An instance as importers make it, named `test`, with logging on.
    pub fn instantiate(&self, messages: &Messages) -> Instance<'_> {
        self.instantiate_as(Type::CO_SIMULATION, messages)
    }

    /// As [`instantiate`](Self::instantiate), for either kind.
    pub fn instantiate_as(&self, kind: Type, messages: &Messages) -> Instance<'_> {
        let guid = self.model.guid();
        let component = self.try_instantiate(
            Some("test"),
            kind,
            Some(&guid),
            Some(&self.location()),
            Some(messages.callbacks()),
        );
        assert!(!component.is_null(), "{:?}", messages.take());
        Instance {
            raw: self,
            component,
        }
    }

    /// `fmi2Instantiate`, `None` for NULL.
    pub fn try_instantiate(
        &self,
        name: Option<&str>,
        kind: Type,
        guid: Option<&str>,
        location: Option<&str>,
        callbacks: Option<CallbackFunctions>,
    ) -> Component {
        let strings = [name, guid, location].map(|s| s.map(|s| CString::new(s).unwrap()));
        let [name, guid, location] = strings
            .each_ref()
            .map(|s| s.as_ref().map_or(null(), |s| s.as_ptr()));
        let callbacks = callbacks.as_ref().map_or(null(), std::ptr::from_ref);
        // SAFETY: the type is the function's; strings and callbacks live until it returns.
        unsafe {
            let f: pointers::Instantiate = self.function(Function::Instantiate);
            f(name, kind, guid, location, callbacks, FALSE, TRUE)
        }
    }
}

/// An instance, freed in the end.
pub struct Instance<'r> {
    pub raw: &'r Raw,
    pub component: Component,
}

impl Drop for Instance<'_> {
    fn drop(&mut self) {
        // SAFETY: it came from `fmi2Instantiate` of this library and is not used again.
        unsafe {
            let f: pointers::FreeInstance = self.raw.function(Function::FreeInstance);
            f(self.component);
        }
    }
}

/// Calls of functions whose first argument is the instance.
macro_rules! call {
    ($instance:expr, $function:ident $(, $argument:expr)*) => {{
        // SAFETY: the pointer type belongs to the function of the same name; the arguments are those
        // that the test means to pass, and the library must withstand NULLs among them.
        unsafe {
            let f: pilotage_abi::fmi2::functions::pointers::$function =
                $instance.raw.function(pilotage_abi::fmi2::Function::$function);
            f($instance.component $(, $argument)*)
        }
    }};
}
pub(crate) use call;

impl Instance<'_> {
    pub fn setup(&self, stop: Option<f64>) -> Status {
        let (defined, stop) = (Boolean::from(stop.is_some()), stop.unwrap_or(0.0));
        call!(self, SetupExperiment, FALSE, 0.0, 0.0, defined, stop)
    }

    /// Setup, enter, exit: ready to step from 0 s.
    pub fn initialize(&self) {
        assert_eq!(self.setup(None), Status::OK);
        assert_eq!(call!(self, EnterInitializationMode), Status::OK);
        assert_eq!(call!(self, ExitInitializationMode), Status::OK);
    }

    pub fn set(&self, name: &str, value: f64) -> Status {
        let reference = self.reference(name);
        call!(self, SetReal, &raw const reference, 1, &raw const value)
    }

    pub fn slope(&self, name: &str, value: f64) -> Status {
        let reference = self.reference(name);
        let order = 1;
        call!(
            self,
            SetRealInputDerivatives,
            &raw const reference,
            1,
            &raw const order,
            &raw const value
        )
    }

    pub fn step(&self, time: f64, step: f64) -> Status {
        call!(self, DoStep, time, step, TRUE)
    }

    /// All variables, by value reference.
    pub fn values(&self) -> Vec<f64> {
        let n = self.raw.model.variables().len();
        let references: Vec<ValueReference> = (1..=n as u32).collect();
        let mut values = vec![f64::NAN; n];
        let status = call!(self, GetReal, references.as_ptr(), n, values.as_mut_ptr());
        assert_eq!(status, Status::OK);
        values
    }

    pub fn bits(&self) -> Vec<u64> {
        self.values().iter().map(|v| v.to_bits()).collect()
    }

    pub fn reference(&self, name: &str) -> ValueReference {
        reference(self.raw.model.index(name).unwrap())
    }

    pub fn get_state(&self, mut state: FmuState) -> FmuState {
        assert_eq!(call!(self, GetFmuState, &raw mut state), Status::OK);
        assert!(!state.is_null());
        state
    }

    pub fn free_state(&self, mut state: FmuState) {
        assert_eq!(call!(self, FreeFmuState, &raw mut state), Status::OK);
        assert_eq!(state, null_mut::<c_void>());
    }

    pub fn serialize(&self, state: FmuState) -> Vec<u8> {
        let mut size = 0;
        assert_eq!(
            call!(self, SerializedFmuStateSize, state, &raw mut size),
            Status::OK
        );
        let mut bytes = vec![0_u8; size];
        let target = bytes.as_mut_ptr().cast();
        assert_eq!(
            call!(self, SerializeFmuState, state, target, size),
            Status::OK
        );
        bytes
    }

    pub fn deserialize(&self, bytes: &[u8]) -> (Status, FmuState) {
        let mut state = null_mut();
        let source = bytes.as_ptr().cast();
        let status = call!(
            self,
            DeSerializeFmuState,
            source,
            bytes.len(),
            &raw mut state
        );
        (status, state)
    }
}
