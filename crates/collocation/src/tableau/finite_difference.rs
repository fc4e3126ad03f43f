//! Higher-order finite differences: the paper's differentiation matrix D with wide stencils, on any mesh.
//!
//! One element spans the whole run, or the part of it between two times of [`Steps`](crate::Steps), and its nodes are the mesh. Row `i` states that the polynomial through `p + 1`
//! nodes around node `i` has the derivative `f` there (weights: Fornberg, *Generation of finite difference formulas on
//! arbitrarily spaced grids*, Math. Comp. 51, 1988).
//!
//! The choice of the nodes determines stability. The run is an initial value problem, so these rows form a boundary
//! value method (Brugnano & Trigiante, *Solving Differential Problems by Multistep Initial and Boundary Value Methods*,
//! 1998): a stencil with ν nodes before `i` must have exactly ν roots inside the unit circle for every `λh` in the left
//! half-plane, otherwise parasitic modes grow from an end into the run. With the symmetric stencil of even p the
//! boundary of that region is the imaginary axis itself: it is the leapfrog scheme, whose sawtooth with a period of two
//! steps satisfies the equations of a slow mode without any damping. With one more past than future node (odd p), or
//! two more (even p), that boundary is in the right half-plane: these are the generalised backward differentiation
//! formulas (chapter 5 there), ν = ⌊(p+2)/2⌋, stable in the whole left half-plane and with full damping for `λh → -∞`.
//! p = 1 is backward Euler, p = 2 BDF2. The first and last rows use the `p + 1` nodes at their end of the run, like the
//! book's additional methods; a run with fewer nodes than the stencil uses all of them.

use super::{Defect, Interpolant, Point, Row, Tableau, Value};

/// The tableau for stencils of `p + 1` nodes on a mesh [s] of at least two boundaries.
pub(super) fn finite_difference(p: usize, mesh: &[f64]) -> Tableau {
    let last = mesh.len() - 1;
    let width = p.min(last);
    let place = |t: &f64| (t - mesh[0]) / (mesh[last] - mesh[0]);
    let abscissae: Vec<f64> = mesh.iter().map(place).collect();
    let defect = |i: usize| {
        let first = first_node(i, (width + 2) / 2, width, last);
        let weights = fornberg(abscissae[i], &abscissae[first..=first + width]);
        Defect {
            e: stencil(first, weights.iter().map(|w| w[1])),
            a: vec![(i - 1, 1.0)],
        }
    };
    let point = |i: usize| Point {
        c: abscissae[i],
        value: Value::Unknown(i),
    };
    Tableau {
        points: (1..=last).map(point).collect(),
        defects: (1..=last).map(defect).collect(),
        abscissae,
        interpolant: Interpolant::Nodes(width),
    }
}

/// Weights of the nodes for the polynomial through the `degree + 1` nodes around `c`.
pub(super) fn interpolate(nodes: &[f64], degree: usize, c: f64) -> Row {
    let last = nodes.len() - 1;
    let interval = nodes.partition_point(|a| *a <= c).saturating_sub(1);
    let first = first_node(interval, degree / 2, degree, last);
    let weights = fornberg(c, &nodes[first..=first + degree]);
    stencil(first, weights.iter().map(|w| w[0]))
}

/// First of `width + 1` nodes, starting `before` nodes ahead of node `i`, shifted into `0..=last`.
fn first_node(i: usize, before: usize, width: usize, last: usize) -> usize {
    i.saturating_sub(before).min(last - width)
}

/// A row of weights on consecutive nodes.
fn stencil(first: usize, weights: impl Iterator<Item = f64>) -> Row {
    let indexed = weights.enumerate().map(|(k, w)| (first + k, w));
    indexed.filter(|(_, w)| *w != 0.0).collect()
}

/// The weights of each node in the value and in the derivative at `z` of the polynomial through all nodes: Fornberg's
/// recursion over the nodes, for derivatives of order 0 and 1.
fn fornberg(z: f64, nodes: &[f64]) -> Vec<[f64; 2]> {
    let mut weights = vec![[1.0, 0.0]];
    let mut product = 1.0;
    for i in 1..nodes.len() {
        let (here, before) = (nodes[i] - z, nodes[i - 1] - z);
        let old = weights[i - 1];
        let product_before = product;
        product = nodes[..i].iter().map(|x| nodes[i] - x).product();
        for (weight, x) in weights.iter_mut().zip(nodes) {
            let gap = nodes[i] - x;
            *weight = [here * weight[0] / gap, (here * weight[1] - weight[0]) / gap];
        }
        let ratio = product_before / product;
        weights.push([-ratio * before * old[0], ratio * (old[0] - before * old[1])]);
    }
    weights
}
