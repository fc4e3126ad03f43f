//! Output to the terminal: all that is printed passes here.
//!
//! Names, cells, keys and messages come from files and FMUs of others. A terminal obeys the control characters in them,
//! and one line end is enough to forge a line of ours. So whatever is printed is made [visible] first, and a message
//! stands on [one line](line). This holds for pipes and files as it does for terminals: `less -R`, `tee` and the pages of a CI
//! server lead to a terminal, and what a user reports is what others see. JSON on stdout keeps its meaning: the visible form
//! is its own escape of the same character.

use super::{Failure, call};
use pilotage_process::own::{restore_streams, write_separated};
use pilotage_text::printable::{shortened, visible};
use std::io::{self, ErrorKind, Write};
use std::path::Path;

/// The most characters of a message: several long paths fit, a cell as long as its file does not.
const LONGEST: usize = 4000;

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

/// A message, or a part of one, on one line, without hidden characters, and not longer than anybody reads.
pub fn line(text: &str) -> String {
    shortened(text, LONGEST).into_owned()
}

/// The line `label: text`.
pub fn labelled(label: &str, text: &str) -> String {
    format!("{label}: {}\n", line(text))
}

/// The name of a file on one line.
pub fn shown(path: &Path) -> String {
    line(&path.to_string_lossy())
}

/// Prints to stdout. A closed reader (`pilotage ... | head`) is no failure.
pub fn print(text: &str) -> Result<(), Failure> {
    if call::print(&visible(text)) {
        return Ok(());
    }
    restore_streams();
    let mut stdout = Stdout;
    let written = stdout.write_all(visible(text).as_bytes());
    match written.and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::new(format!("cannot write to stdout: {error}")))
        }
        _ => Ok(()),
    }
}

/// Prints to stderr, for output that would go to stdout if that were not used otherwise.
pub fn eprint(text: &str) {
    if call::eprint(&visible(text)) {
        return;
    }
    restore_streams();
    // Errors are ignored: stderr may be closed.
    let _ = io::stderr().lock().write_all(visible(text).as_bytes());
}

/// Prints a [labelled] line to stderr: an `error`, a `warning`, a `note`.
pub fn say(label: &str, text: &str) {
    eprint(&labelled(label, text));
}

/// Prints a note to stderr.
pub fn note(text: &str) {
    say("note", text);
}
