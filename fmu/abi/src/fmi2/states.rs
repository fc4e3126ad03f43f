//! The states of an instance: of a co-simulation component (FMI 2.0.5, section 4.2.4, "State Machine of
//! Calling Sequence from Master to Slave") and of a model for model exchange (section 3.2.3).

/// One state of an instance. Calling order is a property of the instance, not of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum State {
    /// Before instantiation, or after the instance is freed.
    StartEnd = 1,
    /// After `fmi2Instantiate` or `fmi2Reset`.
    Instantiated = 1 << 1,
    /// Between `fmi2EnterInitializationMode` and `fmi2ExitInitializationMode`.
    InitializationMode = 1 << 2,
    /// Initialised; the last step is complete.
    StepComplete = 1 << 3,
    /// An asynchronous step is in progress.
    StepInProgress = 1 << 4,
    /// The last step was discarded.
    StepFailed = 1 << 5,
    /// The last step was cancelled.
    StepCanceled = 1 << 6,
    /// Model exchange: an event is being handled; also the state after initialization.
    EventMode = 1 << 10,
    /// Model exchange: continuous integration.
    ContinuousTimeMode = 1 << 11,
    /// After `fmi2Terminate`.
    Terminated = 1 << 7,
    /// A function returned `fmi2Error`.
    Error = 1 << 8,
    /// A function returned `fmi2Fatal`.
    Fatal = 1 << 9,
}

impl State {
    /// All states, in the order of the standard's table.
    pub const ALL: [Self; 12] = [
        Self::StartEnd,
        Self::Instantiated,
        Self::InitializationMode,
        Self::StepComplete,
        Self::StepInProgress,
        Self::StepFailed,
        Self::StepCanceled,
        Self::EventMode,
        Self::ContinuousTimeMode,
        Self::Terminated,
        Self::Error,
        Self::Fatal,
    ];

    /// The standard's name of the state.
    pub const fn name(self) -> &'static str {
        match self {
            Self::StartEnd => "start/end",
            Self::Instantiated => "instantiated",
            Self::InitializationMode => "initialization mode",
            Self::StepComplete => "stepComplete",
            Self::StepInProgress => "stepInProgress",
            Self::StepFailed => "stepFailed",
            Self::StepCanceled => "stepCanceled",
            Self::EventMode => "event mode",
            Self::ContinuousTimeMode => "continuous-time mode",
            Self::Terminated => "terminated",
            Self::Error => "error",
            Self::Fatal => "fatal",
        }
    }
}

crate::tables::states! { State, u16 }

use State::*;

/// All states: the function needs no instance.
pub const ANY: States = States::of(&State::ALL);
/// States in which an instance exists and has had no fatal error.
pub const ALIVE: States = States::of(&[
    Instantiated,
    InitializationMode,
    StepComplete,
    StepInProgress,
    StepFailed,
    StepCanceled,
    EventMode,
    ContinuousTimeMode,
    Terminated,
    Error,
]);
/// As [`ALIVE`], except while a step is in progress.
pub const IDLE: States = States::of(&[
    Instantiated,
    InitializationMode,
    StepComplete,
    StepFailed,
    StepCanceled,
    EventMode,
    ContinuousTimeMode,
    Terminated,
    Error,
]);
/// States in which values may be read; in stepFailed, stepCanceled and error for debugging only.
pub const READ: States = States::of(&[
    InitializationMode,
    StepComplete,
    StepFailed,
    StepCanceled,
    EventMode,
    ContinuousTimeMode,
    Terminated,
    Error,
]);
/// States in which values may be set; which values depends on the state (see the footnotes of the table).
pub const WRITE: States = States::of(&[
    Instantiated,
    InitializationMode,
    StepComplete,
    EventMode,
    ContinuousTimeMode,
]);
/// States in which output derivatives may be read.
pub const STEPPED: States =
    States::of(&[StepComplete, StepFailed, StepCanceled, Terminated, Error]);
/// States in which states, derivatives and event indicators of model exchange may be read.
pub const CONTINUOUS: States = States::of(&[
    InitializationMode,
    EventMode,
    ContinuousTimeMode,
    Terminated,
    Error,
]);
/// States in which the states' nominal values may be read.
pub const NOMINALS: States = States::of(&[
    Instantiated,
    InitializationMode,
    EventMode,
    ContinuousTimeMode,
    Terminated,
    Error,
]);
/// States in which the status of a step may be queried.
pub const STATUS: States = States::of(&[StepComplete, StepInProgress, StepFailed, Terminated]);
