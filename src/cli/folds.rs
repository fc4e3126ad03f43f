//! Who looks on while runs are fitted in parts, and may end that.

use super::interrupt;
use super::progress::Spinner;
use crate::sqp::Status;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::time::Instant;

/// Shows how many fits are done, and asks for Ctrl-C and the limit on time.
pub struct Folds {
    begin: Instant,
    /// Wall clock [s].
    limit: Option<f64>,
    spinner: Mutex<Spinner>,
}

impl Folds {
    /// From then on.
    pub fn since(begin: Instant, limit: Option<f64>) -> Self {
        Self {
            begin,
            limit,
            spinner: Mutex::new(Spinner::new()),
        }
    }

    /// So many fits of all are done: whether to go on.
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

    /// Wipes what is shown.
    pub fn clear(&self) {
        self.spinner
            .lock()
            .unwrap_or_else(|e| e.into_inner())
            .clear();
    }
}
