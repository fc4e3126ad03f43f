//! What was found, simulated: on a mesh that is too coarse, collocation may fit what no solution of the equations does.

use super::watch::Watch;
use crate::fit::evaluate::objective;
use crate::posed::Posed;
use crate::search::begin::{discretised, scales};
use crate::search::solved::Solved;
use crate::search::solved::initial;
use pilotage_collocation::{Collocation, Course, Quality, Scheme, Stop};
use rayon::prelude::*;
use std::time::Instant;

/// Error of a step of the simulation, relative to the states.
const TOLERANCE: f64 = 1e-8;

/// What was found where each run is simulated from where it was found to begin, and the objective there.
pub(super) struct Simulated {
    pub at: (Collocation, Vec<f64>),
    pub objective: f64,
}

/// The simulation of all runs with what was found. None where there is no such simulation, or it was over before.
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

/// The runs simulated with these parameters from where variables say that they begin: a nonlinear program whose mesh is
/// the samples, and its variables. None where a simulation does not come to its end.
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

/// The same from where the states of each run begin, and with their magnitudes.
pub(super) fn free_run(
    posed: &Posed<'_>,
    theta: &[f64],
    (initial, magnitudes): (&[Vec<f64>], &(dyn Fn(usize) -> Vec<f64> + Sync)),
    stop: &Stop<'_>,
) -> Option<(Collocation, Vec<f64>)> {
    let course = |(j, run)| {
        let quality = Quality {
            tolerance: TOLERANCE,
            magnitudes: magnitudes(j),
        };
        posed.model.course(run, theta, &initial[j], &quality, stop)
    };
    let runs = posed.runs.par_iter().enumerate();
    let courses: Vec<Course> = runs.map(course).collect();
    if !courses.iter().all(|course| course.is_whole) {
        return None;
    }
    // With the samples as mesh, the states there are those of the simulation whatever the scheme is.
    let scales = scales(posed, &courses, theta);
    let problem = discretised(posed, posed.runs.clone(), scales, Scheme::Trapezoid);
    let paths = courses.iter().map(|own| (&own.time[..], &own.states[..]));
    let z = problem.variables_along(paths, theta);
    Some((problem, z))
}
