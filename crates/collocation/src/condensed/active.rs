//! The reduced QP with inequalities. Exchanges of active rows find the active set if they settle, otherwise a dual
//! method does; clarabel is used for inconsistent rows. The solution for the active set is exact.

use super::arrow::{Arrow, ArrowFactor};
use super::dense::{RANK, axpy, cholesky_solve, independent_cholesky};
use super::dual;
use pilotage_sqp::QpFailure;
use pilotage_sqp::convex::{ConvexQp, ConvexSolution};
use pilotage_sqp::iterate::violation;

/// Cost of violating an inconsistent row, per unit.
const RELAXATION: f64 = 1e6;
/// Maximum number of exchanges of active rows before another method is used.
const MAX_EXCHANGES: usize = 12;
/// Permitted rounding error of a polished solution.
const POLISH_TOLERANCE: f64 = 1e-10;

/// Multiples of `aaᵀ` to try, relative to [`Row::weight`].
const CONVEXIFICATION: [f64; 4] = [1.0, 1e2, 1e4, 1e6];

/// The inequality that a row represents.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RowAt {
    /// An inequality of a run: a bounded output at a sample.
    Bounded { run: usize, row: usize },
    /// A constraint on θ.
    Parameter(usize),
}

impl RowAt {
    /// The run whose free initial states the row depends on, in addition to the parameters.
    pub fn run(self) -> Option<usize> {
        match self {
            Self::Bounded { run, .. } => Some(run),
            Self::Parameter(_) => None,
        }
    }

    /// Index of the constraint on the parameters, if it is one.
    pub fn parameter(self) -> Option<usize> {
        match self {
            Self::Bounded { .. } => None,
            Self::Parameter(k) => Some(k),
        }
    }
}

/// `lower ≤ Σ entries · ρ ≤ upper`.
#[derive(Debug, Clone)]
pub struct Row {
    /// The inequality that the row represents.
    pub at: RowAt,
    /// Index in `g`.
    pub index: usize,
    /// Pairs of column and coefficient.
    pub entries: Vec<(usize, f64)>,
    /// Lower limit of the linear part.
    pub lower: f64,
    /// Upper limit of the linear part.
    pub upper: f64,
}

impl Row {
    /// The limit at a side: +1 upper, -1 lower.
    pub fn limit(&self, side: f64) -> f64 {
        if side > 0.0 { self.upper } else { self.lower }
    }

    /// Multiple of `aaᵀ` whose curvature along `a` equals that of a matrix with this diagonal.
    fn weight(&self, diagonal: &[f64]) -> f64 {
        let along = self.entries.iter().map(|&(i, v)| v * v * diagonal[i].abs());
        let squares: f64 = self.entries.iter().map(|(_, v)| v * v).sum();
        along.sum::<f64>() / (squares * squares).max(f64::MIN_POSITIVE)
    }

    /// True if both limits are equal; the multiplier may then have any sign.
    pub fn is_equation(&self) -> bool {
        self.lower == self.upper
    }

    /// Distance of a value above the upper limit, or, negative, below the lower one; zero within rounding.
    pub fn excess(&self, value: f64) -> f64 {
        let scale = 1.0 + self.lower.abs().min(self.upper.abs());
        match violation(value, self.lower, self.upper) <= POLISH_TOLERANCE * scale {
            true => 0.0,
            false => (value - self.upper).max(0.0) - (self.lower - value).max(0.0),
        }
    }

    /// The row's value.
    pub fn value(&self, x: &[f64]) -> f64 {
        self.entries.iter().map(|(column, v)| v * x[*column]).sum()
    }
}

/// A convex reduced Hessian, if necessary made convex by multiples of `aaᵀ` for active rows `a`. If these rows are
/// active in the solution too, that changes neither it nor the multipliers. For multiples large enough the whole matrix
/// is positive definite exactly if it is so in the null space of the rows (Finsler; Nocedal & Wright, 2nd ed., section
/// 17.3).
#[derive(Debug, Clone)]
pub struct Convex {
    /// The matrix including the multiples.
    pub matrix: Arrow,
    /// Its Cholesky factors.
    pub factor: ArrowFactor,
    /// Multiple for each of the first rows.
    weights: Vec<f64>,
}

impl Convex {
    /// From a convex matrix.
    pub fn new(matrix: Arrow, factor: ArrowFactor) -> Self {
        let weights = Vec::new();
        Self {
            matrix,
            factor,
            weights,
        }
    }

    /// From a matrix that is convex in the null space of the rows. None if it is not.
    pub fn held(matrix: Arrow, rows: &[Row]) -> Option<Self> {
        let diagonal = matrix.diagonal();
        CONVEXIFICATION.iter().find_map(|relative| {
            let mut matrix = matrix.clone();
            let weights = rows.iter().map(|row| relative * row.weight(&diagonal));
            let weights: Vec<f64> = weights.collect();
            for (row, weight) in rows.iter().zip(&weights) {
                matrix.add_square(row.at.run(), &row.entries, *weight);
            }
            let factor = matrix.factor()?;
            Some(Self {
                matrix,
                factor,
                weights,
            })
        })
    }

