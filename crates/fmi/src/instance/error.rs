//! Errors of calls of an FMU.

use crate::description::FmiVersion;
use crate::message::Message;
use crate::version::{Function, InterfaceType, State};
use pilotage_abi::fmi2::Status;
use thiserror::Error;

/// Error of a call of an FMU.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum CallError {
    /// The function that creates an instance returned NULL.
    #[error("{} refused{}", function.name(), last_messages(messages))]
    NotInstantiated {
        /// The function.
        function: Function,
        /// Messages of the FMU.
        messages: Vec<Message>,
    },
    /// The description has no element for this kind.
    #[error("it is no FMU for {kind}: its description has no <{}>", kind.element())]
    OtherKind {
        /// The requested kind.
        kind: InterfaceType,
    },
    /// A text that cannot be a C string.
    #[error("{text:?} contains a NUL, which C strings cannot hold")]
    Nul {
        /// The text.
        text: String,
    },
    /// The standard does not allow the call in this state; it was not made.
    #[error("{} is not allowed in state {}", function.name(), state.name())]
    NotAllowed {
        /// The function.
        function: Function,
        /// The state of the instance.
        state: State,
    },
    /// The FMU's version of the standard has no such call.
    #[error("the FMU is of FMI {version}, which has nothing like {}", function.name())]
    OtherVersion {
        /// The function.
        function: Function,
        /// The FMU's version.
        version: FmiVersion,
    },
    /// The binary lacks the function.
    #[error("the FMU's binary has no function `{}`", function.name())]
    MissingFunction {
        /// The function.
        function: Function,
    },
    /// The description declares that the FMU does not support this.
    #[error("the FMU declares {flag}=\"false\"")]
    NotCapable {
        /// The attribute of `<CoSimulation>`, `<ModelExchange>` or `<ScheduledExecution>`.
        flag: &'static str,
    },
    /// The call returned success with an impossible result.
    #[error("{} returned OK and gave {what}", function.name())]
    Absurd {
        /// The function.
        function: Function,
        /// The result.
        what: String,
    },
    /// The call was made and failed.
    #[error("{} returned {}{}", function.name(), function.name_of(*status), last_messages(messages))]
    Failed {
        /// The function.
        function: Function,
        /// The returned status; FMI 3.0 uses the same numbers.
        status: Status,
        /// Messages of the FMU.
        messages: Vec<Message>,
    },
}

/// The last messages, to be appended to an error.
fn last_messages(messages: &[Message]) -> String {
    const SHOWN: usize = 3;
    let from = messages.len().saturating_sub(SHOWN);
    let texts: Vec<&str> = messages[from..].iter().map(|m| m.text.as_str()).collect();
    match texts.is_empty() {
        true => " without a message".to_owned(),
        false => format!(": {}", texts.join("; ")),
    }
}
