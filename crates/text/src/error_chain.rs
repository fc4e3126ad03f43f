//! An error and its causes as one line.

use std::error::Error;

/// The error and its chain of sources: `what: why: why`.
pub fn error_chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text += &format!(": {cause}");
        source = cause.source();
    }
    text
}
