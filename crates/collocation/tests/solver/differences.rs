//! First and second derivatives against central differences.

use pilotage_collocation::{Collocation, Condensed, Scheme};
use pilotage_sqp::{Hessian, Iterate, Problem, QpSolver, SparseProblem};

/// Every family of schemes.
pub const SCHEMES: [Scheme; 9] = [
    Scheme::Euler,
    Scheme::Trapezoid,
    Scheme::HermiteSimpson,
    Scheme::Radau(1),
    Scheme::Gauss(2),
    Scheme::Radau(3),
    Scheme::Lobatto(3),
    Scheme::Bernstein(3),
    Scheme::FiniteDifference(3),
];

/// Step of the differences: the cube root of rounding.
const STEP: f64 = 6e-6;
/// Error of central differences relative to the values' magnitudes.
const TOLERANCE: f64 = 1e-7;

/// Central difference of a vector function by variable `i`.
pub fn difference(f: &dyn Fn(&[f64]) -> Vec<f64>, x: &[f64], i: usize) -> Vec<f64> {
    let shifted = |h: f64| {
        let mut x = x.to_vec();
        x[i] += h;
        f(&x)
    };
    let (up, down) = (shifted(STEP), shifted(-STEP));
    up.iter()
        .zip(down)
        .map(|(u, d)| (u - d) / (2.0 * STEP))
        .collect()
}

pub fn assert_near(found: f64, expected: f64, scale: f64, what: &str) {
    let bound = TOLERANCE * (1.0 + scale);
    assert!(
        (found - expected).abs() < bound,
        "{what}: {found}, differences give {expected}"
    );
}

pub fn largest(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Gradient, Jacobians and Hessian of a problem, and the Lagrangian's gradient of the condensed path.
pub fn check_problem(problem: &Collocation, at: &Iterate) {
    let (m, k) = (at.c.len(), at.g.len());
    let values = |z: &[f64]| {
        let (mut c, mut g) = (vec![0.0; m], vec![0.0; k]);
        let f = problem.evaluate(z, &mut c, &mut g);
        [vec![f], c, g].concat()
    };
    let gradients = |z: &[f64]| {
        let patterns = (problem.equality_pattern(), problem.inequality_pattern());
        let (mut j, mut g) = (vec![0.0; patterns.0.len()], vec![0.0; patterns.1.len()]);
        problem.jacobians(z, &mut j, &mut g);
        let mut rows = vec![vec![0.0; z.len()]; 1 + m + k];
        problem.gradient(z, &mut rows[0]);
        patterns
            .0
            .iter()
            .zip(&j)
            .for_each(|(&(i, j), v)| rows[1 + i][j] += v);
        patterns
            .1
            .iter()
            .zip(&g)
            .for_each(|(&(i, j), v)| rows[1 + m + i][j] += v);
        rows
    };
    let lagrangian = |z: &[f64]| {
        let factors: Vec<f64> = [&[1.0], at.lambda.as_slice(), &at.eta].concat();
        let mut out = vec![0.0; z.len()];
        for (row, factor) in gradients(z).iter().zip(factors) {
            out.iter_mut().zip(row).for_each(|(o, v)| *o += factor * v);
        }
        out
    };
    let rows = gradients(&at.z);
    let scale = rows
        .iter()
        .map(|row| largest(row))
        .fold(largest(&values(&at.z)), f64::max);
    let pattern = problem.hessian_pattern();
    let mut hessian = vec![0.0; pattern.len()];
    problem.hessian(&at.z, &at.lambda, &at.eta, Hessian::Exact, &mut hessian);
    let curved = scale * (1.0 + largest(&at.lambda)) + largest(&hessian);
    for j in 0..at.z.len() {
        for (i, (row, expected)) in rows.iter().zip(difference(&values, &at.z, j)).enumerate() {
            assert_near(row[j], expected, scale, &format!("row {i}, variable {j}"));
        }
        let mut column = vec![0.0; j + 1];
        pattern
            .iter()
            .zip(&hessian)
            .filter(|((_, c), _)| *c == j)
            .for_each(|(&(i, _), v)| column[i] += v);
        for (i, expected) in difference(&lagrangian, &at.z, j)[..=j].iter().enumerate() {
            assert_near(column[i], *expected, curved, &format!("Hessian {i}, {j}"));
        }
    }
    let mut condensed = Condensed::default();
    condensed.linearise(problem, at, true);
    let found = QpSolver::<Collocation>::lagrangian_gradient(&condensed);
    for (i, (found, expected)) in found.iter().zip(lagrangian(&at.z)).enumerate() {
        assert_near(
            *found,
            expected,
            1e-3 * curved,
            &format!("Lagrangian, variable {i}"),
        );
    }
}
