//! The condensed QP against the obvious way: the whole KKT system as one dense matrix, and against the
//! general sparse path.

use crate::random_collocation::{Random, iterate, problem, problem_on_samples};
use nalgebra::{DMatrix, DVector};
use pilotage_collocation::Condensed;
use pilotage_sqp::problem::Pattern;
use pilotage_sqp::{
    Curvature, Hessian, Iterate, Iteration, Problem, QpFailure, QpSolver, SparseProblem, SparseQp,
    SqpOptions, Step, solve,
};
use std::ops::ControlFlow;

/// The derivatives as dense matrices.
struct Dense {
    w: DMatrix<f64>,
    q: DVector<f64>,
    j: DMatrix<f64>,
    g: DMatrix<f64>,
}

fn dense(rows: usize, columns: usize, pattern: &Pattern, values: &[f64]) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(rows, columns);
    pattern.iter().zip(values).for_each(|(&at, v)| out[at] += v);
    out
}

impl Dense {
    /// The least change that removes the equalities' values `c`, measured by these weights.
    fn least_correction(&self, weights: &[f64], c: &[f64]) -> Vec<f64> {
        let (m, n) = self.j.shape();
        let mut kkt = DMatrix::zeros(n + m, n + m);
        weights
            .iter()
            .enumerate()
            .for_each(|(i, w)| kkt[(i, i)] = *w);
        kkt.view_mut((n, 0), (m, n)).copy_from(&self.j);
        kkt.view_mut((0, n), (n, m)).copy_from(&self.j.transpose());
        let mut right = DVector::zeros(n + m);
        (0..m).for_each(|i| right[n + i] = -c[i]);
        let solution = kkt.lu().solve(&right).expect("a regular elimination");
        solution.as_slice()[..n].to_vec()
    }

    fn new(problem: &Random, at: &Iterate, kind: Hessian, damping: f64) -> Self {
        let n = problem.n_variables();
        let patterns = (problem.equality_pattern(), problem.inequality_pattern());
        let (mut j, mut g) = (vec![0.0; patterns.0.len()], vec![0.0; patterns.1.len()]);
        problem.jacobians(&at.z, &mut j, &mut g);
        let pattern = problem.hessian_pattern();
        let mut values = vec![0.0; pattern.len()];
        problem.hessian(&at.z, &at.lambda, &at.eta, kind, &mut values);
        let upper = dense(n, n, &pattern, &values);
        let mut w = &upper + upper.transpose() - DMatrix::from_diagonal(&upper.diagonal());
        w += DMatrix::from_diagonal(&DVector::from_column_slice(problem.damping_weights()))
            * damping;
        let mut q = vec![0.0; n];
        problem.gradient(&at.z, &mut q);
        Self {
            w,
            q: DVector::from_vec(q),
            j: dense(at.c.len(), n, &patterns.0, &j),
            g: dense(at.g.len(), n, &patterns.1, &g),
        }
    }

    /// Smallest eigenvalue of the Hessian in the null space of the equalities.
    fn smallest_curvature(&self) -> f64 {
        let eigen = (self.j.transpose() * &self.j).symmetric_eigen();
        let largest = eigen.eigenvalues.amax().max(1.0);
        let null: Vec<_> = (0..self.w.ncols())
            .filter(|&i| eigen.eigenvalues[i] < 1e-10 * largest)
            .map(|i| eigen.eigenvectors.column(i))
            .collect();
        assert_eq!(
            null.len(),
            self.w.ncols() - self.j.nrows(),
            "independent defects"
        );
        let z = DMatrix::from_columns(&null);
        (z.transpose() * &self.w * z).symmetric_eigenvalues().min()
    }

    /// Step, λ and η of the QP with the given constraint values and active rows of `g`; None where the
    /// active rows depend on each other, so that the multipliers are not unique.
    fn solve(
        &self,
        c: &[f64],
        active: &[(usize, f64)],
    ) -> Option<(DVector<f64>, DVector<f64>, DVector<f64>)> {
        let (n, m, k) = (self.w.ncols(), self.j.nrows(), active.len());
        let mut matrix = DMatrix::zeros(n + m + k, n + m + k);
        let mut right = DVector::zeros(n + m + k);
        matrix.view_mut((0, 0), (n, n)).copy_from(&self.w);
        matrix.view_mut((n, 0), (m, n)).copy_from(&self.j);
        right.rows_mut(0, n).copy_from(&-&self.q);
        c.iter().enumerate().for_each(|(i, c)| right[n + i] = -c);
        for (i, &(row, value)) in active.iter().enumerate() {
            matrix
                .view_mut((n + m + i, 0), (1, n))
                .copy_from(&self.g.row(row));
            right[n + m + i] = value;
        }
        matrix.fill_upper_triangle_with_lower_triangle();
        let lu = matrix.full_piv_lu();
        let pivots = lu.u().diagonal().abs();
        if pivots.min() < 1e-9 * pivots.max() {
            return None;
        }
        let solution = lu.solve(&right)?;
        let part = |from: usize, count: usize| solution.rows(from, count).into_owned();
        Some((part(0, n), part(n, m), part(n + m, k)))
    }
}

