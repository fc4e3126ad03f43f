//! An instance of an FMU for co-simulation, safe to call in any order.

mod error;
mod states;
mod stepping;
mod values;

pub use error::CallError;
pub use states::Saved;
pub use stepping::Step;

use super::binding::Binding;
use super::description::ModelDescription;
use super::logger::{self, Mailbox, Message};
use pilotage_abi::fmi2::{
    CallbackFunctions, Component, FALSE, FmuState, Function, State, Status, TRUE, Type,
};
use std::ffi::{CString, c_char, c_void};
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;

/// A library in use and the folder that it was unpacked into.
#[derive(Debug)]
pub(super) struct Loaded {
    // Unloaded before its folder goes: fields drop in this order.
    pub(super) binding: Binding,
    pub(super) folder: TempDir,
}

/// An instance of an FMU.
///
/// Calls are checked against the standard's state machine (FMI 2.0, section 4.2.4) before they are
/// made. After `fmi2Fatal` nothing is called any more, not even `fmi2FreeInstance`.
#[derive(Debug)]
pub struct Instance {
    loaded: Arc<Loaded>,
    component: Component,
    /// The FMU may keep the address until it is freed.
    _callbacks: Box<CallbackFunctions>,
    mailbox: Mailbox,
    state: State,
    can_save: bool,
    saved: Vec<FmuState>,
}

impl Instance {
    /// Instantiates for co-simulation, without window.
    ///
    /// # Errors
    /// If the FMU refuses, most often because the GUIDs of description and binary differ.
    pub(super) fn new(
        loaded: Arc<Loaded>,
        description: &ModelDescription,
        name: &str,
    ) -> Result<Self, CallError> {
        let mailbox = Mailbox::new();
        let callbacks = Box::new(CallbackFunctions {
            logger: Some(logger::callback()),
            allocate_memory: Some(calloc),
            free_memory: Some(free),
            step_finished: None,
            component_environment: mailbox.environment(),
        });
        let (c_name, guid) = (c_string(name)?, c_string(&description.guid)?);
        let resources = c_string(&file_uri(&loaded.folder.path().join("resources")))?;
        // SAFETY: all strings end with a NUL and live until the call returns; the callbacks live
        // as long as the instance.
        let component = unsafe {
            (loaded.binding.instantiate)(
                c_name.as_ptr(),
                Type::CO_SIMULATION,
                guid.as_ptr(),
                resources.as_ptr(),
                &raw const *callbacks,
                FALSE,
                TRUE,
            )
        };
        if component.is_null() {
            let messages = mailbox.take();
            return Err(CallError::NotInstantiated { messages });
        }
        let cs = description.co_simulation.as_ref();
        let instance = Self {
            loaded,
            component,
            _callbacks: callbacks,
            mailbox,
            state: State::Instantiated,
            can_save: cs.is_some_and(|cs| cs.can_get_and_set_fmu_state),
            saved: Vec::new(),
        };
        instance.log_trouble_only(description);
        Ok(instance)
    }

    /// Logging was on for `fmi2Instantiate`, so that a refusal has a reason. From now on, only the
    /// standard's categories for trouble are asked for, those that the FMU has.
    fn log_trouble_only(&self, description: &ModelDescription) {
        const TROUBLE: [&str; 4] = [
            "logStatusWarning",
            "logStatusDiscard",
            "logStatusError",
            "logStatusFatal",
        ];
        let Some(set_debug_logging) = self.loaded.binding.set_debug_logging else {
            return;
        };
        let declared = description.log_categories.iter().map(|c| c.name.as_str());
        let wanted = declared.filter(|name| TROUBLE.contains(name));
        let names: Vec<CString> = wanted.filter_map(|name| CString::new(name).ok()).collect();
        let pointers: Vec<*const c_char> = names.iter().map(|n| n.as_ptr()).collect();
        let on = if pointers.is_empty() { FALSE } else { TRUE };
        // SAFETY: the instance is alive; the strings live until the call returns. Whether the FMU
        // obeys is not important.
        unsafe { set_debug_logging(self.component, on, pointers.len(), pointers.as_ptr()) };
    }

    /// The state that the instance is in.
    pub fn state(&self) -> State {
        self.state
    }

    /// Takes what the FMU has said since the last time.
    pub fn take_messages(&self) -> Vec<Message> {
        self.mailbox.take()
    }

