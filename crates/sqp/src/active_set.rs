//! Exact solution of a strictly convex QP from a guess of its active set. One sparse factorisation and a few steps of
//! iterative refinement reach rounding accuracy, where an interior-point solver stops at its tolerance.

use super::QpFailure;
use super::convex::{ConvexSolution, csc};
use super::iterate::violation;
use clarabel::qdldl::QDLDLFactorisation;
use clarabel::qdldl::QDLDLSettingsBuilder;

/// Regularisation of the dual block, which makes dependent active rows harmless. Refinement removes its effect.
const DUAL_REGULARISATION: f64 = 1e-9;
/// Maximum number of steps of iterative refinement.
const REFINEMENTS: usize = 30;
/// Largest relative residual of an exact solution, and largest violation of an inactive row.
const TOLERANCE: f64 = 1e-10;
/// Maximum number of active-set revisions: rows of the wrong sign are dropped, violated ones added.
const ROUNDS: usize = 8;

/// Triplets `(row, column, value)`; duplicates add.
pub type Triplets = Vec<(usize, usize, f64)>;

/// A QP `min ½ xᵀWx + qᵀx` subject to `lower ≤ A x ≤ upper`, convex in the null space of `J`: its rows are the
/// equalities, which come first, and any other held rows. That is, `W + ρ JᵀJ` is positive definite.
#[derive(Debug, Clone, Default)]
pub struct EqualityConvexQp {
    /// Upper triangle of `W`.
    pub w: Triplets,
    /// Linear term.
    pub q: Vec<f64>,
    /// All rows, `J` first.
    pub a: Triplets,
    /// Lower limits.
    pub lower: Vec<f64>,
    /// Upper limits; equal to the lower ones at equalities.
    pub upper: Vec<f64>,
    /// Number of rows of `J`.
    pub equalities: usize,
    /// Limit at which each row is held in addition to the equalities; empty if none is held.
    pub held: Vec<Option<Limit>>,
    /// ρ.
    pub rho: f64,
}

/// The limit at which a row is active.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limit {
    /// The multiplier is at most zero.
    Lower,
    /// The multiplier is at least zero.
    Upper,
    /// Both limits are equal; the multiplier may have any sign.
    Both,
}

impl EqualityConvexQp {
    /// Upper triangle of `W + ρ JᵀJ`.
    fn convexified_matrix(&self) -> Triplets {
        let mut p = self.w.clone();
        if self.rho > 0.0 {
            let mut rows = vec![Vec::new(); self.equalities.max(self.held.len())];
            (self.jacobian()).for_each(|&(row, column, value)| rows[row].push((column, value)));
            for row in &rows {
                for &(i, a) in row {
                    let products = row.iter().filter(|(j, _)| i <= *j);
                    p.extend(products.map(|&(j, b)| (i, j, self.rho * a * b)));
                }
            }
        }
        p
    }

    /// True for the rows of `J`.
    fn holds(&self, row: usize) -> bool {
        row < self.equalities || self.held.get(row).is_some_and(|limit| limit.is_some())
    }

    /// The entries of `J`.
    fn jacobian(&self) -> impl Iterator<Item = &(usize, usize, f64)> {
        self.a.iter().filter(|(row, _, _)| self.holds(*row))
    }

    /// The value of a row at a limit.
    fn limit(&self, row: usize, limit: Limit) -> f64 {
        match limit {
            Limit::Lower | Limit::Both => self.lower[row],
            Limit::Upper => self.upper[row],
        }
    }

    /// True if the solution makes every held row active at its limit.
    pub fn keeps_held(&self, solution: &ConvexSolution) -> bool {
        let pairs = self.held.iter().zip(self.active(solution));
        let kept = |(held, active): (&Option<Limit>, _)| held.is_none() || *held == active;
        self.held.is_empty() || (solution.violation == 0.0 && pairs.into_iter().all(kept))
    }

    /// Upper triangle of `W + ρ JᵀJ`, and `q - ρ Jᵀb` with `J x = b` the held rows. This QP has the same solution and
    /// multipliers if the held rows are at their limits.
    pub fn convexified(&self) -> (Triplets, Vec<f64>) {
        let mut q = self.q.clone();
        for &(row, column, v) in self.jacobian() {
            let held = self.held.get(row).copied().flatten();
            q[column] -= self.rho * v * self.limit(row, held.unwrap_or(Limit::Both));
        }
        (self.convexified_matrix(), q)
    }

