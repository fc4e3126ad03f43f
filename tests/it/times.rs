//! Notes of a run: how long each test took, and which tools it missed. `tests/slowest.rs` prints them.

use std::fs::File;
use std::io::Write;
use std::sync::{LazyLock, Mutex};
use std::time::Instant;

/// Made anew by the first note of a run, which is one of `it`. None where a test runs one by itself, in a process of its own: that is a
/// part of the test.
static NOTES: LazyLock<Option<Mutex<File>>> = LazyLock::new(|| {
    let is_part = std::env::args().any(|argument| argument == "--exact");
    let path = concat!(env!("CARGO_TARGET_TMPDIR"), "/notes.txt");
    let is_first = env!("CARGO_CRATE_NAME") == "it";
    let mut options = File::options();
    options.create(true).write(true);
    options.append(!is_first).truncate(is_first);
    let made = || {
        options
            .open(path)
            .expect("the notes of the tests can be written")
    };
    (!is_part).then(|| Mutex::new(made()))
});

fn note(line: &str) {
    if let Some(notes) = &*NOTES {
        let mut file = notes.lock().expect("nobody panics with the notes in hand");
        writeln!(file, "{line}").expect("the notes of the tests can be written");
    }
}

/// Lives as long as a test and notes for how long.
pub struct Timed {
    name: &'static str,
    start: Instant,
}

impl Timed {
    pub fn new(name: &'static str) -> Self {
        let start = Instant::now();
        Self { name, start }
    }
}

impl Drop for Timed {
    fn drop(&mut self) {
        let seconds = self.start.elapsed().as_secs_f64();
        note(&format!("{seconds:.2} {}", self.name));
    }
}

/// A test passes though it cannot check `what`, since `tool` is not installed.
pub fn missing(tool: &str, what: &str) {
    note(&format!("missing {tool}: {what}"));
}
