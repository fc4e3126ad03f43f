//! Collocation schemes as data.
//!
//! A run is divided into elements. An element of length `h` that starts at `t_0` has coefficient vectors `V_0 .. V_s`:
//! `V_0` is the state at its start, shared with the previous element, and `V_s` is the state at its end. A scheme
//! defines the points `i = 0..m` of the element at which the ODE `ẋ = f(x, t)` is evaluated, and the defects `r = 0..s`
//! that vanish at the solution:
//!
//! ```text
//! Y_i = Σ_j P_ij V_j
//! 0   = Σ_j E_rj V_j - h Σ_i A_ri f(Y_i, t_0 + c_i h)
//! ```
//!
//! Implicit Runge–Kutta methods in nodal form, Bernstein polynomials and wide finite differences can all be written as
//! such a [`Tableau`]; [`Scheme`] names and creates them. The tableau is sufficient to evaluate a scheme.

mod bernstein;
mod finite_difference;
mod legendre;
mod runge_kutta;
mod scheme;
#[cfg(test)]
mod tests;

use nalgebra::DMatrix;
use std::sync::Arc;

use legendre::Lagrange;
pub use scheme::{Scheme, UnknownScheme};

/// Sparse row: (index, coefficient), indices ascending, no zeros.
pub type Row = Vec<(usize, f64)>;

/// Distance below which abscissae count as equal [-]: sample times have rounding errors of clocks and sums.
const SAME: f64 = 1e-10;

/// Dimensionless coefficients of one element; its length is a separate factor.
#[derive(Debug, Clone, PartialEq)]
pub struct Tableau {
    /// Position of each coefficient `V_j` along the element, from 0 to 1: the node of a nodal basis, the Greville
    /// abscissa `j/d` of a Bernstein coefficient. The first is 0, the last is 1.
    pub abscissae: Vec<f64>,
    /// Points at which `f` is evaluated.
    pub points: Vec<Point>,
    /// Defects that vanish at the solution: `s` rows, one per unknown.
    pub defects: Vec<Defect>,
    /// The polynomial of the scheme.
    interpolant: Interpolant,
}

/// A point of an element at which the ODE is evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Position along the element, from 0 to 1.
    pub c: f64,
    /// The state at the point.
    pub value: Value,
}

/// The state at a point of an element.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// `Y_i = V_j`.
    Unknown(usize),
    /// `Y_i = Σ_j p_j V_j`, with coefficients of the `V`.
    Combination(Row),
}

/// A defect `Σ_j e_j V_j - h Σ_i a_i f(Y_i)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Defect {
    /// Coefficients of the `V`.
    pub e: Row,
    /// Coefficients of `f` at the points.
    pub a: Row,
}

/// One element of a run's mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    /// Index in the mesh of its start.
    pub first: usize,
    /// Number of mesh intervals that it spans: 1, except for finite differences, which span all.
    pub intervals: usize,
    /// Its coefficients, shared by all elements with the same ones.
    pub tableau: Arc<Tableau>,
}

/// The polynomial of a scheme on an element.
#[derive(Debug, Clone, PartialEq)]
enum Interpolant {
    /// `V_0` plus the integral of the polynomial through `f` at the points: the collocation polynomial
    /// of a Runge–Kutta method.
    Integral(Lagrange),
    /// The Bernstein polynomial whose coefficients are the `V_j`.
    Bernstein,
    /// The polynomial of this degree through the nearest nodes.
    Nodes(usize),
}

impl Tableau {
    /// Number of unknown coefficient vectors, `s`; the first of the element belongs to the previous one.
    #[inline]
    pub fn unknowns(&self) -> usize {
        self.abscissae.len() - 1
    }

    /// Dense output: `x(t_0 + c h) = Σ_j p_j V_j + h Σ_i q_i f(Y_i)` as the rows `(p, q)`, for `c` from 0
    /// to 1.
    ///
    /// It is the interpolant of the scheme, whose order is [`Scheme::interpolant_order`]. At 0 and 1 it is exactly
    /// `V_0` and `V_s`, and at a node that is an unknown of the scheme it is exactly that unknown.
    pub fn interpolate(&self, c: f64) -> (Row, Row) {
        if let Some(j) = self.coefficient_at(c) {
            return (vec![(j, 1.0)], Row::new());
        }
        match &self.interpolant {
            Interpolant::Integral(basis) => (vec![(0, 1.0)], row(basis.integrals(c))),
            Interpolant::Bernstein => (row(bernstein::basis(self.unknowns(), c)), Row::new()),
            Interpolant::Nodes(degree) => {
                let p = finite_difference::interpolate(&self.abscissae, *degree, c);
                (p, Row::new())
            }
        }
    }

    /// The coefficients of an element with these states at the [abscissae](Self::abscissae).
    pub fn through(&self, states: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let (rows, n) = (states.len(), states[0].len());
        let mut basis = DMatrix::zeros(rows, rows);
        if self.interpolant == Interpolant::Bernstein {
            for (i, c) in self.abscissae.iter().enumerate() {
                let (p, _) = self.interpolate(*c);
                p.iter().for_each(|&(j, w)| basis[(i, j)] = w);
            }
            let right = DMatrix::from_fn(rows, n, |i, k| states[i][k]);
            let found = basis.lu().solve(&right);
            let found = found.expect("Bernstein polynomials are independent");
            return (0..rows)
                .map(|i| found.row(i).iter().copied().collect())
                .collect();
        }
        states
    }

    /// Index of the coefficient that is the state at `c`, if there is one.
    fn coefficient_at(&self, c: f64) -> Option<usize> {
        let last = self.unknowns();
        let after = self.abscissae.partition_point(|a| *a <= c);
        let is_state =
            |j: &usize| self.interpolant != Interpolant::Bernstein || *j == 0 || *j == last;
        [after.saturating_sub(1), after.min(last)]
            .into_iter()
            .filter(is_state)
            .find(|j| (self.abscissae[*j] - c).abs() < SAME)
    }
}

/// The sum over a row's entries.
pub fn dot(row: &Row, of: impl Fn(usize) -> f64) -> f64 {
    row.iter().map(|(j, w)| w * of(*j)).sum()
}

/// A sparse row from a dense one.
fn row(dense: impl IntoIterator<Item = f64>) -> Row {
    dense
        .into_iter()
        .enumerate()
        .filter(|(_, value)| *value != 0.0)
        .collect()
}
