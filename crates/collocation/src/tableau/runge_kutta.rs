//! Schemes that are Runge–Kutta methods.
//!
//! In nodal form the defects are `X_i - X_0 - h Σ_j a_ij f(X_j)`, with the stages among the unknowns
//! (Hairer & Wanner, *Solving Ordinary Differential Equations II*, section IV.5). A collocation method has
//! `a_ij = ∫_0^(c_i) l_j`, the integrals of the Lagrange polynomials of its points.

use super::legendre::{Lagrange, gauss_nodes, lobatto_nodes, radau_nodes};
use super::{Defect, Interpolant, Point, Tableau, Value, row};

/// Forward Euler.
pub(super) fn euler() -> Tableau {
    nodal(&[0.0, 1.0], &[0], |_| vec![1.0])
}

/// Trapezoid.
pub(super) fn trapezoid() -> Tableau {
    nodal(&[0.0, 1.0], &[0, 1], |_| vec![0.5, 0.5])
}

/// Hermite–Simpson with the midpoint state as an unknown.
pub(super) fn hermite_simpson() -> Tableau {
    nodal(&[0.0, 0.5, 1.0], &[0, 1, 2], |c| match c {
        0.5 => vec![5.0 / 24.0, 8.0 / 24.0, -1.0 / 24.0],
        _ => vec![1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0],
    })
}

/// Gauss–Legendre with `s` stages; the end is an additional unknown.
pub(super) fn gauss(s: usize) -> Tableau {
    let abscissae: Vec<f64> = [0.0]
        .into_iter()
        .chain(gauss_nodes(s))
        .chain([1.0])
        .collect();
    let stages: Vec<usize> = (1..=s).collect();
    collocation(&abscissae, &stages)
}

/// Radau IIA with `s` stages, the last of which is the end.
pub(super) fn radau(s: usize) -> Tableau {
    let abscissae: Vec<f64> = [0.0].into_iter().chain(radau_nodes(s)).collect();
    let stages: Vec<usize> = (1..=s).collect();
    collocation(&abscissae, &stages)
}

/// Legendre pseudospectral on the `n + 1` Lobatto nodes, in integral form.
///
/// A pseudospectral method is usually written with a differentiation matrix, `Σ_j D_ij X_j = h f(X_i)` at all `n + 1`
/// nodes. Those are `n + 1` equations for `n` unknown states, and D has the constants as its null space, so one row
/// must be dropped: the rest collocates at `n` nodes, whose quadrature has only order `n`. The integral form prescribes
/// the derivative at all `n + 1` nodes, for a polynomial one degree higher. It is Lobatto IIIA, of order `2n`, with the
/// same unknowns.
pub(super) fn lobatto(n: usize) -> Tableau {
    let stages: Vec<usize> = (0..=n).collect();
    collocation(&lobatto_nodes(n), &stages)
}

/// The collocation method with the given nodes as points.
fn collocation(nodes: &[f64], points: &[usize]) -> Tableau {
    let places: Vec<f64> = points.iter().map(|j| nodes[*j]).collect();
    let basis = Lagrange::new(&places);
    nodal(nodes, points, |c| basis.integrals(c))
}

/// A Runge–Kutta method in nodal form: all nodes are states, `f` is evaluated at the nodes `points`, and `weights`
/// returns the row of `a_ij` for the node at an abscissa.
fn nodal(nodes: &[f64], points: &[usize], weights: impl Fn(f64) -> Vec<f64>) -> Tableau {
    let places: Vec<f64> = points.iter().map(|j| nodes[*j]).collect();
    let defect = |j: usize| Defect {
        e: vec![(0, -1.0), (j, 1.0)],
        a: row(weights(nodes[j])),
    };
    let point = |j: &usize| Point {
        c: nodes[*j],
        value: Value::Unknown(*j),
    };
    Tableau {
        abscissae: nodes.to_vec(),
        points: points.iter().map(point).collect(),
        defects: (1..nodes.len()).map(defect).collect(),
        interpolant: Interpolant::Integral(Lagrange::new(&places)),
    }
}
