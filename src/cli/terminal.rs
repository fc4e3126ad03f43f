//! Output to the terminal.

use super::Failure;
use pilotage_process::own::{restore_streams, write_separated};
use std::io::{self, ErrorKind, Write};

/// What this process was given as stdout, also where foreign code prints elsewhere.
#[derive(Debug)]
pub struct Stdout;

impl Write for Stdout {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        write_separated(bytes).unwrap_or_else(|| io::stdout().write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stdout().flush()
    }
}

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
