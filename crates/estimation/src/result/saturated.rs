//! Where outputs of the model saturate.

use super::courses::courses;
use crate::posed::{Posed, variables};
use crate::system::part::Part;
use pilotage_collocation::Collocation;
use pilotage_expression::Node;

/// An output that saturates at samples of the fitted runs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Saturated {
    /// Its name.
    pub output: String,
    /// Number of samples at which it lies at a limit.
    pub samples: usize,
    /// Number of samples.
    pub of: usize,
}

/// An output with its name, its instance and its limits.
type Limited<'a> = (String, &'a String, &'a Part, [Node; 2]);

/// The outputs that saturate at these variables.
pub fn saturated(posed: &Posed<'_>, problem: &Collocation, z: &[f64]) -> Vec<Saturated> {
    if posed.free.is_none() {
        return Vec::new();
    }
    let theta = problem.physical_theta(z);
    let of: usize = posed.runs.iter().map(|run| run.time.len()).sum();
    let limited = posed.joint.parts.iter().flat_map(|(instance, part)| {
        let outputs = part.model.outputs.iter().zip(&part.limits);
        outputs.filter_map(move |(name, limit)| {
            Some((format!("{instance}.{name}"), instance, part, (*limit)?))
        })
    });
    let limited: Vec<Limited<'_>> = limited.collect();
    let names: Vec<&str> = limited.iter().map(|own| own.0.as_str()).collect();
    let courses = courses(posed, (problem, z), &names);
    let count =
        |((output, instance, part, limit), values): (Limited<'_>, Option<Vec<Vec<f64>>>)| {
            let values = values?;
            let at_limit = |(j, values): (usize, &Vec<f64>)| {
                let [low, high] = ends(posed, (instance, part), limit, (j, &theta));
                // In the middle of its rounded corner a saturated output is this far from its limit.
                let near = 0.5 * std::f64::consts::LN_2 * Part::CORNER * (high - low);
                let is_near = |y: &&f64| **y > high - near || **y < low + near;
                values.iter().filter(is_near).count()
            };
            let samples = values.iter().enumerate().map(at_limit).sum();
            (samples > 0).then_some(Saturated {
                output,
                samples,
                of,
            })
        };
    limited.into_iter().zip(courses).filter_map(count).collect()
}

/// The limits of an output at the start of a run, which are expressions of parameters.
fn ends(
    posed: &Posed<'_>,
    (instance, part): (&str, &Part),
    limit: [Node; 2],
    (j, theta): (usize, &[f64]),
) -> [f64; 2] {
    let states = vec![0.0; posed.states.len()];
    let all = (posed.model.system.graph).values(&variables(posed, j, 0, &states, theta));
    let joint = &posed.joint.model;
    let first = joint.system.parameter(0);
    let value = |name: &String| {
        let name = format!("{instance}.{name}");
        let place = joint.parameters.iter().position(|own| *own == name);
        let node = place.map(|place| posed.quantities.joint[first + place]);
        node.map_or(f64::NAN, |node| all[node.index()])
    };
    let system = &part.model.system;
    let mut at = vec![0.0; 1 + system.states + system.inputs];
    at.extend(part.model.parameters.iter().map(value));
    let values = system.graph.values(&at);
    limit.map(|end| values[end.index()])
}