/// Relative distance.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let size = b.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
    a.iter()
        .zip(b)
        .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()))
        / size
}

/// Asserts that a step solves the QP with constraint values `c` and `g`: it is the dense solution for
/// its own active set, and that set is right (the QP is strictly convex, so this is sufficient). False
/// where the active rows depend on each other, which leaves nothing to compare with.
fn assert_solves(
    dense: &Dense,
    problem: &Random,
    c: &[f64],
    g: &[f64],
    step: &Step,
    tolerance: f64,
) -> bool {
    let (lower, upper) = problem.limits();
    let active: Vec<(usize, f64)> = (0..g.len())
        .filter(|&i| step.eta[i] != 0.0)
        .map(|i| {
            (
                i,
                if step.eta[i] > 0.0 {
                    upper[i] - g[i]
                } else {
                    lower[i] - g[i]
                },
            )
        })
        .collect();
    let Some((d, lambda, eta)) = dense.solve(c, &active) else {
        return false;
    };
    assert!(
        distance(&step.d, d.as_slice()) < tolerance,
        "step {:?}\n{d}",
        step.d
    );
    assert!(
        distance(&step.lambda, lambda.as_slice()) < tolerance,
        "λ {:?}\n{lambda}",
        step.lambda
    );
    let own: Vec<f64> = active.iter().map(|&(i, _)| step.eta[i]).collect();
    assert!(
        distance(&own, eta.as_slice()) < tolerance,
        "η {own:?}\n{eta}"
    );
    let slope = d.dot(&dense.q);
    assert!((step.slope - slope).abs() < tolerance * (1.0 + slope.abs()));
    let curvature = d.dot(&(&dense.w * &d));
    let error = (step.curvature - curvature).abs();
    assert!(error < tolerance * (1.0 + curvature.abs()));
    assert_eq!(step.active, active.len());
    for (i, change) in (&dense.g * &d).iter().enumerate() {
        let value = g[i] + change;
        assert!(
            value > lower[i] - 1e-8 && value < upper[i] + 1e-8,
            "row {i}: {value}"
        );
    }
    true
}

/// As [`assert_solves`] for the general path, which relaxes constraints that are almost inconsistent:
/// those whose multipliers are beyond 10⁴ times the objective's gradient.
fn assert_general(
    dense: &Dense,
    problem: &Random,
    c: &[f64],
    g: &[f64],
    general: &Step,
    step: &Step,
) {
    if general.residual.is_empty() {
        assert_solves(dense, problem, c, g, general, 1e-7);
    } else {
        let multipliers = step.lambda.iter().chain(&step.eta);
        assert!(multipliers.fold(0.0_f64, |m, y| m.max(y.abs())) > 1e4 * dense.q.amax().max(1.0));
    }
}

/// What the random problems met, so that the test cannot pass by meeting nothing.
#[derive(Debug, Default, PartialEq)]
struct Met {
    solved: usize,
    corrected: usize,
    with_active: usize,
    not_convex: usize,
    inconsistent: usize,
    dependent_rows: usize,
}

fn check(seed: u64, met: &mut Met) {
    let problem = problem(seed);
    let at = iterate(&problem, seed);
    let kind = [Hessian::Exact, Hessian::GaussNewton][seed as usize % 2];
    let damping = [1e-3, 1e-1, 10.0][seed as usize / 2 % 3];
    let dense = Dense::new(&problem, &at, kind, damping);
    let (mut condensed, mut sparse) = (Condensed::default(), SparseQp::default());
    condensed.linearise(&problem, &at, true);
    QpSolver::<Random>::linearise(&mut sparse, &problem, &at, true);
    let of = dense.q.clone()
        + dense.j.transpose() * DVector::from_column_slice(&at.lambda)
        + dense.g.transpose() * DVector::from_column_slice(&at.eta);
    let both = [
        QpSolver::<Random>::lagrangian_gradient(&condensed),
        QpSolver::<Random>::lagrangian_gradient(&sparse),
    ];
    both.iter()
        .for_each(|l| assert!(distance(l, of.as_slice()) < 1e-11));

    let (mut step, mut general) = (Step::default(), Step::default());
    let outcomes = (
        condensed.solve(&problem, kind, damping, &mut step),
        sparse.solve(&problem, kind, damping, &mut general),
    );
    let curvature = dense.smallest_curvature();
    if curvature.abs() < 1e-6 {
        return;
    }
    if curvature < 0.0 {
        met.not_convex += 1;
        assert_eq!(
            outcomes,
            (Err(QpFailure::NotConvex), Err(QpFailure::NotConvex))
        );
        return;
    }
    assert_eq!(outcomes, (Ok(()), Ok(())), "smallest curvature {curvature}");
    if step.violation > 0.0 {
        met.inconsistent += 1;
        assert!(general.violation > 1e-8 || general.residual.iter().any(|r| r.abs() > 1e-8));
        return;
    }
    if !assert_solves(&dense, &problem, &at.c, &at.g, &step, 1e-8) {
        met.dependent_rows += 1;
        return;
    }
    met.solved += 1;
    met.with_active += usize::from(step.active > 0);
    assert_general(&dense, &problem, &at.c, &at.g, &general, &step);

    let z = at.z.iter().zip(&step.d).map(|(z, d)| z + d).collect();
    let trial = Iterate::new(&problem, z);
    let least = dense.least_correction(problem.damping_weights(), &trial.c);
    let expected: Vec<f64> = step.d.iter().zip(&least).map(|(d, c)| d + c).collect();
    let (mut fast, mut general) = (step.d.clone(), step.d.clone());
    condensed.correct(&problem, &trial, &mut fast).unwrap();
    sparse.correct(&problem, &trial, &mut general).unwrap();
    assert!(distance(&fast, &expected) < 1e-12);
    assert!(distance(&general, &expected) < 1e-12);
    met.corrected += usize::from(distance(&expected, &step.d) > 1e-6);
}

