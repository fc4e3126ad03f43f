//! The logger callback of FMI 3.0, which receives plain text (section 2.2.3).

use crate::binding::owned_message;
use crate::environment;
use crate::message::Message;
use pilotage_abi::fmi2;
use pilotage_abi::fmi3::{InstanceEnvironment, LogMessageCallback, Status, String as CString};

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
        let category = owned_message(category).unwrap_or_default();
        (category, owned_message(message).unwrap_or_default())
    };
    let message = Message::new(fmi2::Status(status.0), None, category, &text);
    environment::deliver(environment, message);
}

/// The logger callback.
pub(crate) fn callback() -> LogMessageCallback {
    receive
}