    /// `fmi2SetupExperiment`, with a stop time.
    ///
    /// # Errors
    /// See [`CallError`], here and in all calls below.
    pub fn setup_experiment(
        &mut self,
        tolerance: Option<f64>,
        start: f64,
        stop: f64,
    ) -> Result<(), CallError> {
        self.allow(Function::SetupExperiment)?;
        let defined = if tolerance.is_some() { TRUE } else { FALSE };
        let tolerance = tolerance.unwrap_or(0.0);
        let call = self.loaded.binding.setup_experiment;
        // SAFETY: the instance is alive and in a state that allows the call.
        let status = unsafe { call(self.component, defined, tolerance, start, TRUE, stop) };
        self.check(Function::SetupExperiment, status)
    }

    /// `fmi2EnterInitializationMode`.
    pub fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        let call = self.loaded.binding.enter_initialization_mode;
        self.change(
            Function::EnterInitializationMode,
            call,
            State::InitializationMode,
        )
    }

    /// `fmi2ExitInitializationMode`.
    pub fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        let call = self.loaded.binding.exit_initialization_mode;
        self.change(Function::ExitInitializationMode, call, State::StepComplete)
    }

    /// `fmi2Terminate`.
    pub fn terminate(&mut self) -> Result<(), CallError> {
        let call = self.loaded.binding.terminate;
        self.change(Function::Terminate, call, State::Terminated)
    }

    /// `fmi2Reset`.
    pub fn reset(&mut self) -> Result<(), CallError> {
        let call = self.optional(Function::Reset, self.loaded.binding.reset)?;
        self.change(Function::Reset, call, State::Instantiated)
    }

    fn optional<T>(&self, function: Function, pointer: Option<T>) -> Result<T, CallError> {
        pointer.ok_or(CallError::MissingFunction { function })
    }

    fn allow(&self, function: Function) -> Result<(), CallError> {
        match function.is_legal_in(self.state) {
            true => Ok(()),
            false => Err(CallError::NotAllowed {
                function,
                state: self.state,
            }),
        }
    }

    /// A call without arguments that leads to another state.
    fn change(
        &mut self,
        function: Function,
        call: unsafe extern "C" fn(Component) -> Status,
        next: State,
    ) -> Result<(), CallError> {
        self.allow(function)?;
        // SAFETY: the instance is alive and in a state that allows the call.
        let status = unsafe { call(self.component) };
        self.check(function, status)?;
        self.state = next;
        Ok(())
    }

    /// Turns a returned status into a result and, if it is bad, into a state.
    fn check(&mut self, function: Function, status: Status) -> Result<(), CallError> {
        if status == Status::OK || status == Status::WARNING {
            return Ok(());
        }
        match status {
            // The value or the information is not available; the instance lives on.
            Status::DISCARD => {}
            Status::FATAL => self.state = State::Fatal,
            _ => self.state = State::Error,
        }
        Err(CallError::Failed {
            function,
            status,
            messages: self.mailbox.take(),
        })
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if !Function::FreeInstance.is_legal_in(self.state) {
            return;
        }
        if let Some(free_state) = self.loaded.binding.free_fmu_state {
            for state in self.saved.iter_mut().filter(|state| !state.is_null()) {
                // SAFETY: the instance is alive and made this state.
                unsafe { free_state(self.component, state) };
            }
        }
        // SAFETY: the instance is alive and nobody calls it again.
        unsafe { (self.loaded.binding.free_instance)(self.component) };
    }
}

unsafe extern "C" {
    /// C library: zeroed memory, or NULL. Given to FMUs as it is.
    fn calloc(count: usize, size: usize) -> *mut c_void;
    /// C library: gives memory of `calloc` back. Given to FMUs as it is.
    fn free(memory: *mut c_void);
}

fn c_string(text: &str) -> Result<CString, CallError> {
    CString::new(text).map_err(|_| CallError::Nul {
        text: text.to_owned(),
    })
}

/// `file:` URI of an absolute path (RFC 8089), everything unusual percent-encoded.
fn file_uri(path: &Path) -> String {
    let path = path.to_string_lossy().replace('\\', "/");
    let slash = if path.starts_with('/') { "" } else { "/" };
    let mut uri = format!("file://{slash}");
    for byte in path.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'.' | b'_' | b'~' | b':' => {
                uri.push(char::from(byte));
            }
            _ => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_become_uris() {
        for (path, uri) in [
            ("/tmp/a b/ä", "file:///tmp/a%20b/%C3%A4"),
            ("C:\\x\\y", "file:///C:/x/y"),
            ("/a%20b", "file:///a%2520b"),
        ] {
            assert_eq!(file_uri(Path::new(path)), uri);
        }
    }
}
