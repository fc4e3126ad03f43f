//! Condensing of the QP of a collocation problem: the states are eliminated. This is the fast path of the SQP.
//!
//! In a forward sweep, the defects of each run express the step of every node as `δX_k = S_k ρ + e_k`, with `ρ` the
//! shared parameters and the free initial states of the run. The remaining QP has a few dozen variables, and its
//! Hessian is an arrowhead ([`arrow`]). Only those inequalities enter it that the step would violate. Active set
//! methods solve it, or clarabel if the rows are inconsistent. A QP that is not convex may still be convex in the null
//! space of the rows active in the last QP; its solution is valid if they are active in it too. A backward adjoint
//! sweep gives the multipliers of all defects. The step and the multipliers are those of the full QP: the iterates
//! equal those of [`SparseQp`](pilotage_sqp::SparseQp), at a cost linear in the number of nodes. A second-order
//! correction of a step takes one more forward sweep: ρ is kept, and the states follow.

mod active;
pub mod arrow;
mod batch;
mod curvature;
pub mod dense;
mod dual;
mod element;
mod elements;
mod gradients;
mod points;
mod reduce;
mod run;
mod sensitivity;
mod sparse_lu;
mod sweep;

use super::Collocation;
use super::mesh::Run;
use super::parallel;
use super::simd::{LANES, width};
use active::{Convex, Row, RowAt, held};
use arrow::Arrow;
use batch::with_items;
use elements::ElementJacobians;
use pilotage_sqp::convex::ConvexSolution;
use pilotage_sqp::iterate::violation;
use pilotage_sqp::{Curvature, Hessian, Iterate, Problem, QpFailure, QpSolver, Step, vector};
use reduce::Reduced;
use run::{Place, RunSweep};
pub use sensitivity::{Sensitivities, Sensitivity};
use std::collections::HashSet;

/// Violation above which a linearised inequality enters the QP.
const ROW_TOLERANCE: f64 = 1e-12;
/// Maximum number of rounds of adding violated inequalities.
const MAX_ROUNDS: usize = 50;

/// Workspace of the condensed QP.
#[derive(Debug, Clone, Default)]
pub struct Condensed {
    runs: Vec<RunSweep>,
    jacobians: ElementJacobians,
    lagrangian: Vec<f64>,
    /// Values of the inequalities.
    g: Vec<f64>,
    /// The reduced linear terms for the Gauss–Newton and the exact Hessian.
    linear: [Vec<f64>; 2],
    /// Jacobian of the parameter constraints, one row each, and their Hessians summed with the weights η.
    parameter_rows: Vec<Vec<f64>>,
    parameter_hessian: Vec<f64>,
    gauss_newton: Arrow,
    exact: Option<Arrow>,
    singular: bool,
    /// Largest sensitivity of an unknown to a reduced variable.
    growth: f64,
    /// Active inequalities of the last QP, with the sign of their multiplier.
    working: Vec<(RowAt, f64)>,
}

impl QpSolver<Collocation> for Condensed {
    fn linearise(&mut self, problem: &Collocation, at: &Iterate, exact: bool) {
        self.prepare(problem);
        self.linearise_parameters(problem, at);
        self.g.clone_from(&at.g);
        let theta = problem.layout.theta;
        let variables = problem.layout.runs.iter().map(|run| run.variables());
        let mut work: Vec<_> = (self.runs.iter_mut())
            .zip(parallel::parts(&mut self.lagrangian, variables))
            .collect();
        parallel::each(&mut work, |j, (run, lagrangian)| {
            run.linearise(Place { problem, j }, at, exact, lagrangian);
        });
        for run in &self.runs {
            dense::axpy(1.0, &run.theta_lagrangian, &mut self.lagrangian[theta..]);
        }
        self.singular =
            !self.jacobians.order(problem, &self.runs) || !self.sweep(problem, &at.c, exact);
    }

    fn lagrangian_gradient(&self) -> &[f64] {
        &self.lagrangian
    }

    fn growth(&self) -> f64 {
        self.growth
    }

    fn solve(
        &mut self,
        problem: &Collocation,
        hessian: Hessian,
        damping: f64,
        step: &mut Step,
    ) -> Result<(), QpFailure> {
        self.solve_reduced(problem, hessian, damping, step)?;
        self.write_dual(problem, hessian, damping, step);
        Ok(())
    }

    fn correct(
        &mut self,
        problem: &Collocation,
        trial: &Iterate,
        d: &mut [f64],
    ) -> Result<(), QpFailure> {
        let variables = problem.layout.runs.iter().map(|run| run.variables());
        let mut d: Vec<_> = parallel::parts(d, variables).collect();
        let batches = self.jacobians.batches(problem, &mut self.runs, LANES);
        let mut work: Vec<_> = with_items(batches, &mut d).collect();
        parallel::each(&mut work, |_, (batch, d)| batch.correct(&trial.c, d));
        Ok(())
    }

