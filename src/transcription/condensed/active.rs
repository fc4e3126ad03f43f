//! The reduced QP with inequalities: exchanges find the active set where they settle, clarabel where they
//! do not; the solution with that active set is exact.

use super::arrow::{Arrow, ArrowFactor};
use super::dense::{axpy, cholesky, cholesky_solve};
use crate::sqp::QpFailure;
use crate::sqp::convex::{ConvexQp, ConvexSolution};
use crate::sqp::iterate::violation;

/// Cost of violating a row when the rows are inconsistent, per unit.
const RELAXATION: f64 = 1e6;
/// Exchanges of active rows before clarabel is asked for them.
const MAX_EXCHANGES: usize = 12;
/// Rounding allowed to a polished solution.
const POLISH_TOLERANCE: f64 = 1e-10;

/// Which inequality a row stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowAt {
    /// The bounded signal of a run at a sample.
    Bounded { run: usize, sample: usize },
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

/// Minimises `½ ρᵀ H ρ + qᵀ ρ` within the rows; `guess` says which are active, as [`exchanged`].
pub fn solve(
    matrix: &Arrow,
    factor: &ArrowFactor,
    q: &[f64],
    rows: &[Row],
    guess: &[f64],
) -> Result<ConvexSolution, QpFailure> {
    if let Some(solution) = exchanged(factor, q, rows, guess) {
        return Ok(solution);
    }
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
        Ok(rough) => Ok(exchanged(factor, q, rows, &sides(rows, &rough)).unwrap_or(rough)),
        Err(QpFailure::Infeasible) => qp.solve(Some(RELAXATION)),
        Err(other) => Err(other),
    }
}

/// The side that a number's sign stands for; zero for zero.
pub fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}

/// The solution without rows.
pub fn free(factor: &ArrowFactor, q: &[f64]) -> ConvexSolution {
    let mut x: Vec<f64> = q.iter().map(|v| -v).collect();
    factor.solve(&mut x);
    ConvexSolution {
        x,
        y: Vec::new(),
        violation: 0.0,
    }
}

/// The side at which each row is active in an interior-point solution, as the sign of its multiplier;
/// zero where it is not.
fn sides(rows: &[Row], rough: &ConvexSolution) -> Vec<f64> {
    let side = |(row, y): (&Row, &f64)| {
        let limit = if *y > 0.0 { row.upper } else { row.lower };
        let active = y.abs() > (limit - row.value(&rough.x)).abs();
        if active { y.signum() } else { 0.0 }
    };
    rows.iter().zip(&rough.y).map(side).collect()
}

/// The exact solution by exchanging active rows (primal-dual active set: Hintermüller, Ito & Kunisch,
/// SIAM J. Optim. 13, 2002): rows whose multiplier has the wrong sign leave, violated ones enter.
///
/// `guess` holds the side at which each row is active, +1 upper, -1 lower, 0 neither. None when the
/// exchange does not settle, or the active rows depend on each other.
pub fn exchanged(
    factor: &ArrowFactor,
    q: &[f64],
    rows: &[Row],
    guess: &[f64],
) -> Option<ConvexSolution> {
    let mut sides = guess.to_vec();
    for _ in 0..MAX_EXCHANGES {
        let solution = with_active(factor, q, rows, &sides)?;
        let mut settled = true;
        for ((row, side), y) in rows.iter().zip(&mut sides).zip(&solution.y) {
            let value = row.value(&solution.x);
            let scale = 1.0 + row.lower.abs().min(row.upper.abs());
            let next = match *side {
                0.0 if violation(value, row.lower, row.upper) <= POLISH_TOLERANCE * scale => 0.0,
                0.0 => (value - row.upper).max(0.0) - (row.lower - value).max(0.0),
                side if side * y < 0.0 => 0.0,
                side => side,
            };
            let next = sign(next);
            settled &= next == *side;
            *side = next;
        }
        if settled {
            return Some(solution);
        }
    }
    None
}

/// The solution with the rows active at these sides as equations.
fn with_active(
    factor: &ArrowFactor,
    q: &[f64],
    rows: &[Row],
    sides: &[f64],
) -> Option<ConvexSolution> {
    let mut solution = free(factor, q);
    let active: Vec<usize> = (0..rows.len()).filter(|&i| sides[i] != 0.0).collect();
    let limit = |i: usize| {
        if sides[i] > 0.0 {
            rows[i].upper
        } else {
            rows[i].lower
        }
    };
    // H⁻¹ aᵢ, and the Schur complement aᵢᵀ H⁻¹ aⱼ
    let columns: Vec<Vec<f64>> = active
        .iter()
        .map(|&i| factor.solved(&rows[i].entries, q.len()))
        .collect();
    let mut schur: Vec<f64> = active
        .iter()
        .flat_map(|&i| columns.iter().map(move |c| rows[i].value(c)))
        .collect();
    if !cholesky(&mut schur, active.len()) {
        return None;
    }
    let mut y: Vec<f64> = active
        .iter()
        .map(|&i| rows[i].value(&solution.x) - limit(i))
        .collect();
    cholesky_solve(&schur, active.len(), &mut y);
    for (column, y) in columns.iter().zip(&y) {
        axpy(-y, column, &mut solution.x);
    }
    solution.y = vec![0.0; rows.len()];
    active.iter().zip(&y).for_each(|(&i, y)| solution.y[i] = *y);
    Some(solution)
}
