//! The QP of a collocation problem by elimination of its states: the fast path of the SQP.
//!
//! Forward, each run's defects give every node's step as `δX_k = S_k ρ + e_k`, with `ρ` the shared
//! parameters and the run's free initial states. What remains is a QP of a few dozen variables whose
//! Hessian is an arrowhead ([`arrow`]); of the inequalities only those that the step would violate
//! enter it, and clarabel solves it then. Backward, an adjoint sweep gives the multipliers of all
//! defects. The step and the multipliers are those of the full QP: same iterates as
//! [`SparseQp`](crate::sqp::SparseQp), at a cost linear in the number of nodes.

mod active;
pub mod arrow;
mod curvature;
mod dense;
mod run;

use super::Collocation;
use super::constraints::ParameterConstraints;
use crate::sqp::convex::ConvexSolution;
use crate::sqp::{Curvature, Hessian, Iterate, Problem, QpFailure, QpSolver, Step};
use active::{Row, RowAt};
use arrow::Arrow;
use pilotage_models::Dynamics;
use run::RunSweep;

/// Tolerance on a linearised inequality before it enters the QP.
const ROW_TOLERANCE: f64 = 1e-12;
/// Limit on rounds of adding violated inequalities.
const MAX_ROUNDS: usize = 50;

/// Workspace of the condensed QP.
#[derive(Debug, Clone, Default)]
pub struct Condensed {
    runs: Vec<RunSweep>,
    gradient: Vec<f64>,
    lagrangian: Vec<f64>,
    /// Constraint values of the QP: those of the iterate, or moved by a correction.
    c: Vec<f64>,
    g: Vec<f64>,
    /// Constraint values of the iterate.
    c_iterate: Vec<f64>,
    g_iterate: Vec<f64>,
    last: Option<(Hessian, f64)>,
    /// Jacobian of the parameter constraints, one row each, and the Hessian of their sum with η.
    parameter_rows: Vec<Vec<f64>>,
    parameter_hessian: Vec<f64>,
    gauss_newton: Arrow,
    exact: Option<Arrow>,
    singular: bool,
    /// Active inequalities of the last QP, with the sign of their multiplier.
    working: Vec<(RowAt, f64)>,
}

impl<D: Dynamics, C: ParameterConstraints> QpSolver<Collocation<D, C>> for Condensed {
    fn linearise(&mut self, problem: &Collocation<D, C>, at: &Iterate, exact: bool) {
        self.prepare(problem);
        self.linearise_parameters(problem, at);
        self.c_iterate.clone_from(&at.c);
        self.g_iterate.clone_from(&at.g);
        self.last = None;
        self.singular = false;
        for (j, run) in self.runs.iter_mut().enumerate() {
            run.linearise(
                problem,
                j,
                at,
                exact,
                &mut self.gradient,
                &mut self.lagrangian,
            );
            self.singular |= !run.sweep_sensitivities(problem, j);
            for (i, (f, l)) in run
                .theta_gradient
                .iter()
                .zip(&run.theta_lagrangian)
                .enumerate()
            {
                self.gradient[problem.layout.theta + i] += f;
                self.lagrangian[problem.layout.theta + i] += l;
            }
        }
        self.gauss_newton = self.reduce(problem, Hessian::GaussNewton);
        self.exact = exact.then(|| self.reduce(problem, Hessian::Exact));
    }

    fn gradient(&self) -> &[f64] {
        &self.gradient
    }

    fn lagrangian_gradient(&self) -> &[f64] {
        &self.lagrangian
    }

    fn solve(
        &mut self,
        problem: &Collocation<D, C>,
        hessian: Hessian,
        damping: f64,
        step: &mut Step,
    ) -> Result<(), QpFailure> {
        self.c.clone_from(&self.c_iterate);
        self.g.clone_from(&self.g_iterate);
        self.solve_shifted(problem, hessian, damping, step)
    }