    fn curvature(&mut self, problem: &Collocation, at: &Iterate) -> Option<Curvature> {
        self.smallest_curvature(problem, at)
    }
}

impl Condensed {
    /// True if the problem is supported: the number of parameters and free initial states of each run fits into the
    /// widest row, at most 127. [`SparseQp`](pilotage_sqp::SparseQp) supports any problem.
    pub fn takes(problem: &Collocation) -> bool {
        let free = |run: &Run| run.initial.iter().filter(|known| known.is_none()).count();
        let most = problem.runs.iter().map(free).max().unwrap_or(0);
        width(problem.n_parameters() + most + 1).is_some()
    }

    /// Eliminates the states, with the values `c` of the equalities, and computes the reduced Hessians. False if an
    /// element is singular.
    fn sweep(&mut self, problem: &Collocation, c: &[f64], exact: bool) -> bool {
        // Two runs at once, unless that would leave threads without work.
        let threads = rayon::current_num_threads();
        let size = if threads == 1 || self.runs.len() > 4 * threads {
            2
        } else {
            1
        };
        let batches = self.jacobians.batches(problem, &mut self.runs, size);
        let mut work: Vec<_> = (batches.into_iter())
            .map(|batch| (batch, true, Vec::new()))
            .collect();
        parallel::each(&mut work, |_, (batch, regular, reduced)| {
            let first = batch.first;
            let at = |k: usize| Place {
                problem,
                j: first + k,
            };
            for (k, run) in batch.runs.iter_mut().enumerate() {
                *regular &= run.factor(at(k), batch.jacobians);
            }
            if !*regular {
                return;
            }
            batch.sensitivities(c);
            for (k, run) in batch.runs.iter_mut().enumerate() {
                *regular &= run.is_finite;
                run.complete(at(k));
                reduced.push(run.reduce(at(k), exact));
            }
        });
        let regular = work.iter().all(|(_, regular, _)| *regular);
        let reduced: Vec<[Reduced; 2]> =
            work.into_iter().flat_map(|(.., reduced)| reduced).collect();
        if reduced.len() < self.runs.len() {
            return false;
        }
        self.growth = self.runs.iter().fold(0.0, |m, run| run.growth.max(m));
        let free: Vec<usize> = self.runs.iter().map(|run| run.free.len()).collect();
        let arrow = |kind: usize| {
            let mut arrow = Arrow::zeros(problem.n_parameters(), &free);
            let own = reduced.iter().enumerate();
            own.for_each(|(j, reduced)| arrow.set_run(j, &reduced[kind].matrix));
            arrow
        };
        self.gauss_newton = arrow(0);
        self.exact = exact.then(|| {
            let mut arrow = arrow(1);
            dense::axpy(1.0, &self.parameter_hessian, &mut arrow.theta);
            arrow
        });
        for (kind, linear) in self
            .linear
            .iter_mut()
            .enumerate()
            .take(1 + usize::from(exact))
        {
            let own = reduced
                .iter()
                .map(|reduced| reduced[kind].vector.as_slice());
            *linear = joined(own, problem.n_parameters());
        }
        regular
    }

    /// Computes the step and the active inequalities.
    fn solve_reduced(
        &mut self,
        problem: &Collocation,
        hessian: Hessian,
        damping: f64,
        step: &mut Step,
    ) -> Result<(), QpFailure> {
        if self.singular {
            return Err(QpFailure::NoSolution);
        }
        let mut matrix = match hessian {
            Hessian::Exact => self.exact.clone().ok_or(QpFailure::NotConvex)?,
            Hessian::GaussNewton => self.gauss_newton.clone(),
        };
        matrix.add_diagonal(damping);
        let sides: Vec<f64> = self.working.iter().map(|(_, side)| *side).collect();
        let mut rows = self.working_rows(problem);
        let convex = match matrix.factor() {
            Some(factor) => Convex::new(matrix, factor),
            None => Convex::held(matrix, &rows).ok_or(QpFailure::NotConvex)?,
        };
        let mut q = match hessian {
            Hessian::GaussNewton => self.linear[0].clone(),
            Hessian::Exact => self.linear[1].clone(),
        };
        convex.shift(&rows, &sides, &mut q);

        let (lower, upper) = problem.limits();
        let mut solution = match active::exchanged(&convex.factor, &q, &rows, &sides) {
            Some(solution) => solution,
            None if convex.holds() => active::solve(&convex, &q, &rows, &sides)?,
            None => {
                rows.clear();
                active::free(&convex.factor, &q)
            }
        };
        for _ in 0..MAX_ROUNDS {
            let outside = self.violated(problem, &solution.x, &rows);
            if solution.violation > 0.0 || outside.is_empty() {
                break;
            }
            let new = outside
                .into_iter()
                .map(|at| self.row(problem, at, lower, upper));
            rows.extend(new);
            let mut guess: Vec<f64> = solution.y.iter().map(|y| active::sign(*y)).collect();
            guess.resize(rows.len(), 0.0);
            solution = active::solve(&convex, &q, &rows, &guess)?;
        }
        if convex.holds() && !held(&rows, &sides, &solution) {
            return Err(QpFailure::NotConvex);
        }
        self.expand(problem, &solution.x, 1.0);
        let is_active = |(row, y): &(&Row, &f64)| **y != 0.0 || row.is_equation();
        let sides = rows.iter().zip(&solution.y).filter(is_active);
        self.working = sides.map(|(row, y)| (row.at, y.signum())).collect();
        self.write_primal(problem, &rows, &solution, step);
        Ok(())
    }

