//! The states of an instance (FMI 3.0, sections 2.3, 3.3, 4.3 and 5.3).

/// One state of an instance. Calling order is a property of the instance, not of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum State {
    /// Before instantiation, or after the instance is freed.
    StartEnd = 1,
    /// After `fmi3InstantiateXXX` or `fmi3Reset`.
    Instantiated = 1 << 1,
    /// Structural parameters are set before initialization.
    ConfigurationMode = 1 << 2,
    /// Between `fmi3EnterInitializationMode` and `fmi3ExitInitializationMode`.
    InitializationMode = 1 << 3,
    /// An event is being handled.
    EventMode = 1 << 4,
    /// Model exchange: continuous integration.
    ContinuousTimeMode = 1 << 5,
    /// Co-simulation: ready for a step.
    StepMode = 1 << 6,
    /// Co-simulation: within a step, in the importer's callback.
    IntermediateUpdateMode = 1 << 7,
    /// Structural parameters are set while the simulation runs.
    ReconfigurationMode = 1 << 8,
    /// Scheduled execution: model partitions are activated.
    ClockActivationMode = 1 << 9,
    /// After `fmi3Terminate`.
    Terminated = 1 << 10,
    /// A function returned `fmi3Error`.
    Error = 1 << 11,
    /// A function returned `fmi3Fatal`.
    Fatal = 1 << 12,
}

impl State {
    /// All states.
    pub const ALL: [Self; 13] = [
        Self::StartEnd,
        Self::Instantiated,
        Self::ConfigurationMode,
        Self::InitializationMode,
        Self::EventMode,
        Self::ContinuousTimeMode,
        Self::StepMode,
        Self::IntermediateUpdateMode,
        Self::ReconfigurationMode,
        Self::ClockActivationMode,
        Self::Terminated,
        Self::Error,
        Self::Fatal,
    ];

    /// The standard's name of the state.
    pub const fn name(self) -> &'static str {
        match self {
            Self::StartEnd => "start/end",
            Self::Instantiated => "Instantiated",
            Self::ConfigurationMode => "Configuration Mode",
            Self::InitializationMode => "Initialization Mode",
            Self::EventMode => "Event Mode",
            Self::ContinuousTimeMode => "Continuous-Time Mode",
            Self::StepMode => "Step Mode",
            Self::IntermediateUpdateMode => "Intermediate Update Mode",
            Self::ReconfigurationMode => "Reconfiguration Mode",
            Self::ClockActivationMode => "Clock Activation Mode",
            Self::Terminated => "Terminated",
            Self::Error => "error",
            Self::Fatal => "fatal",
        }
    }
}

crate::tables::states! { State, u16 }

use State::*;

/// All states: the function needs no instance.
pub const ANY: States = States::of(&State::ALL);
/// States in which an instance exists, has had no fatal error and is not within a step.
pub const ALIVE: States = States::of(&[
    Instantiated,
    ConfigurationMode,
    InitializationMode,
    EventMode,
    ContinuousTimeMode,
    StepMode,
    ReconfigurationMode,
    ClockActivationMode,
    Terminated,
    Error,
]);
/// States of a running simulation.
pub const RUNNING: States =
    States::of(&[EventMode, ContinuousTimeMode, StepMode, ClockActivationMode]);
/// States in which values may be read; after an error for debugging only.
pub const READ: States = States::of(&[
    ConfigurationMode,
    InitializationMode,
    EventMode,
    ContinuousTimeMode,
    StepMode,
    IntermediateUpdateMode,
    ReconfigurationMode,
    ClockActivationMode,
    Terminated,
    Error,
]);
/// States in which values may be set; which values depends on the state.
pub const WRITE: States = States::of(&[
    Instantiated,
    ConfigurationMode,
    InitializationMode,
    EventMode,
    ContinuousTimeMode,
    StepMode,
    IntermediateUpdateMode,
    ReconfigurationMode,
    ClockActivationMode,
]);
/// States in which partial derivatives may be queried.
pub const DERIVATIVES: States = States::of(&[
    InitializationMode,
    EventMode,
    ContinuousTimeMode,
    StepMode,
    IntermediateUpdateMode,
    ClockActivationMode,
    Terminated,
    Error,
]);
/// States in which configuration mode may be entered.
pub const CONFIGURABLE: States =
    States::of(&[Instantiated, EventMode, StepMode, ClockActivationMode]);
/// States in which intervals and shifts of clocks may be read and set.
pub const CLOCKS: States = States::of(&[
    Instantiated,
    InitializationMode,
    EventMode,
    StepMode,
    ClockActivationMode,
]);
/// States in which states, derivatives and event indicators of model exchange may be read.
pub const CONTINUOUS: States = States::of(&[
    InitializationMode,
    EventMode,
    ContinuousTimeMode,
    Terminated,
    Error,
]);
/// States in which output derivatives may be read.
pub const STEPPED: States = States::of(&[
    EventMode,
    StepMode,
    IntermediateUpdateMode,
    Terminated,
    Error,
]);