    /// True if the matrix is only convex where rows are active.
    pub fn holds(&self) -> bool {
        !self.weights.is_empty()
    }

    /// Adds the linear term that belongs to the multiples, for rows active at these sides.
    pub fn shift(&self, rows: &[Row], sides: &[f64], q: &mut [f64]) {
        for ((row, side), weight) in rows.iter().zip(sides).zip(&self.weights) {
            let pull = weight * row.limit(*side);
            row.entries.iter().for_each(|&(i, v)| q[i] -= pull * v);
        }
    }
}

/// True if the first rows are active at these sides.
pub fn held(rows: &[Row], sides: &[f64], solution: &ConvexSolution) -> bool {
    let mut first = rows.iter().zip(sides).zip(&solution.y);
    solution.violation == 0.0 && first.all(|((row, side), y)| row.is_equation() || side * y > 0.0)
}

/// Minimises `½ ρᵀ H ρ + qᵀ ρ` subject to the rows; `guess` is the assumed active set, as in [`exchanged`].
pub fn solve(
    convex: &Convex,
    q: &[f64],
    rows: &[Row],
    guess: &[f64],
) -> Result<ConvexSolution, QpFailure> {
    let factor = &convex.factor;
    if let Some(solution) = exchanged(factor, q, rows, guess) {
        return Ok(solution);
    }
    let sides = dual::active_set(factor, q, rows);
    if let Ok(sides) = &sides
        && let Some(solution) = exchanged(factor, q, rows, sides)
    {
        return Ok(solution);
    }
    let qp = ConvexQp {
        p: convex.matrix.triplets(),
        q: q.to_vec(),
        a: rows
            .iter()
            .enumerate()
            .flat_map(|(i, row)| row.entries.iter().map(move |&(c, v)| (i, c, v)))
            .collect(),
        lower: rows.iter().map(|row| row.lower).collect(),
        upper: rows.iter().map(|row| row.upper).collect(),
    };
    let rough = match sides {
        Err(QpFailure::Infeasible) => Err(QpFailure::Infeasible),
        _ => qp.solve(None),
    };
    match rough {
        Ok(rough) => Ok(polished(factor, q, rows, rough)),
        Err(QpFailure::Infeasible) => qp.solve(Some(RELAXATION)),
        Err(other) => Err(other),
    }
}

/// The exact solution near an interior-point one. If it is not found, the interior-point solution without the
/// multipliers of inactive rows.
fn polished(
    factor: &ArrowFactor,
    q: &[f64],
    rows: &[Row],
    mut rough: ConvexSolution,
) -> ConvexSolution {
    let sides = sides(rows, &rough);
    if let Some(solution) = exchanged(factor, q, rows, &sides) {
        return solution;
    }
    let inactive = rough.y.iter_mut().zip(&sides).filter(|(_, s)| **s == 0.0);
    inactive.for_each(|(y, _)| *y = 0.0);
    rough
}

/// Sign of a value; zero for zero.
pub fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}

/// The unconstrained solution.
pub fn free(factor: &ArrowFactor, q: &[f64]) -> ConvexSolution {
    let mut x: Vec<f64> = q.iter().map(|v| -v).collect();
    factor.solve(&mut x);
    ConvexSolution {
        x,
        y: Vec::new(),
        violation: 0.0,
    }
}

/// The side at which each row is active in an interior-point solution, as the sign of its multiplier; zero for inactive
/// rows.
fn sides(rows: &[Row], rough: &ConvexSolution) -> Vec<f64> {
    let side = |(row, y): (&Row, &f64)| {
        let active = y.abs() > (row.limit(*y) - row.value(&rough.x)).abs();
        if active { y.signum() } else { 0.0 }
    };
    rows.iter().zip(&rough.y).map(side).collect()
}

