//! Who looks on: told of each iterate, and asked whether to go on.

use super::{Observer, Progress};
use pilotage_sqp::{Iteration, Status};
use std::ops::ControlFlow;
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

/// Time for simulations of what a fit has come to after it was ended.
const GRACE: Duration = Duration::from_secs(2);

/// The observer of a fit, and what it has said. Once it has said that it is over, it is over.
pub(super) struct Watch<'a, 'o> {
    observer: Mutex<&'a mut Observer<'o>>,
    starts: usize,
    over: OnceLock<Status>,
}

impl<'a, 'o> Watch<'a, 'o> {
    /// Of a fit from so many starts.
    pub fn new(observer: &'a mut Observer<'o>, starts: usize) -> Self {
        Self {
            observer: Mutex::new(observer),
            starts,
            over: OnceLock::new(),
        }
    }

    /// Shows an iterate of a start after so many refinements.
    pub fn see(
        &self,
        start: usize,
        refinement: usize,
        iteration: &Iteration,
    ) -> ControlFlow<Status> {
        self.ask(start, refinement, Some(iteration))
    }

    /// Whether to stop, asked from within long work without iterates.
    pub fn is_over(&self) -> bool {
        self.ask(0, 0, None).is_break()
    }

    /// Whether a simulation that began then, to tell what a fit has come to, is to end: one that is over has little time
    /// left for it.
    pub fn is_late(&self, begin: Instant) -> bool {
        begin.elapsed() > GRACE && self.is_over()
    }

    /// With what the observer has ended it, if it has.
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
            // Another thread may have been first, with a status as good.
            let _ = self.over.set(status);
        }
        go_on
    }
}
