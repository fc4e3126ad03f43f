//! Signals along a solution, measured or not.

use crate::posed::{Posed, variables};
use pilotage_collocation::Collocation;
use pilotage_expression::Node;
use rayon::prelude::*;

/// Values of signals at the samples of each run, at these variables. None for a name that is no signal of the system.
pub fn courses(
    posed: &Posed<'_>,
    (problem, z): (&Collocation, &[f64]),
    names: &[&str],
) -> Vec<Option<Vec<Vec<f64>>>> {
    let nodes: Vec<Option<Node>> = names.iter().map(|name| posed.joint.signal(name)).collect();
    let theta = problem.physical_theta(z);
    if nodes.iter().all(Option::is_none) {
        return vec![None; names.len()];
    }
    // For each run, the signals one after the other.
    let of_run = |j: usize| {
        let mut all = vec![Vec::new(); names.len()];
        for (sample, x) in problem.states_at_samples(z, j).iter().enumerate() {
            let own = (posed.model.system.graph).values(&variables(posed, j, sample, x, &theta));
            let joint = posed.quantities.joint.iter().map(|node| own[node.index()]);
            let values = (posed.joint.model.system.graph).values(&joint.collect::<Vec<f64>>());
            for (course, node) in all.iter_mut().zip(&nodes) {
                course.extend(node.map(|node| values[node.index()]));
            }
        }
        all
    };
    let mut runs: Vec<Vec<Vec<f64>>> = (0..posed.runs.len()).into_par_iter().map(of_run).collect();
    let mut course = |k: usize| {
        runs.iter_mut()
            .map(|run| std::mem::take(&mut run[k]))
            .collect()
    };
    let nodes = nodes.into_iter().enumerate();
    nodes.map(|(k, node)| node.map(|_| course(k))).collect()
}