/// The exact solution by exchanging active rows (primal-dual active set: Hintermüller, Ito & Kunisch,
/// SIAM J. Optim. 13, 2002): rows whose multiplier has the wrong sign leave, violated ones enter.
///
/// `guess` holds the side at which each row is active: +1 upper, -1 lower, 0 neither. None if the exchanges do not
/// settle.
pub fn exchanged(
    factor: &ArrowFactor,
    q: &[f64],
    rows: &[Row],
    guess: &[f64],
) -> Option<ConvexSolution> {
    let mut sides = guess.to_vec();
    for _ in 0..MAX_EXCHANGES {
        let solution = with_active(factor, q, rows, &mut sides);
        let mut settled = true;
        for ((row, side), y) in rows.iter().zip(&mut sides).zip(&solution.y) {
            let next = match *side {
                0.0 => row.excess(row.value(&solution.x)),
                side if side * y < 0.0 && !row.is_equation() => 0.0,
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

/// The solution with the rows active at these sides as equations. Linearly dependent rows, as of two identical runs,
/// are dropped: their sides become zero.
fn with_active(factor: &ArrowFactor, q: &[f64], rows: &[Row], sides: &mut [f64]) -> ConvexSolution {
    let mut solution = free(factor, q);
    let all: Vec<usize> = (0..rows.len()).filter(|&i| sides[i] != 0.0).collect();
    // H⁻¹ aᵢ
    let columns: Vec<Vec<f64>> = all
        .iter()
        .map(|&i| factor.solved(&rows[i].entries, q.len()))
        .collect();
    // Schur complement aᵢᵀ H⁻¹ aⱼ
    let (kept, schur) =
        independent_cholesky(all.len(), RANK, |i, j| rows[all[i]].value(&columns[j]));
    let outside = |k: &usize| {
        let (row, side) = (&rows[all[*k]], sides[all[*k]]);
        row.value(&solution.x) - row.limit(side)
    };
    let mut y: Vec<f64> = kept.iter().map(outside).collect();
    cholesky_solve(&schur, kept.len(), &mut y);
    solution.y = vec![0.0; rows.len()];
    for (&k, y) in kept.iter().zip(&y) {
        axpy(-y, &columns[k], &mut solution.x);
        solution.y[all[k]] = *y;
    }
    let dependent = (0..all.len()).filter(|k| kept.binary_search(k).is_err());
    dependent.for_each(|k| sides[all[k]] = 0.0);
    solution
}

#[cfg(test)]
pub mod tests {
    use super::*;

    pub fn row(entries: &[f64], lower: f64, upper: f64) -> Row {
        Row {
            at: RowAt::Parameter(0),
            index: 0,
            entries: entries.iter().copied().enumerate().collect(),
            lower,
            upper,
        }
    }

    pub fn matrix(diagonal: &[f64]) -> Arrow {
        let mut arrow = Arrow::zeros(diagonal.len(), &[]);
        let n = diagonal.len();
        diagonal
            .iter()
            .enumerate()
            .for_each(|(i, d)| arrow.theta[i * n + i] = *d);
        arrow
    }

    /// No point with a sum above 1 has parts below 1/4 and 1/2: the row with the least cost is violated, by 1/4.
    #[test]
    fn inconsistent_rows_are_violated_as_little_as_can_be() {
        let arrow = matrix(&[2.0, 4.0]);
        let convex = Convex::new(arrow.clone(), arrow.factor().unwrap());
        let rows = [
            row(&[1.0, 1.0], 1.0, INF),
            row(&[1.0, 0.0], -INF, 0.25),
            row(&[0.0, 1.0], -INF, 0.5),
        ];
        let solution = solve(&convex, &[0.0, 0.0], &rows, &[0.0; 3]).unwrap();
        assert!((solution.violation - 0.25).abs() < 1e-6, "{solution:?}");
        assert!((solution.x[0] - 0.25).abs() < 1e-3 && (solution.x[1] - 0.5).abs() < 1e-3);
    }

    /// Three identical runs have the same row.
    #[test]
    fn equal_rows_are_one() {
        let arrow = matrix(&[2.0, 4.0]);
        let factor = arrow.factor().unwrap();
        let rows = vec![row(&[1.0, 1.0], -INF, 0.5); 3];
        let solution = exchanged(&factor, &[-4.0, -4.0], &rows, &[1.0; 3]).unwrap();
        // min x² + 2y² - 4x - 4y on x + y = 1/2
        assert!((solution.x[0] - 1.0 / 3.0).abs() < 1e-14, "{solution:?}");
        assert!((solution.y.iter().sum::<f64>() - 10.0 / 3.0).abs() < 1e-14);
        assert_eq!(solution.y.iter().filter(|y| **y != 0.0).count(), 1);
    }

    /// min x² - y² - 2x - y where y ≤ 1 holds: x = 1, y = 1, multiplier 3.
    #[test]
    fn a_saddle_is_convex_on_its_limit() {
        let (arrow, sides) = (matrix(&[2.0, -2.0]), [1.0]);
        assert!(arrow.factor().is_none());
        let rows = [row(&[0.0, 1.0], -INF, 1.0)];
        let convex = Convex::held(arrow.clone(), &rows).unwrap();
        let mut q = [-2.0, -1.0];
        convex.shift(&rows, &sides, &mut q);
        let solution = solve(&convex, &q, &rows, &sides).unwrap();
        assert!((solution.x[0] - 1.0).abs() < 1e-14 && (solution.x[1] - 1.0).abs() < 1e-14);
        assert!((solution.y[0] - 3.0).abs() < 1e-13, "{solution:?}");
        assert!(held(&rows, &sides, &solution));
        // Not along the other row, and not if the row becomes inactive, with the linear term of y reversed.
        assert!(Convex::held(arrow, &[row(&[1.0, 0.0], -INF, 1.0)]).is_none());
        let mut q = [-2.0, 3.0];
        convex.shift(&rows, &sides, &mut q);
        assert!(!held(
            &rows,
            &sides,
            &solve(&convex, &q, &rows, &sides).unwrap()
        ));
    }

    pub const INF: f64 = f64::INFINITY;
}
