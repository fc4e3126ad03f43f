//! Ctrl-C: the first asks long work to stop with what it has, the second kills.

use super::{Failure, terminal};
use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);

/// Exit code of a process that Ctrl-C killed, as shells have it: 128 + SIGINT.
const KILLED: i32 = 130;

/// Listens from now on, and says on the first Ctrl-C what it does. Only once in a process.
pub fn listen(stopping: &'static str) -> Result<(), Failure> {
    let handler = move || {
        if ASKED.swap(true, Ordering::SeqCst) {
            std::process::exit(KILLED);
        }
        terminal::note(&format!("{stopping}; Ctrl-C again kills"));
    };
    ctrlc::set_handler(handler)
        .map_err(|error| Failure::new(format!("cannot listen to Ctrl-C: {error}")))
}

/// Whether Ctrl-C has been pressed.
pub fn is_asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}
