//! The observer of a fit: log, table, progress bar, time limit and Ctrl-C.

use super::log::Log;
use super::table::IterationTable;
use crate::cli::interrupt;
use crate::cli::progress::Progress;
use crate::identification;
use crate::sqp::Status;
use std::ops::ControlFlow;
use std::time::Instant;

/// The observer of a fit.
pub struct Watch {
    begin: Instant,
    /// Wall-clock time [s].
    time_limit: Option<f64>,
    log: Option<Log>,
    shown: Shown,
}

/// Progress display.
enum Shown {
    Table(IterationTable),
    Bar(Progress),
}

impl Watch {
    /// Creates the observer and starts its clock.
    pub fn new(time_limit: Option<f64>, log: Option<Log>, verbose: bool) -> Self {
        Self {
            begin: Instant::now(),
            time_limit,
            log,
            shown: match verbose {
                true => Shown::Table(IterationTable::default()),
                false => Shown::Bar(Progress::new()),
            },
        }
    }

    /// Shows the progress and returns whether to continue.
    pub fn see(&mut self, progress: &identification::Progress) -> ControlFlow<Status> {
        if let identification::Progress::Iterate(iterate) = progress {
            if let Some(log) = &mut self.log {
                log.iteration(iterate);
            }
            if let Shown::Table(table) = &mut self.shown {
                table.show(iterate);
            }
        }
        if let Shown::Bar(bar) = &mut self.shown {
            bar.show(progress);
        }
        let seconds = self.begin.elapsed().as_secs_f64();
        if interrupt::is_asked() {
            ControlFlow::Break(Status::Interrupted)
        } else if self.time_limit.is_some_and(|limit| seconds > limit) {
            ControlFlow::Break(Status::TimeLimit)
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Clears the bar and returns the log.
    pub fn end(self) -> Option<Log> {
        if let Shown::Bar(mut bar) = self.shown {
            bar.clear();
        }
        self.log
    }
}
