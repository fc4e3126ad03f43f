//! Conditions for stability of instances, alone or connected, where the first run begins.
//!
//! The characteristic polynomial of the linearised equations (Berkowitz, Inf. Process. Lett. 18, 1984) and the first
//! column of its Routh array (Gantmacher, *The Theory of Matrices*, vol. 2, ch. XV, §3), as expressions of the
//! parameters.

use crate::problem::error::ProblemError;
use crate::problem::file::ProblemFile;
use crate::system::joint::{Joint, unknown};
use pilotage_expression::{Function, Graph, Model, Node};
use pilotage_text::counted;
use std::collections::HashMap;

/// Slowest decay of an instance that counts as stable \[1/s\].
const MARGIN: f64 = 1e-6;

/// Slowest decay of a closed loop that counts as stable \[1/s\]: a slow mode decays within a thousand seconds. Runs of
/// seconds cannot determine more.
const LOOP_MARGIN: f64 = 1e-3;

/// Name of the connected instances in messages.
pub const CLOSED_LOOP: &str = "the closed loop";

/// Maximum number of states for a stability condition: the polynomial of larger systems loses precision.
const MOST_STATES: usize = 20;

/// Maximum number of states with sought coefficients for which the entries of Routh's column are taken as they are.
const FEW_SOUGHT: usize = 4;

/// Added to squares, which may be 0.
const TINY: f64 = 1e-280;

/// The point at which a problem is linearised.
pub struct Point<'a> {
    pub joint: &'a Joint,
    pub file: &'a ProblemFile,
    /// Nodes of the parameters and of inputs that are not driven.
    pub values: &'a HashMap<String, Node>,
    /// States and inputs of the joint model.
    pub initial: &'a (Vec<f64>, Vec<f64>),
}

/// Expressions that are positive if everything listed in the file is stable, each with the name of the stable system.
pub fn conditions(graph: &mut Graph, at: &Point<'_>) -> Result<Vec<(Node, String)>, ProblemError> {
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
        let found = of_model(graph, at, (model, first, &prefix), MARGIN).map_err(|fault| {
            ProblemError::maybe_at(name.place.as_ref(), format!("`{}` {fault}", name.value))
        })?;
        let of = format!("`{}`", name.value);
        all.extend(found.into_iter().map(|node| (node, of.clone())));
    }
    if let Some(place) = &stability.closed_loop {
        let found = of_model(graph, at, (&joint.model, 0, ""), LOOP_MARGIN);
        let found =
            found.map_err(|fault| ProblemError::at(place, format!("the closed loop {fault}")))?;
        all.extend(found.into_iter().map(|node| (node, CLOSED_LOOP.to_owned())));
    }
    Ok(all)
}

