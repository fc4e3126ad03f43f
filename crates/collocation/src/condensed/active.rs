//! The reduced QP with inequalities: exchanges find the active set where they settle, else a dual method;
//! clarabel where the rows are inconsistent. The solution with that active set is exact.

use super::arrow::{Arrow, ArrowFactor};
use super::dense::{axpy, cholesky_solve, independent_cholesky};
use super::dual;
use pilotage_sqp::QpFailure;
use pilotage_sqp::convex::{ConvexQp, ConvexSolution};
use pilotage_sqp::iterate::violation;

/// Cost of violating a row when the rows are inconsistent, per unit.
const RELAXATION: f64 = 1e6;
/// Exchanges of active rows before another method is asked for them.
const MAX_EXCHANGES: usize = 12;
/// Rounding allowed to a polished solution.
const POLISH_TOLERANCE: f64 = 1e-10;

/// Ladder of multiples of `aaᵀ`, relative to [`Row::weight`].
const CONVEXIFICATION: [f64; 4] = [1.0, 1e2, 1e4, 1e6];

/// Which inequality a row stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RowAt {
    /// An inequality of a run: a bounded output at a sample.
    Bounded { run: usize, row: usize },
    /// A constraint on θ.
    Parameter(usize),
}

impl RowAt {
    /// The run whose free initial states the row has entries for, beside the parameters.
    pub fn run(self) -> Option<usize> {
        match self {
            Self::Bounded { run, .. } => Some(run),
            Self::Parameter(_) => None,
        }
    }

    /// The constraint on the parameters that it is.
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
    /// The limit at a side, +1 upper, -1 lower.
    pub fn limit(&self, side: f64) -> f64 {
        if side > 0.0 { self.upper } else { self.lower }
    }

    /// Multiple of `aaᵀ` that is as large as the matrix with this diagonal is along `a`.
    fn weight(&self, diagonal: &[f64]) -> f64 {
        let along = self.entries.iter().map(|&(i, v)| v * v * diagonal[i].abs());
        let squares: f64 = self.entries.iter().map(|(_, v)| v * v).sum();
        along.sum::<f64>() / (squares * squares).max(f64::MIN_POSITIVE)
    }

    /// True where both limits are one: the multiplier may have any sign.
    pub fn is_equation(&self) -> bool {
        self.lower == self.upper
    }

    /// How far a value of the row lies above its upper limit, or, negative, below its lower one: zero within
    /// rounding.
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

/// A reduced Hessian that is convex, if need be by multiples of `aaᵀ` for rows `a` that are active: where
/// they are so in the solution too, that changes neither it nor the multipliers, and for multiples large
/// enough the whole matrix is positive definite exactly when it is so in the rows' null space (Finsler;
/// Nocedal & Wright, 2nd ed., section 17.3).
#[derive(Debug, Clone)]
pub struct Convex {
    /// With the multiples.
    pub matrix: Arrow,
    /// Its factors.
    pub factor: ArrowFactor,
    /// Multiple for each of the first rows.
    weights: Vec<f64>,
}

impl Convex {
    /// A matrix that is convex itself.
    pub fn new(matrix: Arrow, factor: ArrowFactor) -> Self {
        let weights = Vec::new();
        Self {
            matrix,
            factor,
            weights,
        }
    }

    /// A matrix that is convex in the null space of the rows. None where it is not.
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

    /// True when it is so only where rows are active.
    pub fn holds(&self) -> bool {
        !self.weights.is_empty()
    }

    /// The linear term that goes with the multiples, for the rows at these sides.
    pub fn shift(&self, rows: &[Row], sides: &[f64], q: &mut [f64]) {
        for ((row, side), weight) in rows.iter().zip(sides).zip(&self.weights) {
            let pull = weight * row.limit(*side);
            row.entries.iter().for_each(|&(i, v)| q[i] -= pull * v);
        }
    }
}

/// True when the first rows are active at these sides.
pub fn held(rows: &[Row], sides: &[f64], solution: &ConvexSolution) -> bool {
    let mut first = rows.iter().zip(sides).zip(&solution.y);
    solution.violation == 0.0 && first.all(|((row, side), y)| row.is_equation() || side * y > 0.0)
}

/// Minimises `½ ρᵀ H ρ + qᵀ ρ` within the rows; `guess` says which are active, as [`exchanged`].
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

/// The exact solution near an interior-point one; that one where it is not found, without the multipliers
/// of rows that are not active.
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
        let active = y.abs() > (row.limit(*y) - row.value(&rough.x)).abs();
        if active { y.signum() } else { 0.0 }
    };
    rows.iter().zip(&rough.y).map(side).collect()
}

/// The exact solution by exchanging active rows (primal-dual active set: Hintermüller, Ito & Kunisch,
/// SIAM J. Optim. 13, 2002): rows whose multiplier has the wrong sign leave, violated ones enter.
///
/// `guess` holds the side at which each row is active, +1 upper, -1 lower, 0 neither. None when the
/// exchange does not settle.
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

/// The solution with the rows active at these sides as equations. Rows that depend on others, as where two
/// runs are the same, are left out: their sides become zero.
fn with_active(factor: &ArrowFactor, q: &[f64], rows: &[Row], sides: &mut [f64]) -> ConvexSolution {
    let mut solution = free(factor, q);
    let all: Vec<usize> = (0..rows.len()).filter(|&i| sides[i] != 0.0).collect();
    // H⁻¹ aᵢ
    let columns: Vec<Vec<f64>> = all
        .iter()
        .map(|&i| factor.solved(&rows[i].entries, q.len()))
        .collect();
    // Of the Schur complement aᵢᵀ H⁻¹ aⱼ
    let (kept, schur) = independent_cholesky(all.len(), |i, j| rows[all[i]].value(&columns[j]));
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

    /// Nothing is above 1 with parts below 1/4 and 1/2: the row that costs least is violated, by 1/4.
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

    /// Three runs that are the same have the same row.
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
        // Not along the other row, and not where the row is left: with y's pull turned round.
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
