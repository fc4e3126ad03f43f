//! What a call of an FMU can end with.

use crate::description::FmiVersion;
use crate::message::Message;
use crate::version::{Function, InterfaceType, State};
use pilotage_abi::fmi2::Status;
use thiserror::Error;

/// What a call of an FMU can end with.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum CallError {
    /// The function that makes an instance returned NULL.
    #[error("{} refused{}", function.name(), said(messages))]
    NotInstantiated {
        /// The function.
        function: Function,
        /// What the FMU said.
        messages: Vec<Message>,
    },
    /// The description has no element for this kind.
    #[error("it is no FMU for {kind}: its description has no <{}>", kind.element())]
    OtherKind {
        /// What was asked for.
        kind: InterfaceType,
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
    /// A call that the FMU's version of the standard does not have.
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
    /// The FMU says in its description that it cannot do this.
    #[error("the FMU declares {flag}=\"false\"")]
    NotCapable {
        /// The attribute of `<CoSimulation>`, `<ModelExchange>` or `<ScheduledExecution>`.
        flag: &'static str,
    },
    /// The call was made, and what it gave cannot be.
    #[error("{} returned OK and gave {what}", function.name())]
    Absurd {
        /// The function.
        function: Function,
        /// What it gave.
        what: String,
    },
    /// The call was made and failed.
    #[error("{} returned {}{}", function.name(), function.name_of(*status), said(messages))]
    Failed {
        /// The function.
        function: Function,
        /// What it returned; FMI 3.0 gives the numbers the same meaning.
        status: Status,
        /// What the FMU said.
        messages: Vec<Message>,
    },
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
