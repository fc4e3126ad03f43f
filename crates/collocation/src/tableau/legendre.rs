//! Legendre polynomials: the nodes of Gauss, Radau and Lobatto, and integrals of Lagrange polynomials.
//!
//! Polynomials are represented as Legendre series, never as monomials, so that results are accurate to rounding for
//! degrees in the hundreds.

use std::f64::consts::PI;

use nalgebra::DMatrix;

/// `P_0 .. P_n` and their derivatives at `x` in [-1, 1], by the three-term recurrence.
fn legendre(n: usize, x: f64) -> Vec<(f64, f64)> {
    let mut p = vec![(1.0, 0.0), (x, 1.0)];
    for k in 1..n {
        let ((older, older_slope), (old, _)) = (p[k - 1], p[k]);
        let k = k as f64;
        let value = ((2.0 * k + 1.0) * x * old - k * older) / (k + 1.0);
        p.push((value, older_slope + (2.0 * k + 1.0) * old));
    }
    p.truncate(n + 1);
    p
}

/// Gauss nodes in (0, 1), ascending: the roots of `P_s`.
pub(super) fn gauss_nodes(s: usize) -> Vec<f64> {
    let guess = |i: usize| -(PI * (i as f64 + 0.75) / (s as f64 + 0.5)).cos();
    symmetric((0..s).map(|i| root(guess(i), |x| legendre(s, x)[s])))
}

/// Radau nodes in (0, 1], ascending: the roots of `P_s - P_(s-1)`, the last of which is 1.
pub(super) fn radau_nodes(s: usize) -> Vec<f64> {
    let difference = |x: f64| {
        let p = legendre(s, x);
        (p[s].0 - p[s - 1].0, p[s].1 - p[s - 1].1)
    };
    let guess = |i: usize| (2.0 * PI * i as f64 / (2.0 * s as f64 - 1.0)).cos();
    let interior = (1..s).rev().map(|i| root(guess(i), difference));
    interior.chain([1.0]).map(|x| 0.5 * (1.0 + x)).collect()
}

/// Lobatto (LGL) nodes in [0, 1], ascending: 0, 1 and the roots of `P_n'`.
pub(super) fn lobatto_nodes(n: usize) -> Vec<f64> {
    let slope = |x: f64| {
        let (p, slope) = legendre(n, x)[n];
        // Legendre's differential equation gives the second derivative.
        let curvature = (2.0 * x * slope - (n * (n + 1)) as f64 * p) / (1.0 - x * x);
        (slope, curvature)
    };
    let interior = (1..n).map(|i| root(-(PI * i as f64 / n as f64).cos(), slope));
    symmetric([-1.0].into_iter().chain(interior).chain([1.0]))
}

/// Newton's method on a polynomial that yields (value, slope), from a guess near a simple root.
fn root(guess: f64, polynomial: impl Fn(f64) -> (f64, f64)) -> f64 {
    let mut x = guess;
    // Convergence is quadratic: five steps suffice from guesses this good.
    for _ in 0..20 {
        let (value, slope) = polynomial(x);
        let step = value / slope;
        x -= step;
        if step.abs() < 1e-15 {
            break;
        }
    }
    x
}

/// Maps [-1, 1] to [0, 1], with exact symmetry about the middle.
fn symmetric(x: impl Iterator<Item = f64>) -> Vec<f64> {
    let x: Vec<f64> = x.collect();
    let mirrored = x.iter().rev();
    x.iter()
        .zip(mirrored)
        .map(|(a, b)| 0.5 + 0.25 * (a - b))
        .collect()
}

/// The Lagrange polynomials `l_i` of some nodes, as Legendre series on [0, 1].
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lagrange {
    /// Column `i` holds the Legendre coefficients of `l_i`.
    series: DMatrix<f64>,
}

impl Lagrange {
    /// The polynomials of distinct nodes in [0, 1].
    pub(super) fn new(nodes: &[f64]) -> Self {
        let n = nodes.len();
        let rows: Vec<_> = nodes
            .iter()
            .map(|c| legendre(n - 1, 2.0 * c - 1.0))
            .collect();
        // The value of Σ_k series_ki P_k is 1 at node i and 0 at the others. This matrix is far better
        // conditioned than one of monomials: 16 at 65 Lobatto nodes.
        let values = DMatrix::from_fn(n, n, |node, k| rows[node][k].0);
        let series = values.try_inverse().expect("the nodes are distinct");
        Self { series }
    }

    /// `∫_0^c l_i` for every node.
    pub(super) fn integrals(&self, c: f64) -> Vec<f64> {
        let n = self.series.nrows();
        let p = legendre(n, 2.0 * c - 1.0);
        // ∫ P_k = (P_(k+1) - P_(k-1)) / (2k + 1), which vanishes at the left end; mapping to [0, 1] halves it.
        let integral = |k: usize| match k {
            0 => c,
            _ => 0.5 * (p[k + 1].0 - p[k - 1].0) / (2 * k + 1) as f64,
        };
        let integrals: Vec<f64> = (0..n).map(integral).collect();
        let column = |i: usize| {
            self.series
                .column(i)
                .iter()
                .zip(&integrals)
                .map(|(s, p)| s * p)
                .sum()
        };
        (0..n).map(column).collect()
    }
}