    /// Allocates the workspace at the first use.
    fn prepare(&mut self, problem: &Collocation) {
        let variables = problem.layout.theta + problem.n_parameters();
        if self.runs.len() != problem.runs.len() || self.lagrangian.len() != variables {
            self.runs = (0..problem.runs.len())
                .map(|j| RunSweep::new(problem, j))
                .collect();
            self.jacobians = ElementJacobians::new(problem);
            self.lagrangian = vec![0.0; variables];
            self.working = equations(problem).map(|at| (at, 1.0)).collect();
        }
        let theta = problem.layout.theta;
        self.lagrangian[theta..].fill(0.0);
    }

    /// Jacobian and weighted Hessian of the constraints on θ, and their contribution to `∇L`.
    fn linearise_parameters(&mut self, problem: &Collocation, at: &Iterate) {
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

    /// Each run with its reduced variables.
    fn with_local<'a>(&'a mut self, rho: &[f64], p: usize) -> Vec<(&'a mut RunSweep, Vec<f64>)> {
        let mut first = p;
        let local = self.runs.iter_mut().map(|run| {
            let own = &rho[first..first + run.free.len()];
            first += own.len();
            (run, [&rho[..p], own].concat())
        });
        local.collect()
    }

    /// Steps of all unknowns from the reduced variables, with this multiple of the offsets.
    fn expand(&mut self, problem: &Collocation, rho: &[f64], offsets: f64) {
        let mut work = self.with_local(rho, problem.n_parameters());
        parallel::each(&mut work, |_, (run, local)| run.expand(local, offsets));
    }

    /// The inequalities not in `rows` that a step in the reduced variables violates: for each contiguous range of
    /// samples at which a bounded output of a run is outside its limits, the one violated most.
    fn violated(&mut self, problem: &Collocation, rho: &[f64], rows: &[Row]) -> Vec<RowAt> {
        let p = problem.n_parameters();
        let (lower, upper) = problem.limits();
        let g = std::mem::take(&mut self.g);
        let known: HashSet<RowAt> = rows.iter().map(|row| row.at).collect();
        let mut work: Vec<_> = (self.with_local(rho, p).into_iter())
            .map(|(run, local)| (run, local, Vec::new()))
            .collect();
        parallel::each(&mut work, |j, (run, local, outside)| {
            let at = problem.layout.runs[j];
            let mut worst = (0.0, 0);
            for (k, change) in run.bounded_changes(local).iter().enumerate() {
                let value = g[at.g + k] + change;
                let excess = violation(value, lower[at.g + k], upper[at.g + k]);
                let row = RowAt::Bounded { run: j, row: k };
                let new = || !known.contains(&row);
                if excess > ROW_TOLERANCE && excess > worst.0 && new() {
                    worst = (excess, k);
                }
                let ends = excess <= ROW_TOLERANCE || (k + 1).is_multiple_of(at.samples);
                if ends && worst.0 > 0.0 {
                    outside.push(RowAt::Bounded {
                        run: j,
                        row: worst.1,
                    });
                    worst = (0.0, 0);
                }
            }
        });
        let mut outside: Vec<RowAt> = work.into_iter().flat_map(|(.., outside)| outside).collect();
        self.g = g;
        for (i, row) in self.parameter_rows.iter().enumerate() {
            let at = problem.layout.parameter_constraints + i;
            let value = self.g[at] + dense::dot(row, &rho[..p]);
            let new = !known.contains(&RowAt::Parameter(i));
            if new && violation(value, lower[at], upper[at]) > ROW_TOLERANCE {
                outside.push(RowAt::Parameter(i));
            }
        }
        outside
    }

    /// The active inequalities of the last QP over the reduced variables.
    fn working_rows(&self, problem: &Collocation) -> Vec<Row> {
        let (lower, upper) = problem.limits();
        let places = self.working.iter();
        places
            .map(|(at, _)| self.row(problem, *at, lower, upper))
            .collect()
    }

