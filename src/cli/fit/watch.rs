//! The observer of a fit: log, table, progress bar, time limit and Ctrl-C.

use super::log::Log;
use super::table::IterationTable;
use crate::cli::deadline::Deadline;
use crate::cli::progress::Progress;
use crate::identification;
use crate::sqp::Status;
use std::ops::ControlFlow;

/// The observer of a fit.
pub struct Watch {
    deadline: Deadline,
    log: Option<Log>,
    shown: Shown,
}

/// Progress display.
enum Shown {
    Table(IterationTable),
    Bar(Progress),
}

impl Watch {
    /// Creates the observer.
    pub fn new(deadline: Deadline, log: Option<Log>, verbose: bool) -> Self {
        Self {
            deadline,
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
        self.deadline.ask()
    }

    /// Clears the bar and returns the log.
    pub fn end(self) -> Option<Log> {
        if let Shown::Bar(mut bar) = self.shown {
            bar.clear();
        }
        self.log
    }
}
