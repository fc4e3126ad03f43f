//! The QP of any [`SparseProblem`], in all its variables.
//!
//! The exact Hessian `W` need only be convex in the null space of the linearised equalities. Adding `ρ JᵀJ` to it and
//! `ρ Jᵀc` to the gradient changes neither the solution nor the multipliers, since `J d + c = 0` there. For ρ large
//! enough the whole matrix is positive definite exactly if `W` is positive definite in that null space (Finsler;
//! Nocedal & Wright, 2nd ed., section 17.3). If it is not, the inequalities that were active in the last QP join `J`;
//! the solution is valid if they are active in it too. The active set of the last QP is tried first; if it does not
//! fit, clarabel finds the right one, and one exact solve refines the solution.

use super::active_set::{EqualityConvexQp, Limit, Triplets, require_convex};
use super::convex::{ConvexQp, ConvexSolution};
use super::curvature::{Cone, Curvature, MAX_SIZE, activities, null_space};
use super::iterate::violation;
use super::problem::Pattern;
use super::{Hessian, Iterate, QpFailure, QpSolver, SparseProblem, Step, vector};
use nalgebra::{DMatrix, DVector};

/// Values of ρ to try, relative to the largest entry of the Hessian.
const CONVEXIFICATION: [f64; 6] = [0.0, 1.0, 1e2, 1e4, 1e6, 1e8];
/// Cost of violating a row by one unit, relative to the gradient of the objective. A QP with multipliers below it has
/// the same solution with and without relaxation; a larger multiplier indicates (almost) inconsistent rows.
const RELAXATION: f64 = 1e4;

/// Workspace of the general QP solver.
#[derive(Debug, Clone, Default)]
pub struct SparseQp {
    gradient: Vec<f64>,
    lagrangian: Vec<f64>,
    exact: Option<Triplets>,
    gauss_newton: Triplets,
    /// Jacobians of `c` and, in the rows after it, of `g`.
    jacobian: Triplets,
    /// Constraint values at the iterate.
    c: Vec<f64>,
    g: Vec<f64>,
    /// The QP of the last [`solve`](QpSolver::solve).
    qp: EqualityConvexQp,
    /// Active set of the last QP.
    working: Vec<Option<Limit>>,
}

/// Triplets of a pattern and its values, without zeros.
fn triplets(pattern: &Pattern, values: &[f64], first_row: usize) -> Triplets {
    let entries = pattern.iter().zip(values).filter(|(_, v)| **v != 0.0);
    entries.map(|(&(i, j), &v)| (first_row + i, j, v)).collect()
}

impl<P: SparseProblem + ?Sized> QpSolver<P> for SparseQp {
    fn linearise(&mut self, problem: &P, at: &Iterate, exact: bool) {
        self.c.clone_from(&at.c);
        self.g.clone_from(&at.g);
        self.gradient.resize(at.z.len(), 0.0);
        problem.gradient(&at.z, &mut self.gradient);
        let patterns = (problem.equality_pattern(), problem.inequality_pattern());
        let (mut c, mut g) = (vec![0.0; patterns.0.len()], vec![0.0; patterns.1.len()]);
        problem.jacobians(&at.z, &mut c, &mut g);
        self.jacobian = triplets(&patterns.0, &c, 0);
        self.jacobian.extend(triplets(&patterns.1, &g, at.c.len()));
        let multipliers = [at.lambda.as_slice(), &at.eta].concat();
        self.lagrangian.clone_from(&self.gradient);
        self.jacobian
            .iter()
            .for_each(|&(i, j, v)| self.lagrangian[j] += v * multipliers[i]);
        let pattern = problem.hessian_pattern();
        let mut values = vec![0.0; pattern.len()];
        let mut hessian = |kind| {
            problem.hessian(&at.z, &at.lambda, &at.eta, kind, &mut values);
            triplets(&pattern, &values, 0)
        };
        self.gauss_newton = hessian(Hessian::GaussNewton);
        self.exact = exact.then(|| hessian(Hessian::Exact));
    }

