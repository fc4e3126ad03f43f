//! Signals along a solution, measured or not.

use crate::posed::{Posed, variables};
use pilotage_collocation::Collocation;
use pilotage_expression::Node;

/// Values of signals at the samples of each run, at these variables. None for a name that is no signal of the system.
pub fn courses(
    posed: &Posed<'_>,
    (problem, z): (&Collocation, &[f64]),
    names: &[&str],
) -> Vec<Option<Vec<Vec<f64>>>> {
    let nodes: Vec<Option<Node>> = names.iter().map(|name| posed.joint.signal(name)).collect();
    let theta = problem.physical_theta(z);
    let mut all = vec![vec![Vec::new(); posed.runs.len()]; names.len()];
    for j in 0..posed.runs.len() {
        let states = problem.states_at_samples(z, j);
        for (sample, x) in states.iter().enumerate() {
            let own = (posed.model.system.graph).values(&variables(posed, j, sample, x, &theta));
            let joint = posed.quantities.joint.iter().map(|node| own[node.index()]);
            let values = (posed.joint.model.system.graph).values(&joint.collect::<Vec<f64>>());
            for (course, node) in all.iter_mut().zip(&nodes) {
                course[j].extend(node.map(|node| values[node.index()]));
            }
        }
    }
    let pairs = all.into_iter().zip(nodes);
    pairs.map(|(course, node)| node.map(|_| course)).collect()
}
