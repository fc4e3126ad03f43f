//! An instance of an FMU for co-simulation, safe to call in any order.

use super::binding::{Binding, owned};
use super::description::ModelDescription;
use super::logger::{self, Mailbox, Message};
use pilotage_abi::{
    Boolean, CallbackFunctions, Component, FALSE, FmuState, Function, State, Status, StatusKind,
    TRUE, Type,
};
use std::ffi::{CString, c_char, c_void};
use std::path::Path;
use std::ptr;
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;
use thiserror::Error;

/// What a call of an FMU can end with.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum CallError {
    /// `fmi2Instantiate` returned NULL.
    #[error("fmi2Instantiate refused{}", said(messages))]
    NotInstantiated {
        /// What the FMU said.
        messages: Vec<Message>,
    },
    /// A name that C cannot hold.
    #[error("{text:?} contains a NUL, which C strings cannot hold")]
    Nul {
        /// The text.
        text: String,
    },
    /// A call that the standard does not allow now; it was not made.
    #[error("{} is not allowed in state {}", function.name(), state.name())]
    NotAllowed {
        /// The function.
        function: Function,
        /// The state that the instance is in.
        state: State,
    },
    /// The binary lacks the function.
    #[error("the FMU's binary has no function `{}`", function.name())]
    MissingFunction {
        /// The function.
        function: Function,
    },
    /// The FMU says in its description that it cannot do this.
    #[error("the FMU declares {flag}=\"false\"")]
    NotCapable {
        /// The attribute of `<CoSimulation>`.
        flag: &'static str,
    },
    /// The call was made and failed.
    #[error("{} returned {}{}", function.name(), name_of(*status), said(messages))]
    Failed {
        /// The function.
        function: Function,
        /// What it returned.
        status: Status,
        /// What the FMU said.
        messages: Vec<Message>,
    },
}

/// The status's name, or its number if FMI defines none.
fn name_of(status: Status) -> String {
    match status.name() {
        Some(name) => name.to_owned(),
        None => format!("{}, which is no fmi2Status", status.0),
    }
}

/// The last messages, to be put behind an error.
fn said(messages: &[Message]) -> String {
    const SHOWN: usize = 3;
    let from = messages.len().saturating_sub(SHOWN);
    let texts: Vec<&str> = messages[from..].iter().map(|m| m.text.as_str()).collect();
    match texts.is_empty() {
        true => " without a message".to_owned(),
        false => format!(": {}", texts.join("; ")),
    }
}

/// How a communication step ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// At its end.
    Done,
    /// Before its end (`fmi2Discard`).
    Discarded {
        /// `fmi2LastSuccessfulTime` [s], if the FMU says.
        last_successful: Option<f64>,
        /// `fmi2Terminated`: the FMU wants the simulation to end.
        is_end_requested: bool,
    },
}

/// A library in use and the folder that it was unpacked into.
#[derive(Debug)]
pub(super) struct Loaded {
    // Unloaded before its folder goes: fields drop in this order.
    pub(super) binding: Binding,
    pub(super) folder: TempDir,
}

