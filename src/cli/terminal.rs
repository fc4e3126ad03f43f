//! What goes to the terminal.

use super::Failure;
use pilotage_process::own::restore_streams;
use std::io::{ErrorKind, Write};

/// Prints to stdout. A reader that has gone (`pilotage ... | head`) is no failure.
pub fn print(text: &str) -> Result<(), Failure> {
    restore_streams();
    let mut stdout = std::io::stdout().lock();
    let written = stdout.write_all(text.as_bytes());
    match written.and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::new(format!("cannot write to stdout: {error}")))
        }
        _ => Ok(()),
    }
}

/// Prints to stderr what would go to stdout, were that not taken.
pub fn tell(text: &str) {
    restore_streams();
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// Tells something on stderr that is no failure.
pub fn note(text: &str) {
    restore_streams();
    // Whoever closed stderr does not want to know.
    let _ = writeln!(std::io::stderr().lock(), "note: {text}");
}