/// Conditions of one model, whose states begin at index `first` of all states.
fn of_model(
    graph: &mut Graph,
    at: &Point<'_>,
    (model, first, prefix): (&Model, usize, &str),
    margin: f64,
) -> Result<Vec<Node>, String> {
    let n = model.states.len();
    if n == 0 || n > MOST_STATES {
        return Err(format!(
            "has {}; stability is kept of 1 to {MOST_STATES}",
            counted(n, "state")
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
        // For an instance alone, inputs driven by others are 0.
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
    let is_sought = |row: &usize| {
        let mut entries = matrix.iter().map(|column| column[*row]);
        entries.any(|entry| graph.value(entry).is_none())
    };
    let sought = (0..n).filter(is_sought).count();
    let polynomial = characteristic(graph, &matrix);
    Ok(routh(graph, polynomial, margin, sought > FEW_SOUGHT))
}

/// Coefficients of `det(s I - A)`, highest power first. The matrix is given column by column.
///
/// With the last rows and columns `M` of the matrix, the row `R` and the column `C` before them, and the entry `a`, the
/// polynomial with one more row is that of `M` times the Toeplitz matrix of `1, -a, -RC, -RMC, -RM²C, ...` (Berkowitz
/// 1984). There are no divisions, and zeros stay zero: a chain of lags keeps its precision.
fn characteristic(graph: &mut Graph, a: &[Vec<Node>]) -> Vec<Node> {
    let n = a.len();
    let zero = graph.constant(0.0);
    let dot = |graph: &mut Graph, row: usize, from: usize, v: &[Node]| {
        (from..n).zip(v).fold(zero, |sum, (j, v)| {
            let part = graph.multiply(a[j][row], *v);
            graph.add(sum, part)
        })
    };
    let mut polynomial = vec![graph.constant(1.0)];
    for first in (0..n).rev() {
        let mut toeplitz = vec![graph.constant(1.0), graph.negate(a[first][first])];
        let mut v: Vec<Node> = a[first][first + 1..].to_vec();
        for _ in first + 1..n {
            let product = dot(graph, first, first + 1, &v);
            toeplitz.push(graph.negate(product));
            v = (first + 1..n)
                .map(|row| dot(graph, row, first + 1, &v))
                .collect();
        }
        polynomial = (0..=polynomial.len())
            .map(|i| {
                let terms = polynomial.iter().enumerate().take(i + 1);
                terms.fold(zero, |sum, (j, p)| {
                    let part = graph.multiply(toeplitz[i - j], *p);
                    graph.add(sum, part)
                })
            })
            .collect();
    }
    polynomial
}

/// The first column of the Routh array after its first entry, for the polynomial expanded about `-margin`.
///
/// The entries go with powers of the sought poles. If there are many, an entry may be small only because the time constants
/// have grown, and would act as a bound: if `is_relative`, each is divided by a positive number of its size. With few they
/// stay as they are, since they are nearly linear in the coefficients of a transfer function.
fn routh(graph: &mut Graph, mut p: Vec<Node>, margin: f64, is_relative: bool) -> Vec<Node> {
    let n = p.len() - 1;
    // Horner's scheme: p(s - margin).
    for last in (1..=n).rev() {
        for k in 1..=last {
            let part = graph.scale(-margin, p[k - 1]);
            p[k] = graph.add(p[k], part);
        }
    }
    let mut upper: Vec<Node> = p.iter().copied().step_by(2).collect();
    let mut lower: Vec<Node> = p.iter().copied().skip(1).step_by(2).collect();
    let (mut column, mut sizes) = (vec![lower[0]], vec![[Some(lower[0]), None]]);
    for _ in 1..n {
        let factor = graph.divide(upper[0], lower[0]);
        let parts: Vec<Node> = (lower[1..].iter())
            .map(|own| graph.multiply(factor, *own))
            .collect();
        sizes.push([Some(upper[1]), parts.first().copied()]);
        let next: Vec<Node> = (1..upper.len())
            .map(|k| match parts.get(k - 1) {
                Some(part) => graph.subtract(upper[k], *part),
                None => upper[k],
            })
            .collect();
        column.push(next[0]);
        upper = std::mem::replace(&mut lower, next);
    }
    if !is_relative || n == 1 {
        return column;
    }
    // The sum of the roots against that of their pairs, and their product against those of one and two roots fewer, with
    // which it has its sign.
    let pairs = magnitude(graph, p[2]);
    sizes[0][1] = Some(graph.unary(Function::Sqrt, pairs));
    let fewer = magnitude(graph, p[n - 2]);
    column[n - 1] = graph.multiply(p[n], fewer);
    let square = graph.multiply(p[n - 1], p[n - 1]);
    sizes[n - 1] = [Some(column[n - 1]), Some(square)];
    let all = column.into_iter().zip(sizes);
    all.map(|(value, sizes)| relative(graph, value, sizes))
        .collect()
}

/// The value divided by the root of the sum of squares of these sizes.
fn relative(graph: &mut Graph, value: Node, sizes: [Option<Node>; 2]) -> Node {
    let mut sum = graph.constant(TINY);
    for size in sizes.into_iter().flatten() {
        let square = graph.multiply(size, size);
        sum = graph.add(sum, square);
    }
    let size = graph.unary(Function::Sqrt, sum);
    graph.divide(value, size)
}

/// The magnitude, with a derivative at 0.
fn magnitude(graph: &mut Graph, value: Node) -> Node {
    let square = graph.multiply(value, value);
    let tiny = graph.constant(TINY);
    let sum = graph.add(square, tiny);
    graph.unary(Function::Sqrt, sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use pilotage_linear::eigenvalues;
    use proptest::prelude::*;

    proptest! {
        /// The polynomial vanishes at the eigenvalues, and Routh's column is positive if all are left of the margin.
        #[test]
        fn polynomial_and_column_agree_with_the_eigenvalues(
            n in 1_usize..=10, entries in prop::collection::vec(-2.0..2.0_f64, 100), shift in -3.0..1.0_f64,
            margin in prop::sample::select(vec![MARGIN, LOOP_MARGIN, 0.1]),
        ) {
            let matrix = DMatrix::from_fn(n, n, |i, j| entries[10 * i + j] + if i == j { shift } else { 0.0 });
            let mut graph = Graph::default();
            let columns: Vec<Vec<Node>> = (0..n)
                .map(|j| (0..n).map(|i| graph.constant(matrix[(i, j)])).collect())
                .collect();
            let polynomial = characteristic(&mut graph, &columns);
            let value = |node: &Node| graph.value(*node).expect("a number");
            let coefficients: Vec<f64> = polynomial.iter().map(value).collect();
            let poles = eigenvalues(&matrix);
            for pole in &poles {
                let at = coefficients.iter().fold(nalgebra::Complex::new(0.0, 0.0), |sum, c| sum * pole + c);
                let size = coefficients.iter().fold(0.0, |sum, c| sum * pole.norm() + c.abs());
                prop_assert!(at.norm() < 1e-9 * size, "{pole}: {at}");
            }
            let worst = poles.iter().map(|pole| pole.re).fold(f64::NEG_INFINITY, f64::max);
            prop_assume!((worst + margin).abs() > 1e-4);
            for is_relative in [false, true] {
                let column = routh(&mut graph, polynomial.clone(), margin, is_relative);
                let is_positive = column.iter().all(|node| graph.value(*node).expect("a number") > 0.0);
                prop_assert_eq!(is_positive, worst < -margin);
            }
        }
    }
}