/// A copy of an instance's state, held by the FMU; valid for the instance that made it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Saved {
    slot: usize,
    owner: usize,
    state: State,
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

    /// `fmi2SetReal`.
    ///
    /// # Panics
    /// If there are not as many values as references, here and in the calls below.
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        assert_eq!(references.len(), values.len());
        self.allow(Function::SetReal)?;
        let call = self.optional(Function::SetReal, self.loaded.binding.set_real)?;
        let n = references.len();
        // SAFETY: the instance is alive, both arrays have `n` elements.
        let status = unsafe { call(self.component, references.as_ptr(), n, values.as_ptr()) };
        self.check(Function::SetReal, status)
    }

    /// `fmi2GetReal`.
    pub fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        assert_eq!(references.len(), values.len());
        self.allow(Function::GetReal)?;
        let call = self.optional(Function::GetReal, self.loaded.binding.get_real)?;
        let n = references.len();
        // SAFETY: the instance is alive, both arrays have `n` elements.
        let status = unsafe { call(self.component, references.as_ptr(), n, values.as_mut_ptr()) };
        self.check(Function::GetReal, status)
    }

    /// `fmi2SetInteger`, of one variable.
    pub fn set_integer(&mut self, reference: u32, value: i32) -> Result<(), CallError> {
        self.allow(Function::SetInteger)?;
        let call = self.optional(Function::SetInteger, self.loaded.binding.set_integer)?;
        // SAFETY: the instance is alive, both pointers are to one element.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw const value) };
        self.check(Function::SetInteger, status)
    }

    /// `fmi2GetInteger`, of one variable.
    pub fn get_integer(&mut self, reference: u32) -> Result<i32, CallError> {
        self.allow(Function::GetInteger)?;
        let call = self.optional(Function::GetInteger, self.loaded.binding.get_integer)?;
        let mut value = 0;
        // SAFETY: the instance is alive, both pointers are to one element.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw mut value) };
        self.check(Function::GetInteger, status).map(|()| value)
    }

    /// `fmi2SetBoolean`, of one variable.
    pub fn set_boolean(&mut self, reference: u32, value: bool) -> Result<(), CallError> {
        self.allow(Function::SetBoolean)?;
        let call = self.optional(Function::SetBoolean, self.loaded.binding.set_boolean)?;
        let value: Boolean = if value { TRUE } else { FALSE };
        // SAFETY: the instance is alive, both pointers are to one element.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw const value) };
        self.check(Function::SetBoolean, status)
    }

    /// `fmi2GetBoolean`, of one variable.
    pub fn get_boolean(&mut self, reference: u32) -> Result<bool, CallError> {
        self.allow(Function::GetBoolean)?;
        let call = self.optional(Function::GetBoolean, self.loaded.binding.get_boolean)?;
        let mut value: Boolean = FALSE;
        // SAFETY: the instance is alive, both pointers are to one element.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw mut value) };
        self.check(Function::GetBoolean, status)
            .map(|()| value != FALSE)
    }

    /// `fmi2SetString`, of one variable.
    pub fn set_string(&mut self, reference: u32, value: &str) -> Result<(), CallError> {
        self.allow(Function::SetString)?;
        let call = self.optional(Function::SetString, self.loaded.binding.set_string)?;
        let value = c_string(value)?;
        let pointer = value.as_ptr();
        // SAFETY: the instance is alive, both pointers are to one element, and the string lives
        // until the call returns.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw const pointer) };
        self.check(Function::SetString, status)
    }

    /// `fmi2GetString`, of one variable.
    pub fn get_string(&mut self, reference: u32) -> Result<String, CallError> {
        self.allow(Function::GetString)?;
        let call = self.optional(Function::GetString, self.loaded.binding.get_string)?;
        let mut pointer: *const c_char = ptr::null();
        // SAFETY: the instance is alive, both pointers are to one element.
        let status = unsafe { call(self.component, &raw const reference, 1, &raw mut pointer) };
        self.check(Function::GetString, status)?;
        // SAFETY: after success it is NULL or a string that lives until the next call.
        Ok(unsafe { owned(pointer) }.unwrap_or_default())
    }

    /// `fmi2DoStep`; nobody will go back before `t`. A pending step is waited for.
    pub fn do_step(&mut self, t: f64, h: f64) -> Result<Step, CallError> {
        self.step(t, h, TRUE)
    }

    /// `fmi2DoStep`, after which a state [saved](Self::save) before may be restored.
    pub fn do_step_revocably(&mut self, t: f64, h: f64) -> Result<Step, CallError> {
        self.step(t, h, FALSE)
    }

    fn step(&mut self, t: f64, h: f64, no_set_state_prior: Boolean) -> Result<Step, CallError> {
        self.allow(Function::DoStep)?;
        // SAFETY: the instance is alive and in a state that allows the call.
        let mut status =
            unsafe { (self.loaded.binding.do_step)(self.component, t, h, no_set_state_prior) };
        if status == Status::PENDING {
            status = self.wait_for_step()?;
        }
        if status == Status::DISCARD {
            self.state = State::StepFailed;
            return Ok(self.discarded());
        }
        self.check(Function::DoStep, status).map(|()| Step::Done)
    }

    /// Asks until a pending step has ended.
    fn wait_for_step(&mut self) -> Result<Status, CallError> {
        let get_status = self.optional(Function::GetStatus, self.loaded.binding.get_status)?;
        loop {
            let mut status = Status::PENDING;
            let kind = StatusKind::DO_STEP_STATUS;
            // SAFETY: the instance is alive and its step is in progress.
            let asked = unsafe { get_status(self.component, kind, &raw mut status) };
            self.check(Function::GetStatus, asked)?;
            if status != Status::PENDING {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_micros(100));
        }
    }

    /// What the FMU tells about a discarded step.
    fn discarded(&self) -> Step {
        let binding = &self.loaded.binding;
        let mut time = f64::NAN;
        let mut terminated = FALSE;
        // SAFETY: the instance is alive and its step has failed, which allows both calls.
        let (has_time, has_terminated) = unsafe {
            let kind = StatusKind::LAST_SUCCESSFUL_TIME;
            let real = binding.get_real_status;
            let has_time = real.map(|f| f(self.component, kind, &raw mut time));
            let kind = StatusKind::TERMINATED;
            let boolean = binding.get_boolean_status;
            (
                has_time,
                boolean.map(|f| f(self.component, kind, &raw mut terminated)),
            )
        };
        Step::Discarded {
            last_successful: (has_time == Some(Status::OK) && time.is_finite()).then_some(time),
            is_end_requested: has_terminated == Some(Status::OK) && terminated != FALSE,
        }
    }

    /// `fmi2GetFMUstate`: saves the complete state, to be restored any number of times.
    pub fn save(&mut self) -> Result<Saved, CallError> {
        let saved = Saved {
            slot: self.saved.len(),
            owner: self.component.addr(),
            state: self.state,
        };
        self.saved.push(ptr::null_mut());
        self.save_into(saved)
    }

    /// `fmi2GetFMUstate`: saves the complete state in the place of one saved before.
    ///
    /// # Panics
    /// If `saved` belongs to another instance or was freed, here and below.
    pub fn save_into(&mut self, saved: Saved) -> Result<Saved, CallError> {
        let call = self.state_function(Function::GetFmuState, self.loaded.binding.get_fmu_state)?;
        let state = self.state;
        let place = self.place(saved);
        // SAFETY: the instance is alive; the place holds NULL or a state that it made.
        let status = unsafe { call(self.component, &raw mut self.saved[place]) };
        self.check(Function::GetFmuState, status)?;
        Ok(Saved { state, ..saved })
    }

    /// `fmi2SetFMUstate`: goes back to a saved state.
    pub fn restore(&mut self, saved: Saved) -> Result<(), CallError> {
        let call = self.state_function(Function::SetFmuState, self.loaded.binding.set_fmu_state)?;
        let place = self.place(saved);
        // SAFETY: the instance is alive and made this state.
        let status = unsafe { call(self.component, self.saved[place]) };
        self.check(Function::SetFmuState, status)?;
        self.state = saved.state;
        Ok(())
    }

    /// `fmi2FreeFMUstate`. States that are not freed go with the instance.
    pub fn free(&mut self, saved: Saved) -> Result<(), CallError> {
        let call =
            self.state_function(Function::FreeFmuState, self.loaded.binding.free_fmu_state)?;
        let place = self.place(saved);
        // SAFETY: the instance is alive and made this state; the FMU writes NULL back.
        let status = unsafe { call(self.component, &raw mut self.saved[place]) };
        self.saved[place] = ptr::null_mut();
        self.check(Function::FreeFmuState, status)
    }

    fn place(&self, saved: Saved) -> usize {
        assert_eq!(
            saved.owner,
            self.component.addr(),
            "a state of another instance"
        );
        saved.slot
    }

    fn state_function<T>(&self, function: Function, pointer: Option<T>) -> Result<T, CallError> {
        if !self.can_save {
            let flag = "canGetAndSetFMUstate";
            return Err(CallError::NotCapable { flag });
        }
        self.allow(function)?;
        self.optional(function, pointer)
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