#[test]
fn steps_and_multipliers_are_those_of_the_dense_kkt_system() {
    let mut met = Met::default();
    for seed in 0..400 {
        check(seed, &mut met);
    }
    insta::assert_debug_snapshot!(met, @"
    Met {
        solved: 294,
        corrected: 200,
        with_active: 80,
        not_convex: 60,
        inconsistent: 46,
        dependent_rows: 0,
    }
    ");
}

/// A QP solver that tells when it first relaxed the constraints, which each path does its own way.
struct Watched<'a, Q>(Q, &'a std::cell::Cell<bool>);

impl<Q: QpSolver<Random>> QpSolver<Random> for Watched<'_, Q> {
    fn linearise(&mut self, problem: &Random, at: &Iterate, exact: bool) {
        self.0.linearise(problem, at, exact);
    }

    fn lagrangian_gradient(&self) -> &[f64] {
        self.0.lagrangian_gradient()
    }

    fn solve(
        &mut self,
        problem: &Random,
        hessian: Hessian,
        damping: f64,
        step: &mut Step,
    ) -> Result<(), QpFailure> {
        self.0.solve(problem, hessian, damping, step)?;
        self.1
            .set(self.1.get() || step.violation > 0.0 || !step.residual.is_empty());
        Ok(())
    }

    fn correct(
        &mut self,
        problem: &Random,
        trial: &Iterate,
        d: &mut [f64],
    ) -> Result<(), QpFailure> {
        self.0.correct(problem, trial, d)
    }

    fn curvature(&mut self, problem: &Random, at: &Iterate) -> Option<Curvature> {
        self.0.curvature(problem, at)
    }
}

/// The iterates of a solve up to the first relaxed QP, and while they are not at rounding.
fn iterates(problem: &Random, z: Vec<f64>, qp: impl QpSolver<Random>) -> Vec<Iteration> {
    let mut log = Vec::new();
    let relaxed = std::cell::Cell::new(false);
    let limits = SqpOptions {
        max_iterations: 40,
        tolerance: 1e-6,
        ..SqpOptions::default()
    };
    solve(
        problem,
        &mut Watched(qp, &relaxed),
        z,
        &limits,
        &mut |iteration| {
            if !relaxed.get() && iteration.kkt.residual() > 1e-6 {
                log.push(*iteration);
            }
            ControlFlow::Continue(())
        },
    );
    log
}

/// Where active rows depend on each other, which of them are held is not unique, and so whether the exact Hessian
/// is convex on them, with which damping.
fn part(a: &Iteration, b: &Iteration) -> bool {
    a.model != b.model || (a.damping / b.damping - 1.0).abs() > 0.5
}

/// Far from a solution rounding grows from step to step: by how much, a third solve tells, whose start is off by a
/// hundred units of rounding.
#[test]
fn both_qp_paths_give_the_same_iterates() {
    let (mut compared, mut parted) = (0, 0);
    for seed in 0..60 {
        let problem = problem_on_samples(seed);
        let z = iterate(&problem, seed).z;
        let near = z.iter().map(|z| z * (1.0 + 100.0 * f64::EPSILON)).collect();
        let fast = iterates(&problem, z.clone(), Condensed::default());
        let general = iterates(&problem, z, SparseQp::default());
        let rounded = iterates(&problem, near, SparseQp::default());
        for ((a, b), c) in fast.iter().zip(&general).zip(&rounded) {
            if part(a, b) || part(b, c) {
                parted += 1;
                break;
            }
            let objective = |x: &Iteration| distance(&[x.objective], &[b.objective]);
            let rounding = f64::max(1e-9, 10.0 * objective(c));
            assert!(
                (a.step - b.step).abs() < 1e-6 && objective(a) < rounding,
                "{seed}: {a:?} {b:?} {c:?}"
            );
            compared += 1;
        }
    }
    assert!(parted <= 6, "{parted} of 60 solves part");
    assert!(compared > 250, "{compared} iterates");
}