    fn correct(
        &mut self,
        problem: &Collocation<D, C>,
        trial: &Iterate,
        step: &mut Step,
    ) -> Result<(), QpFailure> {
        let (hessian, damping) = self.last.ok_or(QpFailure::NoSolution)?;
        // The equalities hold in the QP, so J d₀ = -c; for the inequalities J d₀ is their change.
        self.c.iter_mut().zip(&trial.c).for_each(|(c, t)| *c += t);
        let dtheta = &step.d[problem.layout.theta..];
        for (j, (run, at)) in self.runs.iter().zip(&problem.layout.runs).enumerate() {
            for b in 0..problem.runs[j].time.len() {
                let k = b * problem.scheme.unknown_nodes();
                let x = at.z + k * problem.n_states();
                let change = run.bounded_change(k, &step.d[x..x + problem.n_states()], dtheta);
                self.g[at.g + b] = trial.g[at.g + b] - change;
            }
        }
        for (i, row) in self.parameter_rows.iter().enumerate() {
            let at = problem.layout.parameter_constraints + i;
            self.g[at] = trial.g[at] - dense::dot(row, dtheta);
        }
        self.solve_shifted(problem, hessian, damping, step)
    }

    fn curvature(&mut self, problem: &Collocation<D, C>, at: &Iterate) -> Option<Curvature> {
        self.smallest_curvature(problem, at)
    }
}