    /// One inequality over the reduced variables.
    fn row(&self, problem: &Collocation, at: RowAt, lower: &[f64], upper: &[f64]) -> Row {
        let p = problem.n_parameters();
        let (index, entries, value) = match at {
            RowAt::Parameter(i) => {
                let index = problem.layout.parameter_constraints + i;
                let entries = self.parameter_rows[i].iter().copied().enumerate();
                (index, entries.collect(), self.g[index])
            }
            RowAt::Bounded { run: j, row } => {
                let index = problem.layout.runs[j].g + row;
                let run = &self.runs[j];
                let (local, offset) = run.bounded_row(row);
                let first = p + self.runs[..j].iter().map(|r| r.free.len()).sum::<usize>();
                let column = |i: usize| if i < p { i } else { first + i - p };
                let entries = local.iter().enumerate().map(|(i, v)| (column(i), *v));
                (index, entries.collect(), self.g[index] + offset)
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

    /// The full step from the reduced solution and the expanded unknowns, with the multipliers of the inequalities.
    fn write_primal(
        &self,
        problem: &Collocation,
        rows: &[Row],
        solution: &ConvexSolution,
        step: &mut Step,
    ) {
        let p = problem.n_parameters();
        step.d.resize(problem.layout.theta + p, 0.0);
        step.d[problem.layout.theta..].copy_from_slice(&solution.x[..p]);
        for (run, at) in self.runs.iter().zip(&problem.layout.runs) {
            step.d[at.variables()].copy_from_slice(&run.nodes.dx);
        }
        step.eta.clear();
        step.eta.resize(problem.limits().0.len(), 0.0);
        for (row, y) in rows.iter().zip(&solution.y) {
            step.eta[row.index] = *y;
        }
        step.active = self.working.len();
        step.violation = solution.violation;
        step.residual.clear();
    }

    /// Computes the multipliers of the equalities and the curvature of the step.
    fn write_dual(
        &mut self,
        problem: &Collocation,
        hessian: Hessian,
        damping: f64,
        step: &mut Step,
    ) {
        let layout = &problem.layout;
        let dtheta = &step.d[layout.theta..];
        step.lambda.resize(layout.n_equalities, 0.0);
        step.curvature = match damping > 0.0 {
            true => damping * vector::sum([problem.damping_weights(), &step.d], |[w, d]| w * d * d),
            false => 0.0,
        };
        let eta = &step.eta;
        let equalities = layout.runs.iter().map(|run| run.equalities());
        let mut lambda: Vec<_> = parallel::parts(&mut step.lambda, equalities).collect();
        let batches = self.jacobians.batches(problem, &mut self.runs, LANES);
        let mut work: Vec<_> = with_items(batches, &mut lambda)
            .map(|(batch, lambda)| (batch, lambda, [0.0; 2]))
            .collect();
        parallel::each(&mut work, |_, (batch, lambda, sums)| {
            for (k, run) in batch.runs.iter_mut().enumerate() {
                let j = batch.first + k;
                let eta = &eta[layout.runs[j].inequalities()];
                let own = run.step_gradient(Place { problem, j }, hessian, (dtheta, eta));
                sums.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
            }
            batch.multipliers(lambda);
        });
        step.slope = work.iter().map(|(.., [slope, _])| slope).sum();
        step.curvature += work
            .iter()
            .map(|(.., [_, curvature])| curvature)
            .sum::<f64>();
        if hessian == Hessian::Exact {
            let rows = self.parameter_hessian.chunks_exact(dtheta.len().max(1));
            for (row, d) in rows.zip(dtheta) {
                step.curvature += d * dense::dot(row, dtheta);
            }
        }
    }
}

/// The bounded outputs with equal limits at a sample: active from the first QP on.
fn equations(problem: &Collocation) -> impl Iterator<Item = RowAt> {
    let (lower, upper) = problem.limits();
    let runs = problem.layout.runs.iter().enumerate();
    let rows = runs.flat_map(|(run, at)| at.inequalities().map(move |index| (run, index, at.g)));
    rows.filter(|(_, index, _)| lower[*index] == upper[*index])
        .map(|(run, index, first)| RowAt::Bounded {
            run,
            row: index - first,
        })
}

/// A vector over all reduced variables from those of each run: the sum over the `p` parameters, then the free initial
/// states run by run.
fn joined<'a>(runs: impl Iterator<Item = &'a [f64]>, p: usize) -> Vec<f64> {
    let mut out = vec![0.0; p];
    for own in runs {
        let (parameters, free) = own.split_at(p);
        dense::axpy(1.0, parameters, &mut out[..p]);
        out.extend(free);
    }
    out
}
