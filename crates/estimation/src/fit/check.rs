//! What was found, simulated: on a mesh that is too coarse, collocation may fit what no solution of the equations does.

use super::begin::{discretised, scales};
use super::solve::Solved;
use super::watch::Watch;
use crate::evaluate::objective;
use crate::posed::Posed;
use pilotage_collocation::{Collocation, Course, Quality, Scheme};
use rayon::prelude::*;

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
    let (problem, z) = (&solved.problem, &solved.solution.iterate.z);
    let (theta, initial) = (problem.physical_theta(z), solved.initial());
    let course = |(j, run)| {
        let quality = Quality {
            tolerance: TOLERANCE,
            magnitudes: problem.magnitudes(z, j),
        };
        let stop = || watch.is_over();
        posed
            .model
            .course(run, &theta, &initial[j], &quality, &stop)
    };
    let runs = posed.runs.par_iter().enumerate();
    let courses: Vec<Course> = runs.map(course).collect();
    if !courses.iter().all(|course| course.is_whole) {
        return None;
    }
    // With the samples as mesh, the states there are those of the simulation whatever the scheme is.
    let scales = scales(posed, &courses, &theta);
    let problem = discretised(posed, posed.runs.clone(), scales, Scheme::Trapezoid);
    let paths = courses.iter().map(|own| (&own.time[..], &own.states[..]));
    let z = problem.variables_along(paths, &theta);
    let at = (problem, z);
    Some(Simulated {
        objective: objective(posed, &at),
        at,
    })
}
