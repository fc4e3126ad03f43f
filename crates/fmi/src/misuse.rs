//! What FMUs do with callbacks and results that the standard does not allow, and that harms nobody here: it is noted for
//! whoever checks an FMU. For errors of calls see [`CallError`](crate::CallError).

use std::collections::BTreeSet;
use std::ffi::{CStr, c_char};
use std::sync::{Mutex, MutexGuard, PoisonError};
use thiserror::Error;

/// A misuse. `callback` is the standard's name of the callback, `argument` says which one of its arguments.
#[allow(missing_docs)] // The message of each variant is its documentation, the fields are in it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Error)]
pub enum Misuse {
    #[error("{function} returned a null pointer, expected text")]
    NoText { function: &'static str },
    #[error("{function} returned text that is not UTF-8")]
    OtherText { function: &'static str },
    #[error("it calls {callback} with an environment that it was not given")]
    OtherEnvironment { callback: &'static str },
    #[error("it calls {callback} with a null pointer as its environment")]
    NoEnvironment { callback: &'static str },
    #[error("it calls {callback} for an instance that was freed")]
    Freed { callback: &'static str },
    #[error("it calls {callback} with the status {status}, which FMI does not define")]
    Status { callback: &'static str, status: i32 },
    #[error("it calls {callback} with a null pointer as the {argument}")]
    Null {
        callback: &'static str,
        argument: &'static str,
    },
    #[error("it calls {callback} with text that is not UTF-8 as the {argument}")]
    NotUtf8 {
        callback: &'static str,
        argument: &'static str,
    },
    #[error("it changes `{field}` in the table of callbacks, which is the importer's")]
    Changed { field: &'static str },
    #[error("fmi2DoStep returned fmi2Pending, which needs canRunAsynchronuously=\"true\"")]
    Pending,
}

/// The argument of a logger that FMI allows to be NULL if the description declares no categories.
pub const CATEGORY: &str = "category";
/// The name of the instance in messages.
pub const INSTANCE_NAME: &str = "instance name";
/// The text of messages.
pub const MESSAGE: &str = "message";

/// Each once; those of all FMUs of this process.
static SEEN: Mutex<BTreeSet<Misuse>> = Mutex::new(BTreeSet::new());

fn seen() -> MutexGuard<'static, BTreeSet<Misuse>> {
    SEEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Notes a misuse; of statuses only the first one, since there are as many as numbers.
#[cold]
pub(crate) fn note(misuse: Misuse) {
    let mut seen = seen();
    let is_status = |misuse: &Misuse| matches!(misuse, Misuse::Status { .. });
    if !is_status(&misuse) || !seen.iter().any(is_status) {
        seen.insert(misuse);
    }
}

/// Takes out what the FMUs of this process have done since the last call: only with one FMU at a time it is clear whose
/// it is.
pub fn take_misuses() -> BTreeSet<Misuse> {
    std::mem::take(&mut seen())
}

/// Notes if an argument of a callback is NULL or not UTF-8.
///
/// # Safety
/// `text` is NULL or NUL-terminated.
pub(crate) unsafe fn note_text(
    text: *const c_char,
    callback: &'static str,
    argument: &'static str,
) {
    if text.is_null() {
        note(Misuse::Null { callback, argument });
        return;
    }
    // SAFETY: it is not NULL, and the caller vouches for the rest.
    if unsafe { CStr::from_ptr(text) }.to_str().is_err() {
        note(Misuse::NotUtf8 { callback, argument });
    }
}
