//! The logger callback of FMI 3.0, which receives plain text (section 2.2.3).

use crate::binding::owned_message;
use crate::environment;
use crate::message::Message;
use crate::misuse::{CATEGORY, MESSAGE, Misuse, note, note_text};
use pilotage_abi::fmi2;
use pilotage_abi::fmi3::{InstanceEnvironment, LogMessageCallback, Status, String as CString};

/// The standard's name of the callback.
const CALLBACK: &str = "logMessage";

/// Stores a message.
///
/// # Safety
/// Strings are NULL or NUL-terminated.
unsafe extern "C" fn receive(
    environment: InstanceEnvironment,
    status: Status,
    category: CString,
    message: CString,
) {
    // SAFETY: the obligation is passed on from the caller.
    let (category, text) = unsafe {
        note_text(category, CALLBACK, CATEGORY);
        note_text(message, CALLBACK, MESSAGE);
        let category = owned_message(category).unwrap_or_default();
        (category, owned_message(message).unwrap_or_default())
    };
    if !(Status::OK..=Status::FATAL).contains(&status) {
        note(Misuse::Status {
            callback: CALLBACK,
            status: status.0,
        });
    }
    let message = Message::new(fmi2::Status(status.0), None, category, &text);
    environment::deliver(environment, CALLBACK, message);
}

/// The logger callback.
pub(crate) fn callback() -> LogMessageCallback {
    receive
}
