//! Simulation without the estimated initial states. Free initial states may carry runs that the model does not explain.

use super::check::free_run;
use crate::posed::Posed;
use crate::result::{Fit, RunFit};
use crate::search::solved::initial;
use pilotage_collocation::Stop;

/// The runs, simulated with the estimated parameters from what `[initial]` would be if no state were `free`: the first sample
/// of a measured state, and the start values of the models. None if no state is, if noise drives the system, or if a simulation
/// fails.
pub fn alone(posed: &Posed<'_>, fit: &Fit, stop: &Stop<'_>) -> Option<Vec<RunFit>> {
    let free: Vec<&String> = posed.free_states().collect();
    let solved = fit.solved.as_deref().filter(|_| fit.is_met());
    let solved = solved.filter(|_| !free.is_empty() && posed.filter.is_none())?;
    let (problem, z) = (&solved.problem, &solved.solution.iterate.z);
    let mut begins = initial(problem, z);
    for (j, x) in begins.iter_mut().enumerate() {
        for (k, name) in posed.joint.model.states.iter().enumerate() {
            if free.contains(&name) {
                x[k] = posed.states[k].guesses[j];
            }
        }
    }
    let theta = problem.physical_theta(z);
    let magnitudes = |j: usize| problem.magnitudes(z, j);
    let (problem, z) = free_run(posed, &theta, (&begins, &magnitudes), stop)?;
    Some(Fit::runs(posed, &problem, &z))
}
