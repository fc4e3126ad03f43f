//! Value types, status codes and callbacks (FMI 2.0.5, sections 2.1.2, 2.1.3, 2.1.5 and 4.2.3).

use std::ffi::{CStr, c_char, c_int, c_uint, c_void};

/// `fmi2TypesPlatform`: what `fmi2GetTypesPlatform` returns for the types below.
pub const TYPES_PLATFORM: &CStr = c"default";

/// `fmi2Version`: what `fmi2GetVersion` returns, for every FMI 2.0.x.
pub const VERSION: &CStr = c"2.0";

/// `fmi2Component`: opaque pointer to an instance, made by the FMU.
pub type Component = *mut c_void;

/// `fmi2ComponentEnvironment`: opaque pointer of the importer, passed back in callbacks.
pub type ComponentEnvironment = *mut c_void;

/// `fmi2FMUstate`: opaque pointer to a copy of an instance's complete state.
pub type FmuState = *mut c_void;

/// `fmi2ValueReference`: handle of a variable.
pub type ValueReference = c_uint;

/// `fmi2Real`.
pub type Real = f64;

/// `fmi2Integer`.
pub type Integer = c_int;

/// `fmi2Boolean`: [`TRUE`] or [`FALSE`].
pub type Boolean = c_int;

/// `fmi2Char`.
pub type Char = c_char;

/// `fmi2Byte`.
pub type Byte = c_char;

/// `fmi2True`.
pub const TRUE: Boolean = 1;

/// `fmi2False`.
pub const FALSE: Boolean = 0;

/// `fmi2Status`. Not a Rust enum: a foreign binary may return any number.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Status(pub c_int);

impl Status {
    /// Success.
    pub const OK: Self = Self(0);
    /// A minor problem; the computation can continue. The FMU has logged the reason.
    pub const WARNING: Self = Self(1);
    /// The step was not completed, or the requested information is not available.
    pub const DISCARD: Self = Self(2);
    /// This instance cannot continue; it may be reset, freed or set to an earlier FMU state.
    pub const ERROR: Self = Self(3);
    /// No instance of this FMU can continue.
    pub const FATAL: Self = Self(4);
    /// The step continues asynchronously (`fmi2DoStep` and `fmi2GetStatus` only).
    pub const PENDING: Self = Self(5);

    /// The standard's name, such as `fmi2Error`; `None` for a number that FMI does not define.
    pub fn name(self) -> Option<&'static str> {
        let names = [
            "fmi2OK",
            "fmi2Warning",
            "fmi2Discard",
            "fmi2Error",
            "fmi2Fatal",
            "fmi2Pending",
        ];
        usize::try_from(self.0)
            .ok()
            .and_then(|i| names.get(i).copied())
    }
}

/// `fmi2Type`: purpose of an instance. Not a Rust enum: an importer may pass any number.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Type(pub c_int);

impl Type {
    /// `fmi2ModelExchange`.
    pub const MODEL_EXCHANGE: Self = Self(0);
    /// `fmi2CoSimulation`.
    pub const CO_SIMULATION: Self = Self(1);
}

/// `fmi2EventInfo`: result of `fmi2NewDiscreteStates` (FMI 2.0.5, section 3.2.2).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EventInfo {
    /// The event iteration continues: call `fmi2NewDiscreteStates` again.
    pub new_discrete_states_needed: Boolean,
    /// The model requests the end of the simulation.
    pub terminate_simulation: Boolean,
    /// The nominal values of the states have changed.
    pub nominals_of_continuous_states_changed: Boolean,
    /// The values of the states have changed.
    pub values_of_continuous_states_changed: Boolean,
    /// The time of the next time event is known.
    pub next_event_time_defined: Boolean,
    /// Time of that event \[s\].
    pub next_event_time: Real,
}

/// `fmi2StatusKind`: the information that the `fmi2GetXXXStatus` functions return.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StatusKind(pub c_int);

impl StatusKind {
    /// `fmi2DoStepStatus`, by `fmi2GetStatus`: status of an asynchronous step.
    pub const DO_STEP_STATUS: Self = Self(0);
    /// `fmi2PendingStatus`, by `fmi2GetStringStatus`: a text about a pending step.
    pub const PENDING_STATUS: Self = Self(1);
    /// `fmi2LastSuccessfulTime`, by `fmi2GetRealStatus`: time reached by a discarded step.
    pub const LAST_SUCCESSFUL_TIME: Self = Self(2);
    /// `fmi2Terminated`, by `fmi2GetBooleanStatus`: whether the component requests the end of the simulation.
    pub const TERMINATED: Self = Self(3);
}

/// `fmi2CallbackLogger`: environment, instance name, status, category, printf format, values.
pub type CallbackLogger =
    unsafe extern "C" fn(ComponentEnvironment, *const Char, Status, *const Char, *const Char, ...);

/// `fmi2CallbackAllocateMemory`: zeroed memory for that many objects of that size, or NULL.
pub type CallbackAllocateMemory = unsafe extern "C" fn(usize, usize) -> *mut c_void;

/// `fmi2CallbackFreeMemory`.
pub type CallbackFreeMemory = unsafe extern "C" fn(*mut c_void);

/// `fmi2StepFinished`: an asynchronous step ended.
pub type StepFinished = unsafe extern "C" fn(ComponentEnvironment, Status);

/// `fmi2CallbackFunctions`: functions of the importer that an instance may call. `None` is NULL.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct CallbackFunctions {
    /// Receives the instance's messages.
    pub logger: Option<CallbackLogger>,
    /// Allocates memory; use is discouraged since 2.0.2.
    pub allocate_memory: Option<CallbackAllocateMemory>,
    /// Frees memory allocated by `allocate_memory`.
    pub free_memory: Option<CallbackFreeMemory>,
    /// Called when an asynchronous step ends; NULL: the importer polls.
    pub step_finished: Option<StepFinished>,
    /// Passed back as the first argument of `logger` and `step_finished`.
    pub component_environment: ComponentEnvironment,
}
