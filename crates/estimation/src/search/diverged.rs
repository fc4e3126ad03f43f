//! Simulations that diverge, which are no beginning of a search.

use crate::posed::{Posed, variables};
use pilotage_collocation::Course;

/// Largest magnitude of a state of unknown size that is not doubted, as a multiple of the size that is assumed.
const FARTHEST: f64 = 1e6;

/// The same of a prediction, as a multiple of the recording.
const FAR: f64 = 1e3;

/// Number of samples at which predictions are compared.
const MOST: usize = 64;

/// Replaces states of a run that diverge by their initial values. Returns whether there are any.
///
/// A state far larger than assumed may be so by its nature, such as a population that begins with one individual. It diverges if
/// the simulation ends early or its predictions are far from anything recorded.
pub(super) fn tame(
    posed: &Posed<'_>,
    (j, course): (usize, &mut Course),
    sizes: &[f64],
    theta: &[f64],
) -> bool {
    let seen = course.sizes();
    let is_large = |k: &usize| seen[*k] > FARTHEST * sizes[*k];
    let large: Vec<usize> = (0..sizes.len()).filter(is_large).collect();
    if large.is_empty() || (course.is_whole && !is_far(posed, (j, course), theta)) {
        return false;
    }
    let initial = course.states[0].clone();
    for k in &large {
        course.states.iter_mut().for_each(|x| x[*k] = initial[*k]);
    }
    true
}

/// Whether a prediction is far larger than all that is recorded of it in this run.
fn is_far(posed: &Posed<'_>, (j, course): (usize, &Course), theta: &[f64]) -> bool {
    let (quantities, graph) = (&posed.quantities, &posed.model.system.graph);
    let largest = |values: &[f64]| {
        values
            .iter()
            .fold(0.0, |most: f64, own| most.max(own.abs()))
    };
    let recorded = quantities.recorded.iter().map(|all| largest(&all[j]));
    let recorded: Vec<f64> = recorded.collect();
    let step = course.samples.len().div_ceil(MOST).max(1);
    let mut samples = course.samples.iter().enumerate().rev().step_by(step);
    samples.any(|(sample, at)| {
        let at = variables(posed, j, sample, &course.states[*at], theta);
        let values = graph.values(&at);
        let mut pairs = quantities.predicted.iter().zip(&recorded);
        pairs.any(|(node, recorded)| {
            let predicted = values[node.index()].abs();
            *recorded > 0.0 && (predicted.is_nan() || predicted > FAR * recorded)
        })
    })
}
