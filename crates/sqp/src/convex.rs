//! Convex quadratic programs with two-sided rows, solved by clarabel (Goulart & Chen, *Clarabel: an
//! interior-point solver for conic programs with quadratic objectives*, 2024).

use super::QpFailure;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus,
    SupportedConeT, ZeroConeT,
};

/// Tolerance on gap and feasibility: two orders of magnitude below that of the SQP.
const TOLERANCE: f64 = 1e-10;

/// `min ½ xᵀPx + qᵀx` subject to `lower ≤ A x ≤ upper`; rows with `lower == upper` are equalities.
#[derive(Debug, Clone, Default)]
pub struct ConvexQp {
    /// Upper triangle of `P`, triplets `(row, column, value)`; duplicates add.
    pub p: Vec<(usize, usize, f64)>,
    /// Linear term; its length is the number of variables.
    pub q: Vec<f64>,
    /// `A`, triplets `(row, column, value)`; duplicates add.
    pub a: Vec<(usize, usize, f64)>,
    /// Lower limits of the rows, infinite if there is none.
    pub lower: Vec<f64>,
    /// Upper limits of the rows, infinite if there is none.
    pub upper: Vec<f64>,
}

/// Solution of a [`ConvexQp`].
#[derive(Debug, Clone)]
pub struct ConvexSolution {
    /// Variables.
    pub x: Vec<f64>,
    /// Multiplier of each row, positive at the upper and negative at the lower limit.
    pub y: Vec<f64>,
    /// ℓ1 violation of the rows; nonzero only if they were relaxed.
    pub violation: f64,
}

/// The row and side that correspond to a row of clarabel's `A x + s = b`.
#[derive(Clone, Copy)]
struct Side {
    row: usize,
    sign: f64,
    limit: f64,
}

impl ConvexQp {
    /// Solves the QP. With `relaxed = Some(γ)` every row may be violated at the cost γ per unit (ℓ1), so that
    /// inconsistent rows still give a step.
    pub fn solve(&self, relaxed: Option<f64>) -> Result<ConvexSolution, QpFailure> {
        let sides = self.sides();
        let n_slack = if relaxed.is_some() {
            self.lower.len()
        } else {
            0
        };
        let n = self.q.len();
        let n_zero = sides.iter().take_while(|s| s.sign == 0.0).count();
        let mut cones: Vec<SupportedConeT<f64>> =
            vec![ZeroConeT(n_zero), NonnegativeConeT(sides.len() - n_zero)];
        let mut b: Vec<f64> = sides.iter().map(|s| s.limit).collect();
        let mut entries = self.stacked(&sides);
        let mut q = self.q.clone();
        if let Some(cost) = relaxed {
            relax(
                &mut entries,
                &mut q,
                &mut b,
                &mut cones,
                &sides,
                n_slack,
                cost,
            );
        }
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .tol_gap_abs(TOLERANCE)
            .tol_gap_rel(TOLERANCE)
            .tol_feas(TOLERANCE)
            .build()
            .map_err(|_| QpFailure::NoSolution)?;
        let p = csc(q.len(), q.len(), &self.p);
        let a = csc(b.len(), q.len(), &entries);
        let mut solver = DefaultSolver::new(&p, &q, &a, &b, &cones, settings)
            .map_err(|_| QpFailure::NoSolution)?;
        solver.solve();
        match solver.solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => {}
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                return Err(QpFailure::Infeasible);
            }
            _ => return Err(QpFailure::NoSolution),
        }
        let mut y = vec![0.0; self.lower.len()];
        for (side, z) in sides.iter().zip(&solver.solution.z) {
            y[side.row] += if side.sign < 0.0 { -z } else { *z };
        }
        let x = solver.solution.x[..n].to_vec();
        let violation = if relaxed.is_some() {
            self.violation(&x)
        } else {
            0.0
        };
        Ok(ConvexSolution { x, y, violation })
    }

    /// Equalities first (sign 0), then the finite sides of the inequalities.
    fn sides(&self) -> Vec<Side> {
        let rows = || {
            self.lower
                .iter()
                .copied()
                .zip(self.upper.iter().copied())
                .enumerate()
        };
        let mut sides: Vec<Side> = rows()
            .filter(|(_, (l, u))| l == u)
            .map(|(row, (limit, _))| Side {
                row,
                sign: 0.0,
                limit,
            })
            .collect();
        for (row, (l, u)) in rows().filter(|(_, (l, u))| l != u) {
            if u.is_finite() {
                sides.push(Side {
                    row,
                    sign: 1.0,
                    limit: u,
                });
            }
            if l.is_finite() {
                sides.push(Side {
                    row,
                    sign: -1.0,
                    limit: -l,
                });
            }
        }
        sides
    }

    /// The triplets of `A`, with one copy of a row for each of its sides.
    fn stacked(&self, sides: &[Side]) -> Vec<(usize, usize, f64)> {
        let mut copies = vec![Vec::new(); self.lower.len()];
        for (k, side) in sides.iter().enumerate() {
            copies[side.row].push((k, if side.sign < 0.0 { -1.0 } else { 1.0 }));
        }
        let expand = |&(i, j, v): &(usize, usize, f64)| {
            copies[i].iter().map(move |&(k, sign)| (k, j, sign * v))
        };
        self.a.iter().flat_map(expand).collect()
    }

    fn violation(&self, x: &[f64]) -> f64 {
        let mut ax = vec![0.0; self.lower.len()];
        for &(i, j, v) in &self.a {
            ax[i] += v * x[j];
        }
        let outside = ax.iter().zip(self.lower.iter().zip(&self.upper));
        outside
            .map(|(v, (l, u))| super::iterate::violation(*v, *l, *u))
            .sum()
    }
}

/// Adds nonnegative slack variables at the given cost: two per equality row, and one per inequality row, shared by its
/// sides.
fn relax(
    entries: &mut Vec<(usize, usize, f64)>,
    q: &mut Vec<f64>,
    b: &mut Vec<f64>,
    cones: &mut Vec<SupportedConeT<f64>>,
    sides: &[Side],
    n_rows: usize,
    cost: f64,
) {
    let first = q.len();
    q.extend(std::iter::repeat_n(cost, 2 * n_rows));
    for (k, side) in sides.iter().enumerate() {
        entries.push((k, first + side.row, -1.0));
        if side.sign == 0.0 {
            entries.push((k, first + n_rows + side.row, 1.0));
        }
    }
    for slack in 0..2 * n_rows {
        entries.push((b.len(), first + slack, -1.0));
        b.push(0.0);
    }
    cones.push(NonnegativeConeT(2 * n_rows));
}

/// Compressed sparse columns from triplets; duplicates are summed.
pub fn csc(rows: usize, columns: usize, triplets: &[(usize, usize, f64)]) -> CscMatrix<f64> {
    let mut sorted = triplets.to_vec();
    sorted.sort_by_key(|&(i, j, _)| (j, i));
    sorted.dedup_by(|next, kept| {
        let same = (next.0, next.1) == (kept.0, kept.1);
        if same {
            kept.2 += next.2;
        }
        same
    });
    let mut start = vec![0; columns + 1];
    for &(_, j, _) in &sorted {
        start[j + 1] += 1;
    }
    for j in 0..columns {
        start[j + 1] += start[j];
    }
    let (index, value) = sorted.into_iter().map(|(i, _, v)| (i, v)).unzip();
    CscMatrix::new(rows, columns, start, index, value)
}
