//! Conditions under which instances, alone or wired, are stable where the first run begins.
//!
//! Of the linearised equations the characteristic polynomial, by Faddeev and Le Verrier (Gantmacher, *The Theory of
//! Matrices*, vol. 1, ch. IV, §5), and the first column of Routh's array (vol. 2, ch. XV, §3), as expressions of
//! the parameters.

use crate::error::ProblemError;
use crate::file::ProblemFile;
use crate::joint::{Joint, unknown};
use pilotage_expression::{Graph, Model, Node};
use std::collections::HashMap;

/// The slowest decay of an instance that counts as stable \[1/s\].
const MARGIN: f64 = 1e-6;

/// The slowest decay of a closed loop that does \[1/s\]: what is left of a slow mode fades within a thousand seconds;
/// runs of seconds cannot tell more.
const LOOP_MARGIN: f64 = 1e-3;

/// Most states of what is kept stable: the polynomial of more loses its digits.
const MOST_STATES: usize = 20;

/// Where a problem is linearised.
pub struct Point<'a> {
    pub joint: &'a Joint,
    pub file: &'a ProblemFile,
    /// Nodes of the parameters and of inputs that nothing drives.
    pub values: &'a HashMap<String, Node>,
    /// States and inputs of the joint model.
    pub initial: &'a (Vec<f64>, Vec<f64>),
}

/// Expressions that are above zero where all is stable that a file says.
pub fn conditions(graph: &mut Graph, at: &Point<'_>) -> Result<Vec<Node>, ProblemError> {
    let mut all = Vec::new();
    let (joint, stability) = (at.joint, &at.file.stability);
    for name in &stability.models {
        let found = joint.parts.iter().position(|(own, _)| *own == name.value);
        let part = found.ok_or_else(|| {
            let known: Vec<String> = joint.parts.iter().map(|(name, _)| name.clone()).collect();
            let fault = unknown("instance", &name.value, &known);
            ProblemError::maybe_at(name.place.as_ref(), fault)
        })?;
        let before = joint.parts[..part]
            .iter()
            .map(|(_, part)| part.model.states.len());
        let first: usize = before.sum();
        let model = &joint.parts[part].1.model;
        let prefix = format!("{}.", name.value);
        all.extend(
            of_model(graph, at, (model, first, &prefix), MARGIN).map_err(|fault| {
                ProblemError::maybe_at(name.place.as_ref(), format!("`{}` {fault}", name.value))
            })?,
        );
    }
    if let Some(place) = &stability.closed_loop {
        let found = of_model(graph, at, (&joint.model, 0, ""), LOOP_MARGIN);
        all.extend(
            found.map_err(|fault| ProblemError::at(place, format!("the closed loop {fault}")))?,
        );
    }
    Ok(all)
}

/// Conditions of one model, whose states begin at `first` among those of all.
fn of_model(
    graph: &mut Graph,
    at: &Point<'_>,
    (model, first, prefix): (&Model, usize, &str),
    margin: f64,
) -> Result<Vec<Node>, String> {
    let n = model.states.len();
    if n == 0 || n > MOST_STATES {
        return Err(format!(
            "has {n} states; stability is kept of 1 to {MOST_STATES}"
        ));
    }
    let mut own = model.system.graph.clone();
    let columns: Vec<Vec<Node>> = (0..n)
        .map(|k| own.derivatives(&model.system.derivatives, model.system.state(k)))
        .collect();
    let (states, inputs) = at.initial;
    let mut variables = vec![graph.constant(0.0)];
    variables.extend(states[first..][..n].iter().map(|x| graph.constant(*x)));
    for name in &model.inputs {
        // Of an instance alone, what drives it elsewhere is 0.
        let name = format!("{prefix}{name}");
        let place = at.joint.model.inputs.iter().position(|own| *own == name);
        variables.push(graph.constant(place.map_or(0.0, |place| inputs[place])));
    }
    for name in &model.parameters {
        variables.push(at.values[&format!("{prefix}{name}")]);
    }
    let matrix: Vec<Vec<Node>> = (columns.iter())
        .map(|column| graph.import(&own, column, &variables))
        .collect();
    let polynomial = characteristic(graph, &matrix);
    Ok(routh(graph, polynomial, margin))
}

/// Coefficients of `det(s I - A)`, that of the highest power first; the matrix column by column.
fn characteristic(graph: &mut Graph, a: &[Vec<Node>]) -> Vec<Node> {
    let n = a.len();
    let (zero, one) = (graph.constant(0.0), graph.constant(1.0));
    let mut coefficients = vec![one];
    // M, column by column, begins as the identity.
    let mut m: Vec<Vec<Node>> = (0..n)
        .map(|j| (0..n).map(|i| if i == j { one } else { zero }).collect())
        .collect();
    for k in 1..=n {
        let product: Vec<Vec<Node>> = m
            .iter()
            .map(|column| {
                (0..n)
                    .map(|i| {
                        (0..n).fold(zero, |sum, l| {
                            let part = graph.multiply(a[l][i], column[l]);
                            graph.add(sum, part)
                        })
                    })
                    .collect()
            })
            .collect();
        let trace = (0..n).fold(zero, |sum, i| graph.add(sum, product[i][i]));
        let coefficient = graph.scale(-1.0 / k as f64, trace);
        coefficients.push(coefficient);
        m = product;
        for (i, column) in m.iter_mut().enumerate() {
            column[i] = graph.add(column[i], coefficient);
        }
    }
    coefficients
}

/// The first column of Routh's array behind its first entry, of the polynomial about `-margin`.
fn routh(graph: &mut Graph, mut p: Vec<Node>, margin: f64) -> Vec<Node> {
    let n = p.len() - 1;
    // Horner's scheme: p(s - margin).
    for last in (1..=n).rev() {
        for k in 1..=last {
            let part = graph.scale(-margin, p[k - 1]);
            p[k] = graph.add(p[k], part);
        }
    }
    let zero = graph.constant(0.0);
    let mut upper: Vec<Node> = p.iter().copied().step_by(2).collect();
    let mut lower: Vec<Node> = p.iter().copied().skip(1).step_by(2).collect();
    let mut column = Vec::new();
    for _ in 0..n {
        column.push(lower[0]);
        let factor = graph.divide(upper[0], lower[0]);
        let next: Vec<Node> = (1..upper.len())
            .map(|k| {
                let part = lower
                    .get(k)
                    .map_or(zero, |own| graph.multiply(factor, *own));
                graph.subtract(upper[k], part)
            })
            .collect();
        upper = std::mem::replace(&mut lower, next);
    }
    column
}
