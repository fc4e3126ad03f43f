//! The states of an instance (FMI 3.0, sections 2.3, 3.3, 4.3 and 5.3).

/// One state of an instance. Calling order is a property of the instance, not of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum State {
    /// No instance yet, or no longer.
    StartEnd = 1,
    /// After `fmi3InstantiateXXX` or `fmi3Reset`.
    Instantiated = 1 << 1,
    /// Structural parameters are set before initialization.
    ConfigurationMode = 1 << 2,
    /// Between `fmi3EnterInitializationMode` and `fmi3ExitInitializationMode`.
    InitializationMode = 1 << 3,
    /// An event is handled.
    EventMode = 1 << 4,
    /// Model exchange: time passes.
    ContinuousTimeMode = 1 << 5,
    /// Co-simulation: ready for a step.
    StepMode = 1 << 6,
    /// Co-simulation: within a step, in the importer's callback.
    IntermediateUpdateMode = 1 << 7,
    /// Structural parameters are set while the simulation runs.
    ReconfigurationMode = 1 << 8,
    /// Scheduled execution: partitions are activated.
    ClockActivationMode = 1 << 9,
    /// After `fmi3Terminate`.
    Terminated = 1 << 10,
    /// A function returned `fmi3Error`.
    Error = 1 << 11,
    /// A function returned `fmi3Fatal`.
    Fatal = 1 << 12,
}

impl State {
    /// Every state.
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

/// Everywhere: the function needs no instance.
pub const ANY: States = States::of(&State::ALL);
/// Where an instance exists, is not ruined and is not within a step.
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
/// Where a simulation runs.
pub const RUNNING: States =
    States::of(&[EventMode, ContinuousTimeMode, StepMode, ClockActivationMode]);
/// Where values may be read; after an error for debugging only.
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
/// Where values may be set; which ones depends on the state.
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
/// Where partial derivatives may be asked for.
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
/// Where configuration mode may be entered.
pub const CONFIGURABLE: States =
    States::of(&[Instantiated, EventMode, StepMode, ClockActivationMode]);
/// Where intervals and shifts of clocks may be read and set.
pub const CLOCKS: States = States::of(&[
    Instantiated,
    InitializationMode,
    EventMode,
    StepMode,
    ClockActivationMode,
]);
/// Where states, derivatives and event indicators of model exchange may be read.
pub const CONTINUOUS: States = States::of(&[
    InitializationMode,
    EventMode,
    ContinuousTimeMode,
    Terminated,
    Error,
]);
/// Where output derivatives may be read.
pub const STEPPED: States = States::of(&[
    EventMode,
    StepMode,
    IntermediateUpdateMode,
    Terminated,
    Error,
]);
