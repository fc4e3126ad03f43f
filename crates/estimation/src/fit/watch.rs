//! The observer of a fit: it is called with each iterate, and asked whether to continue.

use super::{Observer, Progress};
use pilotage_sqp::{Iteration, Status};
use std::ops::ControlFlow;
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

/// Time allowed for simulations of the result after the fit was ended.
const GRACE: Duration = Duration::from_secs(2);

/// The observer of a fit, and the status with which it ended the fit. Once ended, the fit stays ended.
pub(super) struct Watch<'a, 'o> {
    observer: Mutex<&'a mut Observer<'o>>,
    starts: usize,
    over: OnceLock<Status>,
}

impl<'a, 'o> Watch<'a, 'o> {
    /// For a fit with this number of starts.
    pub fn new(observer: &'a mut Observer<'o>, starts: usize) -> Self {
        Self {
            observer: Mutex::new(observer),
            starts,
            over: OnceLock::new(),
        }
    }

    /// Ends the fit where it begins, if no search can lead to an answer.
    pub fn end_at_start(&self) {
        // It is new, so that nothing has ended it.
        let _ = self.over.set(Status::Stopped);
    }

    /// The same for another number of starts.
    pub fn of(self, starts: usize) -> Self {
        Self { starts, ..self }
    }

    /// Passes on an iterate of a start after a number of refinements.
    pub fn see(
        &self,
        start: usize,
        refinement: usize,
        iteration: &Iteration,
    ) -> ControlFlow<Status> {
        self.ask(start, refinement, Some(iteration))
    }

    /// Whether to stop, asked during long work without iterates.
    pub fn is_over(&self) -> bool {
        self.ask(0, 0, None).is_break()
    }

    /// Whether a simulation of the result that began at this time must end: after the fit was ended it has little time
    /// left.
    pub fn is_late(&self, begin: Instant) -> bool {
        begin.elapsed() > GRACE && self.is_over()
    }

    /// The status with which the observer ended the fit, if it did.
    pub fn over(&self) -> Option<Status> {
        self.over.get().copied()
    }

    fn ask(
        &self,
        start: usize,
        refinement: usize,
        iteration: Option<&Iteration>,
    ) -> ControlFlow<Status> {
        if let Some(status) = self.over.get() {
            return ControlFlow::Break(*status);
        }
        let progress = Progress {
            start,
            starts: self.starts,
            refinement,
            iteration,
        };
        let go_on = match self.observer.lock() {
            Ok(mut see) => see(&progress),
            Err(_) => ControlFlow::Continue(()),
        };
        if let ControlFlow::Break(status) = go_on {
            // Another thread may have set a status first, which is equally valid.
            let _ = self.over.set(status);
        }
        go_on
    }
}
