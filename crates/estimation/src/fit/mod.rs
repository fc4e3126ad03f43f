//! The fit of a problem: starts, the SQP from each, the best on ever finer meshes.
//!
//! | module | what it holds |
//! | --- | --- |
//! | `begin` | the nonlinear program of a start |
//! | `race` | all starts, and which is best |
//! | `solve` | the SQP from one point |
//! | `refine` | finer meshes |

mod begin;
mod race;
mod refine;
mod solve;

pub use begin::{begin, factor};
pub use refine::Refinement;
pub use solve::{SeeIterates, Solved, solve};

use crate::diagnostics::diagnostics;
use crate::posed::Posed;
use crate::result::Fit;
use crate::starts::starts;
use crate::trouble;
use pilotage_sqp::{Iteration, Status};
use race::{best_of, raced};
use refine::refine;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::time::Instant;

/// What an observer of a fit sees.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Which start, from 0.
    pub start: usize,
    /// Of how many.
    pub starts: usize,
    /// How often the mesh has been refined.
    pub refinement: usize,
    /// The iterate.
    pub iteration: &'a Iteration,
}

/// Sees each iterate; `Break` ends the fit with the best iterate so far and that status.
pub type Observer<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<Status> + Send + 'a;

/// Sees each iterate, with the number of its start or refinement.
type See<'a> = dyn Fn(usize, &Iteration) -> ControlFlow<Status> + Sync + 'a;

/// Most mesh intervals of all runs together.
pub(crate) const MOST_INTERVALS: usize = 400_000;

/// Fits a problem.
pub fn fit(posed: &Posed<'_>, observer: &mut Observer<'_>) -> Fit {
    let clock = Instant::now();
    let options = &posed.file.options;
    let observer = Mutex::new(observer);
    let starts = starts(posed, options.starts);
    let see = |start: usize, refinement: usize, iteration: &Iteration| {
        let progress = Progress {
            start,
            starts: starts.len(),
            refinement,
            iteration,
        };
        (observer.lock()).map_or(ControlFlow::Continue(()), |mut see| see(&progress))
    };
    let mut solved = raced(posed, &starts, &|start, iteration| see(start, 0, iteration));
    let ends: Vec<(Status, f64)> = (solved.iter())
        .map(|own| (own.solution.status, own.solution.iterate.f / posed.factor))
        .collect();
    let best = best_of(&solved);
    let first = solved.swap_remove(best);
    let (last, refinement) = refine(posed, first, &|round, iteration| {
        see(best, round, iteration)
    });
    let trouble = match last.solution.status {
        Status::UndefinedStart => trouble::at_start(posed, &starts[0]),
        _ => None,
    };
    let mut found = Fit {
        trouble,
        starts: ends,
        refinement,
        seconds: clock.elapsed().as_secs_f64(),
        ..Fit::of(posed, &last)
    };
    found.diagnostics = diagnostics(posed, &last, &found);
    found
}
