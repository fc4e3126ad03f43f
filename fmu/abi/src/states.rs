//! The states of a co-simulation slave (FMI 2.0.5, section 4.2.4, "State Machine of Calling Sequence
//! from Master to Slave").

use std::ops::BitOr;

/// One state of a slave. Calling order is a property of the instance, not of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum State {
    /// No instance yet, or no longer.
    StartEnd = 1,
    /// After `fmi2Instantiate` or `fmi2Reset`.
    Instantiated = 1 << 1,
    /// Between `fmi2EnterInitializationMode` and `fmi2ExitInitializationMode`.
    InitializationMode = 1 << 2,
    /// Initialised; the last step is complete.
    StepComplete = 1 << 3,
    /// An asynchronous step is on its way.
    StepInProgress = 1 << 4,
    /// The last step was discarded.
    StepFailed = 1 << 5,
    /// The last step was cancelled.
    StepCanceled = 1 << 6,
    /// After `fmi2Terminate`.
    Terminated = 1 << 7,
    /// A function returned `fmi2Error`.
    Error = 1 << 8,
    /// A function returned `fmi2Fatal`.
    Fatal = 1 << 9,
}

impl State {
    /// Every state, in the order of the standard's table.
    pub const ALL: [Self; 10] = [
        Self::StartEnd,
        Self::Instantiated,
        Self::InitializationMode,
        Self::StepComplete,
        Self::StepInProgress,
        Self::StepFailed,
        Self::StepCanceled,
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
            Self::Terminated => "terminated",
            Self::Error => "error",
            Self::Fatal => "fatal",
        }
    }
}

/// A set of [`State`]s.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct States(u16);

impl States {
    /// The set of the given states.
    pub const fn of(states: &[State]) -> Self {
        let mut bits = 0;
        let mut i = 0;
        while i < states.len() {
            bits |= states[i] as u16;
            i += 1;
        }
        Self(bits)
    }

    /// Whether `state` is in the set.
    pub const fn contains(self, state: State) -> bool {
        self.0 & state as u16 != 0
    }

    /// The states of the set, in the order of the standard's table.
    pub fn iter(self) -> impl Iterator<Item = State> {
        State::ALL.into_iter().filter(move |s| self.contains(*s))
    }
}

impl BitOr for States {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

use State::*;

/// Everywhere: the function needs no instance.
pub const ANY: States = States::of(&State::ALL);
/// Where an instance exists and is not ruined.
pub const ALIVE: States = States::of(&[
    Instantiated,
    InitializationMode,
    StepComplete,
    StepInProgress,
    StepFailed,
    StepCanceled,
    Terminated,
    Error,
]);
/// As [`ALIVE`], but not while a step is on its way.
pub const IDLE: States = States::of(&[
    Instantiated,
    InitializationMode,
    StepComplete,
    StepFailed,
    StepCanceled,
    Terminated,
    Error,
]);
/// Where values may be read; in stepFailed, stepCanceled and error for debugging only.
pub const READ: States = States::of(&[
    InitializationMode,
    StepComplete,
    StepFailed,
    StepCanceled,
    Terminated,
    Error,
]);
/// Where values may be set; which ones depends on the state (see the footnotes of the table).
pub const WRITE: States = States::of(&[Instantiated, InitializationMode, StepComplete]);
/// Where output derivatives may be read.
pub const STEPPED: States =
    States::of(&[StepComplete, StepFailed, StepCanceled, Terminated, Error]);
/// Where the status of a step may be asked for.
pub const STATUS: States = States::of(&[StepComplete, StepInProgress, StepFailed, Terminated]);