    fn lagrangian_gradient(&self) -> &[f64] {
        &self.lagrangian
    }

    fn solve(
        &mut self,
        problem: &P,
        hessian: Hessian,
        damping: f64,
        step: &mut Step,
    ) -> Result<(), QpFailure> {
        let mut w = match hessian {
            Hessian::Exact => self.exact.clone().ok_or(QpFailure::NotConvex)?,
            Hessian::GaussNewton => self.gauss_newton.clone(),
        };
        w.extend(
            problem
                .damping_weights()
                .iter()
                .enumerate()
                .map(|(i, d)| (i, i, damping * d)),
        );
        let largest = w.iter().fold(1.0_f64, |m, (_, _, v)| m.max(v.abs()));
        self.qp = EqualityConvexQp {
            w,
            q: self.gradient.clone(),
            a: self.jacobian.clone(),
            equalities: self.c.len(),
            ..EqualityConvexQp::default()
        };
        let steps = if self.c.is_empty() {
            1
        } else {
            CONVEXIFICATION.len()
        };
        let ladder: Vec<f64> = CONVEXIFICATION[..steps]
            .iter()
            .map(|r| r * largest)
            .collect();
        if require_convex(&mut self.qp, &ladder).is_err() {
            // It may be convex in the null space of the active inequalities.
            let ladder: Vec<f64> = CONVEXIFICATION.iter().map(|r| r * largest).collect();
            self.qp.held = self.working.clone();
            require_convex(&mut self.qp, &ladder)?;
        }
        let (c, g) = (self.c.clone(), self.g.clone());
        self.solve_at(problem.limits(), &c, &g, step)
    }

    fn correct(&mut self, problem: &P, trial: &Iterate, d: &mut [f64]) -> Result<(), QpFailure> {
        let m = trial.c.len();
        if m == 0 {
            return Ok(());
        }
        let weights = problem.damping_weights().iter().enumerate();
        let limits: Vec<f64> = trial.c.iter().map(|c| -c).collect();
        let mut least = EqualityConvexQp {
            w: weights.map(|(i, w)| (i, i, *w)).collect(),
            q: vec![0.0; d.len()],
            a: (self.jacobian.iter().copied())
                .filter(|(row, ..)| *row < m)
                .collect(),
            lower: limits.clone(),
            upper: limits,
            equalities: m,
            ..EqualityConvexQp::default()
        };
        require_convex(&mut least, &CONVEXIFICATION)?;
        let solution = least
            .solve_near(&vec![None; m])
            .ok_or(QpFailure::NoSolution)?;
        d.iter_mut().zip(&solution.x).for_each(|(d, x)| *d += x);
        Ok(())
    }

    fn curvature(&mut self, problem: &P, at: &Iterate) -> Option<Curvature> {
        let n = at.z.len();
        let w = self.exact.as_ref().filter(|_| n <= MAX_SIZE)?;
        let mut hessian = DMatrix::zeros(n, n);
        for &(i, j, v) in w {
            hessian[(i, j)] += v;
            if i != j {
                hessian[(j, i)] += v;
            }
        }
        let mut rows = vec![DVector::zeros(n); at.c.len() + at.g.len()];
        (self.jacobian.iter()).for_each(|&(i, j, v)| rows[i][j] += v);
        let inequalities = rows.split_off(at.c.len());
        let basis = tangents(&rows, problem.damping_weights());
        let mut cone = Cone::default();
        for (row, activity) in inequalities.iter().zip(activities(problem, at)) {
            cone.add(activity, basis.tr_mul(row));
        }
        let mut found = cone.smallest(&basis.tr_mul(&(hessian * &basis)))?;
        if !found.direction.is_empty() {
            let direction = basis * DVector::from_vec(found.direction);
            found.direction = direction.as_slice().to_vec();
        }
        Some(found)
    }
}

