//! What a call of an FMU can end with.

use crate::fmi::logger::Message;
use pilotage_abi::fmi2::{Function, State, Status};
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