    /// True if `W + ρ JᵀJ` is numerically positive definite: all pivots of `LDLᵀ` are positive beyond rounding
    /// (Sylvester's law of inertia).
    pub fn is_convex(&self) -> bool {
        let n = self.q.len();
        let mut p = self.convexified_matrix();
        p.extend((0..n).map(|i| (i, i, 0.0)));
        let mut diagonal = vec![0.0; n];
        p.iter()
            .filter(|(i, j, _)| i == j)
            .for_each(|&(i, _, v)| diagonal[i] += v);
        let settings = QDLDLSettingsBuilder::default()
            .regularize_enable(false)
            .build();
        let factor = settings
            .ok()
            .and_then(|s| QDLDLFactorisation::new(&csc(n, n, &p), Some(s)).ok());
        factor.is_some_and(|factor| {
            let pivots = factor.D.iter().zip(&factor.perm);
            pivots
                .into_iter()
                .all(|(pivot, &i)| *pivot > 1e-16 * diagonal[i].abs())
        })
    }

    /// `A x`.
    pub fn rows(&self, x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.lower.len()];
        self.a.iter().for_each(|&(i, j, v)| out[i] += v * x[j]);
        out
    }

    /// `W x`.
    pub fn w_times(&self, x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; x.len()];
        for &(i, j, v) in &self.w {
            out[i] += v * x[j];
            if i != j {
                out[j] += v * x[i];
            }
        }
        out
    }

    /// The active rows of a solution: those whose multiplier is larger than the distance to the corresponding limit.
    pub fn active(&self, solution: &ConvexSolution) -> Vec<Option<Limit>> {
        let rows = self
            .rows(&solution.x)
            .into_iter()
            .zip(&solution.y)
            .enumerate();
        rows.map(|(i, (value, y))| match (self.lower[i], self.upper[i]) {
            (l, u) if l == u => Some(Limit::Both),
            (_, u) if *y > 0.0 && *y > (u - value).abs() => Some(Limit::Upper),
            (l, _) if *y < 0.0 && -*y > (value - l).abs() => Some(Limit::Lower),
            _ => None,
        })
        .collect()
    }

    /// The solution, from a guess of the active set that may be wrong in a few rows. None if no active set near it
    /// satisfies the optimality conditions.
    pub fn solve_near(&self, guess: &[Option<Limit>]) -> Option<ConvexSolution> {
        let mut active: Vec<Option<Limit>> = guess.to_vec();
        for (i, at) in active.iter_mut().enumerate() {
            if self.lower[i] == self.upper[i] {
                *at = Some(Limit::Both);
            }
        }
        for _ in 0..ROUNDS {
            let solution = self.solve_active(&active)?;
            if !self.revise(&solution, &mut active) {
                return Some(solution);
            }
        }
        None
    }

    /// Drops rows whose multiplier has the wrong sign and adds violated ones. Returns false if nothing changed.
    fn revise(&self, solution: &ConvexSolution, active: &mut [Option<Limit>]) -> bool {
        let mut changed = false;
        for (i, value) in self.rows(&solution.x).into_iter().enumerate() {
            let (l, u, y) = (self.lower[i], self.upper[i], solution.y[i]);
            let wrong = match active[i] {
                Some(Limit::Upper) => y < 0.0,
                Some(Limit::Lower) => y > 0.0,
                Some(Limit::Both) | None => false,
            };
            let scale = TOLERANCE * (1.0 + l.abs().min(u.abs()));
            if wrong {
                (active[i], changed) = (None, true);
            } else if active[i].is_none() && violation(value, l, u) > scale {
                active[i] = Some(if value > u {
                    Limit::Upper
                } else {
                    Limit::Lower
                });
                changed = true;
            }
        }
        changed
    }

    /// Solves `[W Aᵀ; A 0] [x; y] = [-q; b]` over the active rows. None if there is no solution.
    fn solve_active(&self, active: &[Option<Limit>]) -> Option<ConvexSolution> {
        let n = self.q.len();
        let mut place = vec![None; active.len()];
        let (mut limits, mut squared) = (Vec::new(), Vec::new());
        for (i, at) in active.iter().enumerate() {
            let Some(limit) = at else {
                if self.holds(i) {
                    return None;
                }
                continue;
            };
            place[i] = Some(n + limits.len());
            limits.push(self.limit(i, *limit));
            squared.push(self.holds(i));
        }
        let a: Triplets = (self.a.iter())
            .filter_map(|&(i, j, v)| place[i].map(|row| (row, j, v)))
            .collect();
        let mut system = Kkt::new(self, a, &limits, squared)?;
        let solution = system.solve()?;
        let y = place.iter().map(|at| at.map_or(0.0, |row| solution[row]));
        Some(ConvexSolution {
            y: y.collect(),
            x: solution[..n].to_vec(),
            violation: 0.0,
        })
    }
}

