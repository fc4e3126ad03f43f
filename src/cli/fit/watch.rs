//! What watches a fit: log, table, progress bar, time limit and Ctrl-C.

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
    /// Wall clock [s].
    time_limit: Option<f64>,
    log: Option<Log>,
    shown: Shown,
}

/// What a person sees of it.
enum Shown {
    Table(IterationTable),
    Bar(Progress),
}

impl Watch {
    /// Starts the clock.
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

    /// Sees how far the fit is and says whether to go on.
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

    /// Wipes the bar and hands the log back.
    pub fn end(self) -> Option<Log> {
        if let Shown::Bar(mut bar) = self.shown {
            bar.clear();
        }
        self.log
    }
}
