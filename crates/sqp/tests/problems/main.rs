//! The SQP on problems with known answers, through its public interface and the general QP path.

mod draw;
mod hock_schittkowski;
mod hostile;
mod library;

use library::{Answer, Example};
use nalgebra::{DMatrix, DVector};
use num_dual::HyperDual64;
use pilotage_sqp::curvature::TOLERANCE;
use pilotage_sqp::problem::Pattern;
use pilotage_sqp::{
    Hessian, Problem, Solution, SparseProblem, SparseQp, SqpOptions, Status, solve,
};
use std::ops::ControlFlow;

/// A problem as the SQP sees it; derivatives by hyper-dual numbers, dense patterns.
struct Nlp<F> {
    functions: F,
    limits: (Vec<f64>, Vec<f64>),
    weights: Vec<f64>,
    n_equalities: usize,
}

/// Objective, equalities, inequalities.
type Values = (HyperDual64, Vec<HyperDual64>, Vec<HyperDual64>);

impl<F: Functions> Nlp<F> {
    fn new(functions: F, limits: &[(f64, f64)], n_variables: usize) -> Self {
        let mut nlp = Self {
            functions,
            limits: limits.iter().copied().unzip(),
            weights: vec![1.0; n_variables],
            n_equalities: 0,
        };
        nlp.n_equalities = nlp.values(&vec![0.0; n_variables], 0, 0).1.len();
        nlp
    }

    /// Values with their derivatives by variables `i` and `j`.
    fn values(&self, z: &[f64], i: usize, j: usize) -> Values {
        let mut z: Vec<HyperDual64> = z.iter().map(|v| HyperDual64::from(*v)).collect();
        if !z.is_empty() {
            z[i].eps1 = 1.0;
            z[j].eps2 = 1.0;
        }
        let (mut c, mut g) = (Vec::new(), Vec::new());
        let f = (self.functions)(&z, &mut c, &mut g);
        (f, c, g)
    }

    fn dense(rows: usize, columns: usize) -> Pattern {
        (0..rows)
            .flat_map(|i| (0..columns).map(move |j| (i, j)))
            .collect()
    }
}

/// Returns the objective and pushes the values of the constraints.
trait Functions:
    Fn(&[HyperDual64], &mut Vec<HyperDual64>, &mut Vec<HyperDual64>) -> HyperDual64
{
}

impl<F: Fn(&[HyperDual64], &mut Vec<HyperDual64>, &mut Vec<HyperDual64>) -> HyperDual64> Functions
    for F
{
}

impl<F: Functions> Problem for Nlp<F> {
    fn n_variables(&self) -> usize {
        self.weights.len()
    }

    fn n_equalities(&self) -> usize {
        self.n_equalities
    }

    fn limits(&self) -> (&[f64], &[f64]) {
        (&self.limits.0, &self.limits.1)
    }

    fn evaluate(&self, z: &[f64], c: &mut [f64], g: &mut [f64]) -> f64 {
        let values = self.values(z, 0, 0);
        c.iter_mut().zip(values.1).for_each(|(c, v)| *c = v.re);
        g.iter_mut().zip(values.2).for_each(|(g, v)| *g = v.re);
        values.0.re
    }

    fn damping_weights(&self) -> &[f64] {
        &self.weights
    }
}

impl<F: Functions> SparseProblem for Nlp<F> {
    fn gradient(&self, z: &[f64], gradient: &mut [f64]) {
        gradient
            .iter_mut()
            .enumerate()
            .for_each(|(i, g)| *g = self.values(z, i, i).0.eps1);
    }

    fn equality_pattern(&self) -> Pattern {
        Self::dense(self.n_equalities, self.n_variables())
    }

    fn inequality_pattern(&self) -> Pattern {
        Self::dense(self.limits.0.len(), self.n_variables())
    }

