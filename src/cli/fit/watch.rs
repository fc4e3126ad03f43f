//! The observer of a fit: log, table, progress bar, time limit and Ctrl-C.

use super::log::Log;
use super::table::IterationTable;
use crate::cli::deadline::Deadline;
use crate::cli::progress::Progress;
use crate::estimation::fit;
use crate::sqp::{Iteration, Status};
use std::ops::ControlFlow;

/// An iterate of a fit.
#[derive(Debug, Clone, Copy)]
pub struct Iterate<'a> {
    /// The start that it belongs to, from 0.
    pub start: usize,
    /// Number of starts so far.
    pub starts: usize,
    /// Number of refinements of the mesh.
    pub refinement: usize,
    /// The objective, not scaled.
    pub objective: f64,
    /// The iterate of the solver.
    pub iteration: &'a Iteration,
}

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

    /// Shows the progress of a fit and returns whether to continue; the solver's objective is the problem's times this factor.
    pub fn see(&mut self, progress: &fit::Progress<'_>, factor: f64) -> ControlFlow<Status> {
        if let Some(iteration) = progress.iteration {
            self.iterate(&Iterate {
                start: progress.start,
                starts: progress.starts,
                refinement: progress.refinement,
                objective: iteration.objective / factor,
                iteration,
            });
        }
        self.deadline.ask()
    }

    fn iterate(&mut self, iterate: &Iterate) {
        if let Some(log) = &mut self.log {
            log.iteration(iterate);
        }
        match &mut self.shown {
            Shown::Table(table) => table.show(iterate),
            Shown::Bar(bar) => bar.iterate(iterate),
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
