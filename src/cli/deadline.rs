//! When a command that solves is to stop: Ctrl-C, or its time limit.

use super::interrupt;
use crate::sqp::Status;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// The end of the time that a whole command may take.
#[derive(Debug, Clone, Copy)]
pub struct Deadline {
    begin: Instant,
    /// Wall-clock time [s].
    limit: Option<f64>,
    /// Ctrl-C.
    asked: &'static AtomicBool,
}

impl Deadline {
    /// The time limit \[s\] of a command that begins now.
    pub fn after(limit: Option<f64>) -> Self {
        Self {
            begin: Instant::now(),
            limit,
            asked: interrupt::flag(),
        }
    }

    /// Whether to continue.
    pub fn ask(&self) -> ControlFlow<Status> {
        let seconds = self.begin.elapsed().as_secs_f64();
        if self.asked.load(Ordering::SeqCst) {
            ControlFlow::Break(Status::Interrupted)
        } else if self.limit.is_some_and(|limit| seconds > limit) {
            ControlFlow::Break(Status::TimeLimit)
        } else {
            ControlFlow::Continue(())
        }
    }
}