    fn jacobians(&self, z: &[f64], equality: &mut [f64], inequality: &mut [f64]) {
        let n = z.len();
        for j in 0..n {
            let (_, c, g) = self.values(z, j, j);
            c.iter()
                .enumerate()
                .for_each(|(i, c)| equality[i * n + j] = c.eps1);
            g.iter()
                .enumerate()
                .for_each(|(i, g)| inequality[i * n + j] = g.eps1);
        }
    }

    fn hessian_pattern(&self) -> Pattern {
        let n = self.n_variables();
        (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).collect()
    }

    /// The positive semidefinite approximation is the Hessian with its eigenvalues made positive.
    fn hessian(&self, z: &[f64], lambda: &[f64], eta: &[f64], kind: Hessian, out: &mut [f64]) {
        let n = z.len();
        let mut w = DMatrix::from_fn(n, n, |i, j| {
            let (f, c, g) = self.values(z, i, j);
            let equalities: f64 = c.iter().zip(lambda).map(|(c, l)| c.eps1eps2 * l).sum();
            let inequalities: f64 = g.iter().zip(eta).map(|(g, e)| g.eps1eps2 * e).sum();
            f.eps1eps2 + equalities + inequalities
        });
        if kind == Hessian::GaussNewton && n > 0 {
            let eigen = w.symmetric_eigen();
            let magnitudes = DVector::from_iterator(n, eigen.eigenvalues.iter().map(|v| v.abs()));
            let v = &eigen.eigenvectors;
            w = v * DMatrix::from_diagonal(&magnitudes) * v.transpose();
        }
        for (value, (i, j)) in out.iter_mut().zip(self.hessian_pattern()) {
            *value = w[(i, j)];
        }
    }
}

fn run<F: Functions>(nlp: &Nlp<F>, start: &[f64]) -> Solution {
    solve(
        nlp,
        &mut SparseQp::default(),
        start.to_vec(),
        &SqpOptions::default(),
        &mut |_| ControlFlow::Continue(()),
    )
}

/// ℓ1 norm of the violation of all constraints.
fn l1_violation(example: &Example, solution: &Solution) -> f64 {
    let rows = solution.iterate.g.iter().zip(example.limits);
    let inequalities: f64 = rows.map(|(g, (l, u))| (l - g).max(g - u).max(0.0)).sum();
    inequalities + solution.iterate.c.iter().map(|c| c.abs()).sum::<f64>()
}

/// Why a solution does not agree with what is known; None when it does.
fn disagreement(example: &Example, solution: &Solution) -> Option<String> {
    let (iterate, status) = (&solution.iterate, solution.status);
    let distance = |z: &[f64]| {
        z.iter()
            .zip(&iterate.z)
            .fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()))
    };
    let (right, expected) = match &example.answer {
        Answer::Optimum { f, z } => {
            let near = (iterate.f - f).abs() < 1e-6 * (1.0 + f.abs()) && distance(z) < 1e-5;
            (
                status == Status::Converged && near,
                format!("converged, f = {f}, z = {z:?}"),
            )
        }
        Answer::NotKkt { f, z } => {
            let near = (iterate.f - f).abs() < 1e-2 && distance(z) < 1e-2;
            (near, format!("near f = {f}, z = {z:?}"))
        }
        Answer::Infeasible { violation } => {
            let near = (l1_violation(example, solution) - violation).abs() < 1e-3;
            (
                status == Status::Infeasible && near,
                format!("infeasible, violated by {violation}"),
            )
        }
        Answer::Unbounded => (status == Status::Unbounded, "unbounded".into()),
        Answer::Saddle { z } => (
            status == Status::SaddlePoint && distance(z) < 1e-8,
            format!("saddle-point, z = {z:?}"),
        ),
    };
    (!right).then(|| {
        let Example { name, source, .. } = example;
        format!(
            "{name} ({source}): {status}, f = {}, z = {:?}; expected {expected}",
            iterate.f, iterate.z
        )
    })
}

