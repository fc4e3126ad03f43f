//! Progress display and interruption of fits to subsets of the runs.

use super::interrupt;
use super::progress::Spinner;
use crate::sqp::Status;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::time::Instant;

/// Shows the number of completed fits, and checks for Ctrl-C and the time limit.
pub struct Folds {
    begin: Instant,
    /// Wall-clock time [s].
    limit: Option<f64>,
    spinner: Mutex<Spinner>,
}

impl Folds {
    /// Starts the display; the time limit counts from `begin`.
    pub fn since(begin: Instant, limit: Option<f64>) -> Self {
        Self {
            begin,
            limit,
            spinner: Mutex::new(Spinner::new()),
        }
    }

    /// Updates the display and returns whether to continue.
    pub fn ask(&self, done: usize, all: usize) -> ControlFlow<Status> {
        if let Ok(mut spinner) = self.spinner.try_lock() {
            spinner.show(format!("{done} of {all} fits"));
        }
        let seconds = self.begin.elapsed().as_secs_f64();
        if interrupt::is_asked() {
            ControlFlow::Break(Status::Interrupted)
        } else if self.limit.is_some_and(|limit| seconds > limit) {
            ControlFlow::Break(Status::TimeLimit)
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Clears the display.
    pub fn clear(&self) {
        self.spinner
            .lock()
            .unwrap_or_else(|e| e.into_inner())
            .clear();
    }
}
