//! All problems of a call, with the status that it returns.

use crate::ValueError;
use crate::resources::LoadError;
use crate::simulation::{SetError, StepError, StepFault};

/// Severity of a problem; the numbers are those of `fmi2Status` and `fmi3Status`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The call had no effect, but the computation can continue.
    Warning = 1,
    /// The step was not completed, or the information is not available.
    Discard = 2,
    /// This instance cannot continue; it may be reset or freed.
    Error = 3,
    /// This instance can no longer be used.
    Fatal = 4,
}

/// Why a call failed. The message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// Wrong order of calls (FMI 2.0.5, sections 3.2.3 and 4.2.4; FMI 3.0, sections 2.3, 3.3 and 4.3).
    #[error("not allowed in state \"{state}\"; it is allowed in {legal}")]
    IllegalState {
        /// The state of the instance.
        state: &'static str,
        /// The states in which it is allowed.
        legal: String,
    },
    /// A function of the other kind of interface.
    #[error("it is for {needed}, but this instance was made for {found}")]
    WrongKind {
        /// Interface type of the function.
        needed: &'static str,
        /// Interface type of the instance.
        found: &'static str,
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
    /// Neither co-simulation nor model exchange.
    #[error("fmuType is {found}; pass fmi2ModelExchange (0) or fmi2CoSimulation (1)")]
    WrongType {
        /// The type passed.
        found: i32,
    },
    /// A feature that this FMU lacks.
    #[error("{0}")]
    NotSupported(&'static str),
    /// XML and binary do not match.
    #[error(
        "{argument} is {found}, but the model has {expected}; modelDescription.xml, binary and resources \
         do not belong together, export the FMU again"
    )]
    WrongGuid {
        /// The argument's name in the standard.
        argument: &'static str,
        /// Value passed.
        found: String,
        /// Value computed.
        expected: String,
    },
    /// The model cannot be loaded.
    #[error("{0}")]
    Load(LoadError),
    /// A value reference that no variable has.
    #[error(
        "value reference {reference} belongs to no variable of this FMU; use those of \
         modelDescription.xml, 1 to {last}"
    )]
    NoVariable {
        /// The value reference.
        reference: u32,
        /// The largest one.
        last: usize,
    },
    /// A variable of another type.
    #[error("{name} is {found}; use the functions for {found} variables")]
    OtherType {
        /// The variable.
        name: String,
        /// Its type.
        found: &'static str,
    },
    /// All variables are real or Boolean.
    #[error(
        "this FMU has no {base_type} variables, {count} asked for; use the functions for {used}"
    )]
    NoSuchType {
        /// The base type.
        base_type: &'static str,
        /// The base type of all or most of its variables.
        used: &'static str,
        /// Number of value references passed.
        count: usize,
    },
    /// A value that cannot be set.
    #[error(transparent)]
    Set(#[from] SetError),
    /// A value that a variable does not allow, but a solver may try another one.
    #[error(transparent)]
    Refused(ValueError),
    /// A wrong number of values.
    #[error("{argument} = {found}, but there are {expected}")]
    WrongNumber {
        /// The argument's name in the standard.
        argument: &'static str,
        /// Number passed.
        found: usize,
        /// Correct number.
        expected: usize,
    },
    /// A parameter in a state in which it cannot be set.
    #[error("{name} is {role} and cannot be set in state \"{state}\"; set it {when}")]
    Fixed {
        /// The variable.
        name: String,
        /// Its kind.
        role: &'static str,
        /// The state of the instance.
        state: &'static str,
        /// When it can be set.
        when: &'static str,
    },
    /// A derivative of an order other than 1.
    #[error("the derivative of order {order} of {name} was asked for; only order 1 is available")]
    Order {
        /// The variable.
        name: String,
        /// The order passed.
        order: i32,
    },
    /// Output derivatives exist for outputs only.
    #[error("{name} is no output; pass outputs alone")]
    NoOutput {
        /// The variable.
        name: String,
    },
    /// Unknowns are outputs and derivatives, and in initialization mode states.
    #[error(
        "{name} is not an unknown in state \"{state}\"; pass outputs and derivatives of states"
    )]
    NoUnknown {
        /// The variable.
        name: String,
        /// The state of the instance.
        state: &'static str,
    },
    /// Knowns are inputs and states, and in initialization mode inputs and parameters.
    #[error(
        "{name} is not a known in state \"{state}\"; pass inputs and, in initialization mode, \
         parameters, later states"
    )]
    NoKnown {
        /// The variable.
        name: String,
        /// The state of the instance.
        state: &'static str,
    },
    /// An invalid start time, stop time or tolerance.
    #[error("{name} = {value} is not possible; {expected}")]
    Experiment {
        /// The argument's name in the standard.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// fmi2SetupExperiment is required in co-simulation.
    #[error("fmi2SetupExperiment was not called; call it before fmi2EnterInitializationMode")]
    NoExperiment,
    /// An invalid time.
    #[error("time = {time} s; pass a finite number not before the start time {start} s")]
    Time {
        /// Time passed \[s\].
        time: f64,
        /// Start time \[s\].
        start: f64,
    },
    /// States or derivatives that are not finite.
    #[error(
        "{name} is {value} at {time} s{}; the solver should take a smaller step",
        cause.as_ref().map_or(String::new(), |cause| format!(" ({cause})"))
    )]
    NotFinite {
        /// Cause in the equations, if they give it.
        cause: Option<String>,
        /// The variable.
        name: String,
        /// Its value.
        value: f64,
        /// Time \[s\].
        time: f64,
    },
    /// An event that cannot be handled.
    #[error("{0}")]
    Event(StepFault),
    /// An invalid step size.
    #[error("communicationStepSize = {step} s; pass a finite number greater than 0")]
    StepSize {
        /// The step \[s\].
        step: f64,
    },
    /// A communication point that does not follow the last one.
    #[error(
        "currentCommunicationPoint = {found} s, but this instance stands at {expected} s; pass \
         that time, or go back with an FMU state"
    )]
    WrongTime {
        /// Time passed \[s\].
        found: f64,
        /// Time of the instance \[s\].
        expected: f64,
    },
    /// A step beyond the stop time.
    #[error(
        "the step from {time} s by {step} s ends after stopTime = {stop} s; shorten it, or set none by \
         stopTimeDefined"
    )]
    BeyondStop {
        /// Start of the step \[s\].
        time: f64,
        /// The step \[s\].
        step: f64,
        /// The stop time \[s\].
        stop: f64,
    },
    /// The equations could not be solved over the step.
    #[error(
        "the step from {time} s could not be done{}: {source}",
        if source.reached > 0.0 { format!(" beyond {} s", time + source.reached) } else { String::new() }
    )]
    Step {
        /// Start of the step \[s\].
        time: f64,
        /// Reason, and time reached.
        source: StepError,
    },
    /// Information that is not available.
    #[error(
        "status kind {kind} is not available here; ask for fmi2LastSuccessfulTime by \
         fmi2GetRealStatus or fmi2Terminated by fmi2GetBooleanStatus"
    )]
    NoStatus {
        /// The kind passed.
        kind: i32,
    },
    /// Unknown log categories.
    #[error("log category \"{found}\" is unknown and ignored; modelDescription.xml lists them")]
    LogCategory {
        /// Category passed.
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
    /// Bytes that are not an FMU state.
    #[error(
        "serializedState is no state of this FMU: {what} is {found}, expected {expected}; pass bytes \
         that the same FMU serialized"
    )]
    Bytes {
        /// The part that is wrong.
        what: &'static str,
        /// Value found.
        found: String,
        /// Value expected.
        expected: String,
    },
    /// Too little space for the bytes of an FMU state.
    #[error(
        "size = {found}, but the FMU state needs {needed} bytes; ask for \
         their number first"
    )]
    NoSpace {
        /// Number of bytes passed.
        found: usize,
        /// Number of bytes needed.
        needed: usize,
    },
    /// What something inside the FMU says.
    #[error("{message}")]
    Inside {
        /// Its severity; a discarded step is `Discard`.
        severity: Severity,
        /// Its message.
        message: String,
    },
    /// A fault of this library.
    #[error(
        "internal fault: {message}; this instance cannot go on. Please report it to the makers of \
         the model"
    )]
    Panic {
        /// The panic's message.
        message: String,
    },
}

impl Problem {
    /// Severity, from which the status of the call follows.
    pub fn severity(&self) -> Severity {
        match self {
            Self::LogCategory { .. } => Severity::Warning,
            Self::Inside { severity, .. } => *severity,
            Self::Step { .. }
            | Self::NoStatus { .. }
            | Self::NotFinite { .. }
            | Self::Refused(_) => Severity::Discard,
            Self::Panic { .. } => Severity::Fatal,
            _ => Severity::Error,
        }
    }
}
