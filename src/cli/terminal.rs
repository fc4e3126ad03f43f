//! Output to the terminal.

use super::Failure;
use pilotage_process::own::{Stdout, restore_streams};
use std::io::{ErrorKind, Write};

/// Prints to stdout. A closed reader (`pilotage ... | head`) is no failure.
pub fn print(text: &str) -> Result<(), Failure> {
    restore_streams();
    let mut stdout = Stdout;
    let written = stdout.write_all(text.as_bytes());
    match written.and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::new(format!("cannot write to stdout: {error}")))
        }
        _ => Ok(()),
    }
}

/// Prints to stderr, for output that would go to stdout if that were not used otherwise.
pub fn eprint(text: &str) {
    restore_streams();
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// Prints a note to stderr.
pub fn note(text: &str) {
    restore_streams();
    // Errors are ignored: stderr may be closed.
    let _ = writeln!(std::io::stderr().lock(), "note: {text}");
}
