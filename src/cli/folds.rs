//! Progress display and interruption of fits to subsets of the runs.

use super::deadline::Deadline;
use super::progress::Spinner;
use crate::sqp::Status;
use std::ops::ControlFlow;
use std::sync::Mutex;

/// Shows the number of completed fits, and checks for Ctrl-C and the time limit.
pub struct Folds {
    deadline: Deadline,
    spinner: Mutex<Spinner>,
}

impl Folds {
    /// Starts the display.
    pub fn until(deadline: Deadline) -> Self {
        Self {
            deadline,
            spinner: Mutex::new(Spinner::new()),
        }
    }

    /// Updates the display and returns whether to continue.
    pub fn ask(&self, done: usize, all: usize) -> ControlFlow<Status> {
        if let Ok(mut spinner) = self.spinner.try_lock() {
            spinner.show(format!("{done} of {all} fits"));
        }
        self.deadline.ask()
    }

    /// Clears the display.
    pub fn clear(&self) {
        self.spinner
            .lock()
            .unwrap_or_else(|e| e.into_inner())
            .clear();
    }
}