#[test]
fn known_problems_end_as_known() {
    let mut table = format!(
        "{:<16} {:<16} iterations evaluations linearisations qps corrections saddles curvature\n",
        "problem", "status"
    );
    let mut wrong = Vec::new();
    for example in hock_schittkowski::examples()
        .into_iter()
        .chain(library::examples())
    {
        let nlp = Nlp::new(example.functions, example.limits, example.start.len());
        let solution = run(&nlp, example.start);
        let (name, work) = (example.name, solution.work);
        let curvature = solution.curvature.map_or("-".into(), |c| format!("{c:.3}"));
        table += &format!(
            "{name:<16} {:<16} {:>10} {:>11} {:>14} {:>3} {:>11} {:>7} {curvature:>9}\n",
            solution.status.as_str(),
            work.iterations,
            work.evaluations,
            work.linearisations,
            work.qps,
            work.corrections,
            work.curvature_steps,
        );
        wrong.extend(disagreement(&example, &solution));
        if solution.status == Status::Converged {
            let curvature = solution.curvature.expect("small enough to be checked");
            assert!(
                (-TOLERANCE..=1.0).contains(&curvature),
                "{name}: {curvature}"
            );
        }
    }
    assert!(wrong.is_empty(), "{}\n{table}", wrong.join("\n"));
    insta::assert_snapshot!(table, @"
    problem          status           iterations evaluations linearisations qps corrections saddles curvature
    HS1              converged                24          32             25  24           8       0     0.001
    HS2              converged                 8           9              9   8           1       0     1.000
    HS6              converged                 4           4              5   4           0       0     0.400
    HS7              converged                 9          12             10  10           2       0     1.000
    HS10             converged                12          16             13  13           2       0     0.500
    HS12             converged                 8           8              9   8           0       0     1.000
    HS12 twice       converged                 8           8              9   8           0       0     1.000
    HS13             no-progress              17          17             18  22           0       0         -
    HS14             converged                 5           5              6   5           0       0     1.000
    HS22             converged                 5           5              6   5           0       0     1.000
    HS26             converged                24          24             25  24           0       0     0.000
    HS28             converged                 3           3              4   3           0       0     0.333
    HS35             converged                 3           3              4   3           0       0     0.357
    HS39             converged                 9          14             10  11           3       0     0.707
    HS40             converged                 4           4              5   4           0       0     1.000
    HS43             converged                 7           7              8   7           0       0     0.707
    HS65             converged                 5           5              6   5           0       0     0.349
    HS71             converged                 5           5              6   6           0       0     0.434
    HS76             converged                 3           3              4   3           0       0     0.707
    HS78             converged                 6           6              7   6           0       0     0.700
    HS100            converged                 6          11              7  10           5       0     0.363
    HS113            converged                 5           5              6   5           0       0     0.493
    Maratos          converged                 6           6              7   6           0       0     1.000
    Wächter-Biegler  infeasible                4           4              5   9           0       0         -
    linear program   converged                 2           2              3   2           0       0     1.000
    equality as g    converged                 3           3              4   3           0       0     1.000
    equality twice   converged                 6           6              7   6           0       0     1.000
    idle bounds      converged                 3           3              4   3           0       0     0.707
    gap              infeasible                1           1              2   2           0       0         -
    parallel lines   infeasible                2           3              3   3           1       0         -
    line and disc    infeasible               16          40             17  23          15       0         -
    isolated         infeasible               15          26             16  22           7       0         -
    half line        unbounded                 8           8              9   8           0       0         -
    saddle           unbounded                37          37             38  73           0       0         -
    ridge            converged                 8          11              9   9           1       1     0.707
    start on saddle  converged                 5           8              7   4           1       1     0.707
    half ridge       converged                 8          11              9   9           1       1     0.707
    corner           converged                 1           3              3   0           0       1     0.447
    copositive       converged                 5           5              6   5           0       0     0.392
    pole of circle   converged                16          16             17  20           0       1     1.000
    pole of disc     converged                13          18             14  21           3       1     1.000
    bounded ridge    converged                 7           7              8  10           0       1     1.000
    knife edge       saddle-point              3          43              4   5           0       0    -0.707
    ");
}
