//! The observer of a fit: log, table, progress bar, time limit and Ctrl-C.

use super::log::Log;
use super::table::IterationTable;
use crate::cli::deadline::Deadline;
use crate::cli::progress::Progress;
use crate::estimation::fit::Progress as OfProblem;
use crate::identification::Progress as OfFlights;
use crate::sqp::{Iteration, Status};
use std::ops::ControlFlow;

/// An iterate of a fit, of flights or of a problem file.
#[derive(Debug, Clone, Copy)]
pub struct Iterate<'a> {
    /// Order of the linear pilot; lower orders lead to starts. None if there are none.
    pub order: Option<usize>,
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

    /// Shows the progress of a fit of flights and returns whether to continue.
    pub fn flights(&mut self, progress: &OfFlights) -> ControlFlow<Status> {
        match (progress, &mut self.shown) {
            (OfFlights::Iterate(own), _) => self.iterate(&Iterate {
                order: Some(own.order),
                start: own.start,
                starts: own.starts,
                refinement: 0,
                objective: own.iteration.objective,
                iteration: own.iteration,
            }),
            (OfFlights::Search { order, done }, Shown::Bar(bar)) => bar.search(*order, *done),
            (OfFlights::Search { .. }, Shown::Table(_)) => {}
        }
        self.deadline.ask()
    }

    /// The same for a problem, with the factor by which the solver's objective differs from its own.
    pub fn problem(&mut self, progress: &OfProblem, factor: f64) -> ControlFlow<Status> {
        if let Some(iteration) = progress.iteration {
            self.iterate(&Iterate {
                order: None,
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
