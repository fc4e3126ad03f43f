//! Simulation with the estimates: on a mesh that is too coarse, collocation may fit states that no solution of the
//! equations follows.

use super::watch::Watch;
use crate::fit::evaluate::objective;
use crate::posed::Posed;
use crate::search::begin::{discretised, scales};
use crate::search::solved::Solved;
use crate::search::solved::initial;
use pilotage_collocation::{Collocation, Course, Quality, Run, Scheme, Stop};
use rayon::prelude::*;
use std::time::Instant;

/// Error tolerance of a simulation step, relative to the states.
const TOLERANCE: f64 = 1e-8;

/// Simulation of each run with the estimates, and its objective.
pub(super) struct Simulated {
    pub at: (Collocation, Vec<f64>),
    pub objective: f64,
}

/// Simulates all runs with the estimates. None if the simulation fails or is ended.
pub(super) fn simulated(
    posed: &Posed<'_>,
    solved: &Solved,
    watch: &Watch<'_, '_>,
) -> Option<Simulated> {
    let clock = Instant::now();
    let (problem, z) = (&solved.problem, &solved.solution.iterate.z);
    let theta = problem.physical_theta(z);
    let at = simulation(posed, (problem, z), &theta, &|| watch.is_late(clock))?;
    Some(Simulated {
        objective: objective(posed, &at),
        at,
    })
}

/// The objective of a simulation from the initial states of a solution with other shared parameters. None if it fails.
pub(super) fn with(
    posed: &Posed<'_>,
    solved: &Solved,
    theta: &[f64],
    watch: &Watch<'_, '_>,
) -> Option<f64> {
    let at = (&solved.problem, &solved.solution.iterate.z[..]);
    let found = simulation(posed, at, theta, &|| watch.is_over())?;
    Some(objective(posed, &found)).filter(|own| own.is_finite())
}

/// Simulates the runs with these parameters from the initial states in these variables. Returns a nonlinear program
/// with the samples as mesh, and its variables. None if a simulation fails.
pub(super) fn simulation(
    posed: &Posed<'_>,
    (problem, z): (&Collocation, &[f64]),
    theta: &[f64],
    stop: &Stop<'_>,
) -> Option<(Collocation, Vec<f64>)> {
    let initial = initial(problem, z);
    let magnitudes = |j: usize| problem.magnitudes(z, j);
    free_run(posed, theta, (&initial, &magnitudes), stop)
}

/// The same from given initial states of each run, with their magnitudes.
pub(super) fn free_run(
    posed: &Posed<'_>,
    theta: &[f64],
    (initial, magnitudes): (&[Vec<f64>], &(dyn Fn(usize) -> Vec<f64> + Sync)),
    stop: &Stop<'_>,
) -> Option<(Collocation, Vec<f64>)> {
    let placed = |j: usize| posed.run_at(j, theta, &initial[j]).into_owned();
    let runs: Vec<Run> = (0..posed.runs.len()).map(placed).collect();
    let course = |(j, run)| {
        let quality = Quality {
            tolerance: TOLERANCE,
            magnitudes: magnitudes(j),
            most_steps: usize::MAX,
        };
        posed.model.course(run, theta, &initial[j], &quality, stop)
    };
    let courses = runs.par_iter().enumerate().map(course);
    let courses: Vec<Course> = courses.collect();
    if !courses.iter().all(|course| course.is_whole) {
        return None;
    }
    // With the samples as mesh, the states there are those of the simulation for any scheme.
    let scales = scales(posed, &courses, theta);
    let problem = discretised(posed, runs, scales, &posed.bounds, Scheme::Trapezoid);
    let paths = courses.iter().map(|own| (&own.time[..], &own.states[..]));
    let z = problem.variables_along(paths, theta);
    Some((problem, z))
}