impl Condensed {
    /// The QP with the constraint values in `c` and `g`.
    fn solve_shifted<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        problem: &Collocation<D, C>,
        hessian: Hessian,
        damping: f64,
        step: &mut Step,
    ) -> Result<(), QpFailure> {
        if self.singular {
            return Err(QpFailure::NoSolution);
        }
        self.last = Some((hessian, damping));
        let mut matrix = match hessian {
            Hessian::Exact => self.exact.clone().ok_or(QpFailure::NotConvex)?,
            Hessian::GaussNewton => self.gauss_newton.clone(),
        };
        matrix.add_diagonal(damping);
        let factor = matrix.factor().ok_or(QpFailure::NotConvex)?;
        for (j, run) in self.runs.iter_mut().enumerate() {
            run.sweep_offsets(problem, j, &self.c);
        }
        let mut q = vec![0.0; matrix.size()];
        self.each_local(&mut q, problem, |run, j, local| {
            run.reduce_vector(problem, j, hessian, local)
        });

        let (lower, upper) = problem.limits();
        let mut rows: Vec<Row> = self
            .working
            .iter()
            .map(|(at, _)| self.row(problem, *at, lower, upper))
            .collect();
        let guess: Vec<f64> = self.working.iter().map(|(_, side)| *side).collect();
        let mut solution = active::exact(&factor, &q, &rows, &guess).unwrap_or_else(|| {
            rows.clear();
            active::free(&factor, &q)
        });
        for _ in 0..MAX_ROUNDS {
            self.expand(problem, &solution.x);
            if solution.violation > 0.0 || !self.add_violated(problem, &solution.x, &mut rows) {
                break;
            }
            solution = active::solve(&matrix, &factor, &q, &rows)?;
        }
        let sides = rows.iter().zip(&solution.y).filter(|(_, y)| **y != 0.0);
        self.working = sides.map(|(row, y)| (row.at, y.signum())).collect();
        self.write_primal(problem, &solution.x, step);
        self.write_dual(problem, hessian, damping, &rows, &solution, step);
        Ok(())
    }

    /// Allocates the workspace at the first use.
    fn prepare<D: Dynamics, C: ParameterConstraints>(&mut self, problem: &Collocation<D, C>) {
        let variables = problem.layout.theta + problem.n_parameters();
        if self.runs.len() != problem.runs.len() || self.gradient.len() != variables {
            self.runs = (0..problem.runs.len())
                .map(|j| RunSweep::new(problem, j))
                .collect();
            self.gradient = vec![0.0; variables];
            self.lagrangian = vec![0.0; variables];
            self.working.clear();
        }
        self.gradient.fill(0.0);
        self.lagrangian.fill(0.0);
    }

    /// Jacobian and weighted Hessian of the constraints on θ, and their part of `∇L`.
    fn linearise_parameters<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        problem: &Collocation<D, C>,
        at: &Iterate,
    ) {
        let (p, theta) = (problem.n_parameters(), problem.theta(&at.z));
        let eta = &at.eta[problem.layout.parameter_constraints..];
        self.parameter_rows = vec![vec![0.0; p]; eta.len()];
        self.parameter_hessian = vec![0.0; p * p];
        for a in 0..p {
            for b in 0..p {
                let values = problem.constraint_derivatives(theta, a, b);
                for (i, (value, eta)) in values.iter().zip(eta).enumerate() {
                    self.parameter_rows[i][a] = value.eps1;
                    self.parameter_hessian[a * p + b] += eta * value.eps1eps2;
                }
            }
        }
        for (row, eta) in self.parameter_rows.iter().zip(eta) {
            dense::axpy(*eta, row, &mut self.lagrangian[problem.layout.theta..]);
        }
    }

    /// The reduced Hessian.
    fn reduce<D: Dynamics, C: ParameterConstraints>(
        &self,
        problem: &Collocation<D, C>,
        kind: Hessian,
    ) -> Arrow {
        let free: Vec<usize> = self.runs.iter().map(|run| run.free.len()).collect();
        let mut arrow = Arrow::zeros(problem.n_parameters(), &free);
        for (j, run) in self.runs.iter().enumerate() {
            let mut local = vec![0.0; run.r() * run.r()];
            run.reduce_matrix(problem, j, kind, &mut local);
            arrow.set_run(j, &local);
        }
        if kind == Hessian::Exact {
            dense::axpy(1.0, &self.parameter_hessian, &mut arrow.theta);
        }
        arrow
    }

    /// Calls `add` for each run with a local vector over `[θ; its free states]` and sums the results
    /// into the global one.
    fn each_local<D, C>(
        &self,
        global: &mut [f64],
        problem: &Collocation<D, C>,
        mut add: impl FnMut(&RunSweep, usize, &mut [f64]),
    ) where
        D: Dynamics,
        C: ParameterConstraints,
    {
        let p = problem.n_parameters();
        let mut first = p;
        for (j, run) in self.runs.iter().enumerate() {
            let mut local = vec![0.0; run.r()];
            add(run, j, &mut local);
            dense::axpy(1.0, &local[..p], &mut global[..p]);
            dense::axpy(1.0, &local[p..], &mut global[first..first + run.free.len()]);
            first += run.free.len();
        }
    }

    /// Steps of all nodes from the reduced variables.
    fn expand<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        problem: &Collocation<D, C>,
        rho: &[f64],
    ) {
        let p = problem.n_parameters();
        let mut local = rho[..p].to_vec();
        let mut first = p;
        for run in &mut self.runs {
            local.truncate(p);
            local.extend_from_slice(&rho[first..first + run.free.len()]);
            run.expand(&local);
            first += run.free.len();
        }
    }

    /// Adds the inequalities that the expanded step violates; false when there is nothing new.
    fn add_violated<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        problem: &Collocation<D, C>,
        rho: &[f64],
        rows: &mut Vec<Row>,
    ) -> bool {
        let (p, n, s) = (
            problem.n_parameters(),
            problem.n_states(),
            problem.scheme.unknown_nodes(),
        );
        let (lower, upper) = problem.limits();
        let outside = |row: usize, value: f64| {
            crate::sqp::iterate::violation(value, lower[row], upper[row]) > ROW_TOLERANCE
        };
        let mut wanted: Vec<RowAt> = Vec::new();
        for (j, (run, at)) in self.runs.iter().zip(&problem.layout.runs).enumerate() {
            for b in 0..problem.runs[j].time.len() {
                let dx = &run.dx[b * s * n..(b * s + 1) * n];
                let value = self.g[at.g + b] + run.bounded_change(b * s, dx, &rho[..p]);
                if outside(at.g + b, value) {
                    wanted.push(RowAt::Bounded {
                        run: j,
                        boundary: b,
                    });
                }
            }
        }
        for (i, row) in self.parameter_rows.iter().enumerate() {
            let at = problem.layout.parameter_constraints + i;
            if outside(at, self.g[at] + dense::dot(row, &rho[..p])) {
                wanted.push(RowAt::Parameter(i));
            }
        }
        wanted.retain(|at| rows.iter().all(|row| row.at != *at));
        if wanted.is_empty() {
            return false;
        }
        for at in wanted {
            rows.push(self.row(problem, at, lower, upper));
        }
        true
    }

    /// One inequality over the reduced variables.
    fn row<D: Dynamics, C: ParameterConstraints>(
        &self,
        problem: &Collocation<D, C>,
        at: RowAt,
        lower: &[f64],
        upper: &[f64],
    ) -> Row {
        let p = problem.n_parameters();
        let (index, entries, value) = match at {
            RowAt::Parameter(i) => {
                let index = problem.layout.parameter_constraints + i;
                (
                    index,
                    self.parameter_rows[i].iter().copied().enumerate().collect(),
                    self.g[index],
                )
            }
            RowAt::Bounded { run: j, boundary } => {
                let index = problem.layout.runs[j].g + boundary;
                let run = &self.runs[j];
                let mut local = vec![0.0; run.r()];
                let offset = run.bounded_row(boundary * problem.scheme.unknown_nodes(), &mut local);
                let first = p + self.runs[..j].iter().map(|r| r.free.len()).sum::<usize>();
                let column = |i: usize| if i < p { i } else { first + i - p };
                let entries = local
                    .iter()
                    .enumerate()
                    .map(|(i, v)| (column(i), *v))
                    .collect();
                (index, entries, self.g[index] + offset)
            }
        };
        Row {
            at,
            index,
            entries,
            lower: lower[index] - value,
            upper: upper[index] - value,
        }
    }

    /// The full step from the reduced solution and the expanded nodes.
    fn write_primal<D: Dynamics, C: ParameterConstraints>(
        &self,
        problem: &Collocation<D, C>,
        rho: &[f64],
        step: &mut Step,
    ) {
        let p = problem.n_parameters();
        step.d.resize(problem.layout.theta + p, 0.0);
        step.d[problem.layout.theta..].copy_from_slice(&rho[..p]);
        for (run, at) in self.runs.iter().zip(&problem.layout.runs) {
            step.d[at.z..at.z + run.dx.len()].copy_from_slice(&run.dx);
        }
    }

    /// Multipliers and curvature that go with it.
    fn write_dual<D: Dynamics, C: ParameterConstraints>(
        &self,
        problem: &Collocation<D, C>,
        hessian: Hessian,
        damping: f64,
        rows: &[Row],
        solution: &ConvexSolution,
        step: &mut Step,
    ) {
        let (layout, rho) = (&problem.layout, &solution.x);
        let dtheta = &rho[..problem.n_parameters()];
        step.lambda.resize(layout.n_equalities, 0.0);
        step.eta.clear();
        step.eta.resize(self.g.len(), 0.0);
        for (row, y) in rows.iter().zip(&solution.y) {
            step.eta[row.index] = *y;
        }
        step.active = self.working.len();
        step.violation = solution.violation;
        step.residual.clear();
        step.curvature = damping * dense::dot(rho, rho);
        for (j, (run, at)) in self.runs.iter().zip(&layout.runs).enumerate() {
            let eta = &step.eta[at.g..at.g + problem.runs[j].time.len()];
            step.curvature +=
                run.adjoint(problem, j, hessian, dtheta, eta, &mut step.lambda[at.c..]);
        }
        if hessian == Hessian::Exact {
            for (i, row) in self
                .parameter_hessian
                .chunks_exact(dtheta.len())
                .enumerate()
            {
                step.curvature += dtheta[i] * dense::dot(row, dtheta);
            }
        }
    }
}
