//! The reduced QP with inequalities: clarabel finds the active set, one exact solve polishes it.

use super::arrow::{Arrow, ArrowFactor};
use super::dense::{cholesky, cholesky_solve};
use crate::sqp::QpFailure;
use crate::sqp::convex::{ConvexQp, ConvexSolution};

/// Cost of violating a row when the rows are inconsistent, per unit.
const RELAXATION: f64 = 1e6;
/// Rounding allowed to a polished solution.
const POLISH_TOLERANCE: f64 = 1e-10;

/// Which inequality a row stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowAt {
    /// The bounded signal of a run at an interval boundary.
    Bounded { run: usize, boundary: usize },
    /// A constraint on θ.
    Parameter(usize),
}

/// `lower ≤ Σ entries · ρ ≤ upper`.
#[derive(Debug, Clone)]
pub struct Row {
    /// What it is.
    pub at: RowAt,
    /// Its place in `g`.
    pub index: usize,
    /// Column and coefficient.
    pub entries: Vec<(usize, f64)>,
    /// Lower limit of the linear part.
    pub lower: f64,
    /// Upper limit of the linear part.
    pub upper: f64,
}

impl Row {
    fn value(&self, x: &[f64]) -> f64 {
        self.entries.iter().map(|(column, v)| v * x[*column]).sum()
    }
}

/// Minimises `½ ρᵀ H ρ + qᵀ ρ` within the rows.
pub fn solve(
    matrix: &Arrow,
    factor: &ArrowFactor,
    q: &[f64],
    rows: &[Row],
) -> Result<ConvexSolution, QpFailure> {
    let qp = ConvexQp {
        p: matrix.triplets(),
        q: q.to_vec(),
        a: rows
            .iter()
            .enumerate()
            .flat_map(|(i, row)| row.entries.iter().map(move |&(c, v)| (i, c, v)))
            .collect(),
        lower: rows.iter().map(|row| row.lower).collect(),
        upper: rows.iter().map(|row| row.upper).collect(),
    };
    match qp.solve(None) {
        Ok(rough) => Ok(polish(factor, q, rows, &rough).unwrap_or(rough)),
        Err(QpFailure::Infeasible) => qp.solve(Some(RELAXATION)),
        Err(other) => Err(other),
    }
}

/// The exact solution with the rows active that `rough` has active; None when that guess is wrong.
fn polish(
    factor: &ArrowFactor,
    q: &[f64],
    rows: &[Row],
    rough: &ConvexSolution,
) -> Option<ConvexSolution> {
    let limit = |i: usize| {
        if rough.y[i] > 0.0 {
            rows[i].upper
        } else {
            rows[i].lower
        }
    };
    let active: Vec<usize> = (0..rows.len())
        .filter(|&i| rough.y[i].abs() > (limit(i) - rows[i].value(&rough.x)).abs())
        .collect();
    let m = active.len();
    let mut free: Vec<f64> = q.iter().map(|v| -v).collect();
    factor.solve(&mut free);
    // H⁻¹ aᵢ, and the Schur complement aᵢᵀ H⁻¹ aⱼ
    let columns: Vec<Vec<f64>> = active
        .iter()
        .map(|&i| {
            let mut column = vec![0.0; q.len()];
            rows[i].entries.iter().for_each(|&(c, v)| column[c] += v);
            factor.solve(&mut column);
            column
        })
        .collect();
    let mut schur: Vec<f64> = active
        .iter()
        .flat_map(|&i| columns.iter().map(move |c| rows[i].value(c)))
        .collect();
    if !cholesky(&mut schur, m) {
        return None;
    }
    let mut y: Vec<f64> = active
        .iter()
        .map(|&i| rows[i].value(&free) - limit(i))
        .collect();
    cholesky_solve(&schur, m, &mut y);
    let mut x = free;
    for (column, y) in columns.iter().zip(&y) {
        x.iter_mut().zip(column).for_each(|(x, c)| *x -= y * c);
    }
    let signs = active.iter().zip(&y).all(|(&i, y)| y * rough.y[i] >= 0.0);
    let inside = rows.iter().all(|row| {
        let scale = 1.0 + row.lower.abs().min(row.upper.abs());
        crate::sqp::iterate::violation(row.value(&x), row.lower, row.upper)
            <= POLISH_TOLERANCE * scale
    });
    let mut all = vec![0.0; rows.len()];
    active.iter().zip(&y).for_each(|(&i, y)| all[i] = *y);
    (signs && inside).then_some(ConvexSolution {
        x,
        y: all,
        violation: 0.0,
    })
}
