//! Progress display and interruption of fits to subsets of the runs.

use super::deadline::Deadline;
use super::progress::Spinner;
use super::terminal;
use crate::sqp::Status;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

/// Note about a comparison that Ctrl-C or the time limit has ended.
const STOPPED: &str = "some of these fits were stopped before the end, and the comparison depends on when: allow more time";

/// Shows the number of completed fits, and checks for Ctrl-C and the time limit.
pub struct Folds {
    deadline: Deadline,
    was_cut: AtomicBool,
    spinner: Spinner,
}

impl Folds {
    /// Starts the display.
    pub fn until(deadline: Deadline) -> Self {
        Self {
            deadline,
            was_cut: AtomicBool::new(false),
            spinner: Spinner::new("fits"),
        }
    }

    /// Updates the display and returns whether to continue.
    pub fn ask(&self, done: usize, all: usize) -> ControlFlow<Status> {
        self.spinner.show(format!("{done} of {all} fits"));
        let asked = self.deadline.ask();
        if asked.is_break() {
            self.was_cut.store(true, Ordering::Relaxed);
        }
        asked
    }

    /// As [`end`](Self::end), with a note if fits were stopped.
    pub fn end_with_note(&self) -> bool {
        let is_whole = self.end();
        if !is_whole {
            terminal::note(STOPPED);
        }
        is_whole
    }

    /// Clears the display, and returns whether no fit was stopped.
    pub fn end(&self) -> bool {
        self.spinner.clear();
        !self.was_cut.load(Ordering::Relaxed)
    }
}
