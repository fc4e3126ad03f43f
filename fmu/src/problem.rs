//! Everything that can be wrong with a call, with the status that it returns.

use crate::resources::ResourceError;
use pilotage_abi::fmi2::{Function, State, Status, StatusKind, Type};
use pilotage_models::simulation::{SetError, StepError};

/// Why a call did not do what it was asked to. The message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// Wrong order of calls (FMI 2.0.5, section 4.2.4).
    #[error("not allowed in state \"{}\"; it is allowed in {}", state.name(), list(*function))]
    IllegalState {
        /// What was called.
        function: Function,
        /// The state of the instance.
        state: State,
    },
    /// A pointer that must not be NULL.
    #[error("{argument} is NULL; pass a valid pointer")]
    Null {
        /// The argument's name in the standard.
        argument: &'static str,
    },
    /// More elements than memory can hold.
    #[error("{argument} cannot have {count} elements; pass the true number")]
    TooMany {
        /// The argument's name in the standard.
        argument: &'static str,
        /// The number passed.
        count: usize,
    },
    /// An instance without a name.
    #[error("instanceName is empty; pass a name")]
    NoName,
    /// Only co-simulation is there.
    #[error("fmuType is {}, but this FMU is for co-simulation alone; pass fmi2CoSimulation ({})",
        found.0, Type::CO_SIMULATION.0)]
    WrongType {
        /// The type passed.
        found: Type,
    },
    /// XML and binary do not belong together.
    #[error(
        "fmuGUID is {found}, but model and start values in the resources give {expected}; \
         modelDescription.xml or resources/model.toml was changed, export the FMU again"
    )]
    WrongGuid {
        /// As passed.
        found: String,
        /// As computed.
        expected: String,
    },
    /// The model cannot be had.
    #[error(transparent)]
    Resources(#[from] ResourceError),
    /// A value reference that no variable has.
    #[error(
        "value reference {reference} belongs to no variable of this FMU; use those of \
         modelDescription.xml, 0 to {last}"
    )]
    NoVariable {
        /// The value reference.
        reference: u32,
        /// The largest one.
        last: usize,
    },
    /// All variables are real.
    #[error("this FMU has no {base_type} variables, {count} asked for; use the functions for Real")]
    NoSuchType {
        /// The base type.
        base_type: &'static str,
        /// Number of value references passed.
        count: usize,
    },
    /// A value that cannot be set.
    #[error(transparent)]
    Set(#[from] SetError),
    /// A fixed parameter after initialization.
    #[error(
        "{name} is fixed and cannot be set in state \"{}\"; set it before \
         fmi2ExitInitializationMode", state.name()
    )]
    Fixed {
        /// The variable.
        name: String,
        /// The state of the instance.
        state: State,
    },
    /// A derivative of an order other than 1.
    #[error("the derivative of order {order} of {name} was asked for; only order 1 is available")]
    Order {
        /// The variable.
        name: String,
        /// The order passed.
        order: i32,
    },
    /// Output derivatives and unknowns are for outputs.
    #[error("{name} is no output; pass outputs alone")]
    NoOutput {
        /// The variable.
        name: String,
    },
    /// Knowns are inputs, and in initialization mode parameters.
    #[error(
        "{name} is not a known in state \"{}\"; pass inputs, and in initialization mode also \
         parameters", state.name()
    )]
    NoKnown {
        /// The variable.
        name: String,
        /// The state of the instance.
        state: State,
    },
    /// Start, stop or tolerance that no experiment can have.
    #[error("{name} = {value} is not possible; {expected}")]
    Experiment {
        /// The argument's name in the standard.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is possible.
        expected: &'static str,
    },
    /// fmi2SetupExperiment is required in co-simulation.
    #[error("fmi2SetupExperiment was not called; call it before fmi2EnterInitializationMode")]
    NoExperiment,
    /// A step size that is none.
    #[error("communicationStepSize = {step} s; pass a finite number greater than 0")]
    StepSize {
        /// The step [s].
        step: f64,
    },
    /// A communication point that does not follow the last one.
    #[error(
        "currentCommunicationPoint = {found} s, but this instance stands at {expected} s; pass \
         that time, or go back with fmi2SetFMUstate"
    )]
    WrongTime {
        /// As passed [s].
        found: f64,
        /// Where the instance stands [s].
        expected: f64,
    },
    /// A step beyond the stop time.
    #[error(
        "the step from {time} s by {step} s ends after stopTime = {stop} s; shorten it, or pass \
         stopTimeDefined = fmi2False to fmi2SetupExperiment"
    )]
    BeyondStop {
        /// Begin of the step [s].
        time: f64,
        /// The step [s].
        step: f64,
        /// The stop time [s].
        stop: f64,
    },
    /// The equations could not be solved over the step.
    #[error("the step from {time} s could not be done: {source}")]
    Step {
        /// Begin of the step [s].
        time: f64,
        /// Why.
        source: StepError,
    },
    /// Information that this FMU does not have.
    #[error("status kind {} is not available here; ask for fmi2LastSuccessfulTime by \
         fmi2GetRealStatus or fmi2Terminated by fmi2GetBooleanStatus", kind.0)]
    NoStatus {
        /// The kind passed.
        kind: StatusKind,
    },
    /// Unknown log categories.
    #[error("log category \"{found}\" is unknown and ignored; modelDescription.xml lists them")]
    LogCategory {
        /// As passed.
        found: String,
    },
    /// An FMU state of another FMU.
    #[error("the FMU state belongs to an FMU with GUID {found}, this one has {expected}")]
    ForeignState {
        /// GUID of the state.
        found: String,
        /// GUID of this FMU.
        expected: String,
    },
    /// Bytes that are no FMU state.
    #[error(
        "serializedState is no state of this FMU: {what} is {found}, expected {expected}; pass bytes \
         that fmi2SerializeFMUstate of the same FMU wrote"
    )]
    Bytes {
        /// The part that is wrong.
        what: &'static str,
        /// What stands there.
        found: String,
        /// What should.
        expected: String,
    },
    /// Too little space for the bytes of an FMU state.
    #[error(
        "size = {found}, but the FMU state needs {needed} bytes; ask \
         fmi2SerializedFMUstateSize"
    )]
    NoSpace {
        /// As passed.
        found: usize,
        /// Number of bytes needed.
        needed: usize,
    },
    /// A fault of this library.
    #[error(
        "internal fault: {message}; this instance cannot go on. Please report it to the makers of \
         pilotage"
    )]
    Panic {
        /// The panic's message.
        message: String,
    },
}

impl Problem {
    /// What the call returns.
    pub fn status(&self) -> Status {
        match self {
            Self::LogCategory { .. } => Status::WARNING,
            Self::Step { .. } | Self::NoStatus { .. } => Status::DISCARD,
            Self::Panic { .. } => Status::FATAL,
            _ => Status::ERROR,
        }
    }
}

fn list(function: Function) -> String {
    let names: Vec<_> = function.legal_states().iter().map(State::name).collect();
    names.join(", ")
}
