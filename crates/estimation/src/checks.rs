//! What is refused before the solve, beyond what single lines of the file say.

use crate::assembly::Made;
use crate::data::RunData;
use crate::error::ProblemError;
use crate::file::{Mesh, ProblemFile};
use crate::fit::MOST_INTERVALS;

/// Refuses a step by which the mesh has more intervals than a solve can hold.
pub fn mesh(file: &ProblemFile, data: &[RunData<'_>]) -> Result<(), ProblemError> {
    let Mesh::Step(step) = file.options.mesh else {
        return Ok(());
    };
    let duration: f64 = data
        .iter()
        .map(|run| run.series.time[run.series.time.len() - 1] - run.begin())
        .sum();
    match duration / step <= MOST_INTERVALS as f64 {
        true => Ok(()),
        false => {
            let least = duration / MOST_INTERVALS as f64;
            let fault = format!(
                "the runs last {duration} s, which is more than {MOST_INTERVALS} such steps; write {least:.1e} or more"
            );
            Err(ProblemError::maybe_at(file.mesh_place.as_ref(), fault))
        }
    }
}

/// Refuses what is sought though no measured signal depends on it: directly, or by the derivatives of states on which
/// it depends.
pub fn dependence(made: &Made) -> Result<(), ProblemError> {
    let graph = &made.system.graph;
    let (states, shared) = (made.system.states, made.system.parameter(0));
    let mut nodes = made.measured.clone();
    let mut needed = graph.ancestors(&nodes);
    loop {
        let is_needed = |state: usize| {
            let variable = graph.known_variable(1 + state);
            variable.is_some_and(|node| needed[node.index()])
        };
        let derivatives = (0..states)
            .filter(|k| is_needed(*k))
            .map(|k| made.system.derivatives[k]);
        let before = nodes.len();
        nodes.extend(
            derivatives
                .filter(|node| !needed[node.index()])
                .collect::<Vec<_>>(),
        );
        if nodes.len() == before {
            break;
        }
        needed = graph.ancestors(&nodes);
    }
    for (unknown, stands) in &made.unknowns {
        let mut own = stands.variables(shared).into_iter();
        let is_needed = |variable: usize| {
            let node = graph.known_variable(variable);
            node.is_some_and(|node| needed[node.index()])
        };
        if !own.any(is_needed) {
            let name = &unknown.name;
            let fault = format!(
                "no measured signal depends on `{name}`; leave it out, or write fixed = true"
            );
            return Err(ProblemError::maybe_at(unknown.place.as_ref(), fault));
        }
    }
    Ok(())
}