/// A basis of the tangent space of the equalities, as columns: over the free variables of the equalities if the weights
/// identify them, otherwise orthonormal.
fn tangents(equalities: &[DVector<f64>], weights: &[f64]) -> DMatrix<f64> {
    let basis = null_space(equalities, weights.len());
    let free: Vec<usize> = (0..weights.len()).filter(|&i| weights[i] > 0.0).collect();
    let inverse = match free.len() == basis.ncols() {
        true => basis.select_rows(&free).try_inverse(),
        false => None,
    };
    match inverse {
        Some(inverse) => basis * inverse,
        None => basis,
    }
}

impl SparseQp {
    /// Solves the last QP with the constraint values `c` and `g`.
    fn solve_at(
        &mut self,
        (lower, upper): (&[f64], &[f64]),
        c: &[f64],
        g: &[f64],
        step: &mut Step,
    ) -> Result<(), QpFailure> {
        let limits = |limits: &[f64]| -> Vec<f64> {
            let inequalities = limits.iter().zip(g).map(|(limit, g)| limit - g);
            c.iter().map(|c| -c).chain(inequalities).collect()
        };
        (self.qp.lower, self.qp.upper) = (limits(lower), limits(upper));
        self.working.resize(c.len() + g.len(), None);
        let steepest = self.gradient.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
        let cost = RELAXATION * steepest;
        let strict = match self.qp.solve_near(&self.working) {
            Some(solution) => Ok(solution),
            None => self.solve_convex(None),
        };
        let solution = match strict {
            Ok(solution) if solution.y.iter().all(|y| y.abs() <= cost) => solution,
            Ok(_) | Err(QpFailure::Infeasible) => self.solve_convex(Some(cost))?,
            Err(other) => return Err(other),
        };
        if !self.qp.keeps_held(&solution) {
            return Err(QpFailure::NotConvex);
        }
        self.working = self.qp.active(&solution);
        self.write_step(solution, step);
        Ok(())
    }

    /// Solves by clarabel, with an exact solve afterwards unless the rows are relaxed.
    fn solve_convex(&self, relaxed: Option<f64>) -> Result<ConvexSolution, QpFailure> {
        let equalities = self.qp.equalities;
        let (p, q) = self.qp.convexified();
        let qp = ConvexQp {
            p,
            q,
            a: self.qp.a.clone(),
            lower: self.qp.lower.clone(),
            upper: self.qp.upper.clone(),
        };
        let mut solution = qp.solve(relaxed)?;
        if relaxed.is_none()
            && let Some(polished) = self.qp.solve_near(&self.qp.active(&solution))
        {
            return Ok(polished);
        }
        // The multipliers of the QP without ρ: λ = λ' + ρ (J d + c).
        for &(i, j, v) in self.qp.a.iter().filter(|(i, _, _)| *i < equalities) {
            solution.y[i] += self.qp.rho * v * solution.x[j];
        }
        for (y, c) in solution.y[..equalities].iter_mut().zip(&self.qp.lower) {
            *y -= self.qp.rho * c;
        }
        Ok(solution)
    }

    fn write_step(&self, solution: ConvexSolution, step: &mut Step) {
        let wd = self.qp.w_times(&solution.x);
        step.slope = vector::dot(&self.gradient, &solution.x);
        step.curvature = wd.iter().zip(&solution.x).map(|(w, d)| w * d).sum();
        let m = self.c.len();
        step.residual.clear();
        step.violation = 0.0;
        if solution.violation > 0.0 {
            let rows = self.qp.rows(&solution.x);
            let limits = self.qp.lower[m..].iter().zip(&self.qp.upper[m..]);
            let outside = rows[m..].iter().zip(limits);
            step.violation = outside.map(|(row, (l, u))| violation(*row, *l, *u)).sum();
            step.residual = rows[..m]
                .iter()
                .zip(&self.qp.lower)
                .map(|(row, c)| row - c)
                .collect();
        }
        step.active = self.working[self.c.len()..].iter().flatten().count();
        step.eta = solution.y[self.c.len()..].to_vec();
        step.lambda = solution.y[..self.c.len()].to_vec();
        step.d = solution.x;
    }
}