/// The KKT system of one active set.
struct Kkt<'a> {
    qp: &'a EqualityConvexQp,
    /// Active rows, numbered from `n`; the equalities come first.
    a: Triplets,
    /// True for the active rows that belong to `J`.
    squared: Vec<bool>,
    right: Vec<f64>,
    factor: QDLDLFactorisation<f64>,
}

impl<'a> Kkt<'a> {
    fn new(
        qp: &'a EqualityConvexQp,
        a: Triplets,
        limits: &[f64],
        squared: Vec<bool>,
    ) -> Option<Self> {
        let (n, m) = (qp.q.len(), limits.len());
        let mut matrix = qp.convexified_matrix();
        matrix.extend((0..n).map(|i| (i, i, 0.0)));
        matrix.extend(a.iter().map(|&(row, column, v)| (column, row, v)));
        matrix.extend((n..n + m).map(|i| (i, i, -DUAL_REGULARISATION)));
        let signs = [vec![1; n], vec![-1; m]].concat();
        let settings = QDLDLSettingsBuilder::default().Dsigns(signs).build().ok()?;
        Some(Self {
            factor: QDLDLFactorisation::new(&csc(n + m, n + m, &matrix), Some(settings)).ok()?,
            right: qp
                .q
                .iter()
                .map(|q| -q)
                .chain(limits.iter().copied())
                .collect(),
            a,
            squared,
            qp,
        })
    }

    /// Iterative refinement from zero, as long as each step halves the residual.
    fn solve(&mut self) -> Option<Vec<f64>> {
        let mut solution = vec![0.0; self.right.len()];
        let mut residual = self.right.clone();
        let mut best = f64::INFINITY;
        for _ in 0..REFINEMENTS {
            let mut change = self.weighted(&residual);
            self.factor.solve(&mut change);
            let next: Vec<f64> = solution.iter().zip(&change).map(|(s, c)| s + c).collect();
            let left = self.times(&next);
            let remaining: Vec<f64> = self.right.iter().zip(&left).map(|(r, l)| r - l).collect();
            let size = max_abs(&remaining);
            if size.is_nan() || size >= best {
                break;
            }
            let slow = size > 0.5 * best;
            (solution, residual, best) = (next, remaining, size);
            if slow {
                break;
            }
        }
        (best <= TOLERANCE * (1.0 + max_abs(&self.right) + max_abs(&solution))).then_some(solution)
    }

    /// The right-hand side for the convexified matrix: its upper part is `r₁ + ρ Jᵀ r₂`.
    fn weighted(&self, residual: &[f64]) -> Vec<f64> {
        let mut out = residual.to_vec();
        let n = self.qp.q.len();
        for &(row, column, v) in self.a.iter().filter(|(row, ..)| self.squared[row - n]) {
            out[column] += self.qp.rho * v * residual[row];
        }
        out
    }

    fn times(&self, solution: &[f64]) -> Vec<f64> {
        let n = self.qp.q.len();
        let mut out = self.qp.w_times(&solution[..n]);
        out.resize(solution.len(), 0.0);
        for &(row, column, v) in &self.a {
            out[row] += v * solution[column];
            out[column] += v * solution[row];
        }
        out
    }
}

fn max_abs(v: &[f64]) -> f64 {
    v.iter().fold(
        0.0,
        |m, x| if x.is_nan() { f64::NAN } else { x.abs().max(m) },
    )
}

/// Sets ρ to the first weight that makes the QP convex. Fails if even the largest does not.
pub fn require_convex(qp: &mut EqualityConvexQp, weights: &[f64]) -> Result<(), QpFailure> {
    for &rho in weights {
        qp.rho = rho;
        if qp.is_convex() {
            return Ok(());
        }
    }
    Err(QpFailure::NotConvex)
}
