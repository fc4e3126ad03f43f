//! Progress display and interruption of fits to subsets of the runs.

use super::deadline::Deadline;
use super::progress::Spinner;
use super::terminal;
use crate::sqp::Status;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Note about a comparison that Ctrl-C or the time limit has ended.
pub const STOPPED: &str = "some of these fits were stopped before the end, and the comparison depends on when: allow more time";

/// Shows the number of completed fits, and checks for Ctrl-C and the time limit.
pub struct Folds {
    deadline: Deadline,
    was_cut: AtomicBool,
    spinner: Mutex<Spinner>,
}

impl Folds {
    /// Starts the display.
    pub fn until(deadline: Deadline) -> Self {
        Self {
            deadline,
            was_cut: AtomicBool::new(false),
            spinner: Mutex::new(Spinner::new()),
        }
    }

    /// Updates the display and returns whether to continue.
    pub fn ask(&self, done: usize, all: usize) -> ControlFlow<Status> {
        if let Ok(mut spinner) = self.spinner.try_lock() {
            spinner.show(format!("{done} of {all} fits"));
        }
        let asked = self.deadline.ask();
        if asked.is_break() {
            self.was_cut.store(true, Ordering::Relaxed);
        }
        asked
    }

    /// Clears the display, and reports whether all fits could come to their ends.
    pub fn end(&self) -> bool {
        self.spinner
            .lock()
            .unwrap_or_else(|e| e.into_inner())
            .clear();
        let was_cut = self.was_cut.load(Ordering::Relaxed);
        if was_cut {
            terminal::note(STOPPED);
        }
        !was_cut
    }
}
