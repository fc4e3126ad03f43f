//! Every derivative against central differences.

use crate::random_collocation::{Draw, Random, SCHEMES, iterate, problem};
use pilotage_collocation::node::NodeModel;
use pilotage_collocation::simd::{LANES, Lanes};
use pilotage_collocation::{Condensed, Differentiated, Scales};
use pilotage_expression::System;
use pilotage_identification::constraints::RouthHurwitz;
use pilotage_identification::joint::{Joint, open_loop};
use pilotage_identification::{FitOptions, InitialState, Trial, problem as fit, start};
use pilotage_models::{Pilot, Quadcopter};
use pilotage_sqp::{Hessian, Iterate, Problem, QpSolver, SparseProblem};
use proptest::prelude::*;
use std::sync::Arc;

/// Step of the differences: the cube root of rounding.
const STEP: f64 = 6e-6;
/// Error of central differences relative to the values' magnitudes.
const TOLERANCE: f64 = 1e-7;

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 48,
        rng_seed: proptest::test_runner::RngSeed::Fixed(4),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Central difference of a vector function by variable `i`.
fn difference(f: &dyn Fn(&[f64]) -> Vec<f64>, x: &[f64], i: usize) -> Vec<f64> {
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

fn assert_near(found: f64, expected: f64, scale: f64, what: &str) {
    let bound = TOLERANCE * (1.0 + scale);
    assert!(
        (found - expected).abs() < bound,
        "{what}: {found}, differences give {expected}"
    );
}

fn largest(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// The numbers of a group of points that are all the same.
fn alike(group: &[Lanes]) -> Vec<f64> {
    assert!(group.iter().all(|own| own.iter().all(|v| *v == own[0])));
    group.iter().map(|own| own[0]).collect()
}

/// What first derivatives are written to.
struct First {
    jacobian: Vec<f64>,
    gradients: [Vec<f64>; 2],
    outputs: Vec<f64>,
}

/// Scaled derivatives of a model at one point: its Jacobian and gradients, and the Hessian of a
/// weighted sum, against differences of values and of first derivatives.
fn check_node(system: &System, seed: u64) {
    let mut draw = Draw::new(seed);
    let (n, p) = (system.states, system.parameters);
    let scales = Scales {
        states: draw.vector(n).iter().map(|v| 1.2 + v).collect(),
        parameters: draw.vector(p).iter().map(|v| 1.2 + v).collect(),
    };
    let model = NodeModel::new(Arc::new(Differentiated::new(system)), scales);
    let (point, input, weight) = (draw.vector(n + p), draw.vector(2), draw.vector(n + 2));
    let values = |v: &[f64]| {
        let (mut f, mut outputs) = (vec![[0.0; LANES]; n], vec![[0.0; LANES]; 2]);
        let at = ([&v[..n]; LANES], [&input[..]; LANES]);
        let mut values = model.values(&v[n..]);
        values.evaluate(at.0, at.1, &mut f, &mut outputs);
        f.extend(outputs);
        alike(&f)
    };
    let first = |v: &[f64]| {
        let mut first = First {
            jacobian: Vec::new(),
            gradients: [vec![0.0; n + p], vec![0.0; n + p]],
            outputs: Vec::new(),
        };
        let mut derivatives = model.derivatives(&v[n..]);
        let mut outputs = vec![[0.0; LANES]; 2];
        derivatives.evaluate([&v[..n]; LANES], [&input[..]; LANES], &mut outputs);
        first.outputs = alike(&outputs);
        let mut jacobian = vec![[0.0; LANES]; model.entries.len()];
        derivatives.jacobian(&mut jacobian);
        first.jacobian = alike(&jacobian);
        for (output, gradient) in first.gradients.iter_mut().enumerate() {
            let columns = model.columns(output);
            let mut values = vec![[0.0; LANES]; columns.len()];
            derivatives.gradient(output, &mut values);
            let own = columns.iter().zip(alike(&values));
            own.for_each(|(c, value)| gradient[*c] = value);
        }
        first
    };
    let at = first(&point);
    assert_eq!(at.outputs, values(&point)[n..]);
    let mut rows = vec![vec![0.0; n + p]; n];
    for (value, &(i, j)) in at.jacobian.iter().zip(&model.entries) {
        rows[i][j] = *value;
    }
    rows.extend(at.gradients.clone());
    let scale = largest(&values(&point)) + rows.iter().map(|row| largest(row)).fold(0.0, f64::max);
    for j in 0..n + p {
        for (i, (row, expected)) in rows.iter().zip(difference(&values, &point, j)).enumerate() {
            assert_near(row[j], expected, scale, &format!("row {i}, variable {j}"));
        }
    }

    // Gradient of the weighted sum, whose differences are the second derivatives.
    let gradient = |v: &[f64]| {
        let first = first(v);
        let mut out = vec![0.0; n + p];
        for (value, &(i, j)) in first.jacobian.iter().zip(&model.entries) {
            out[j] += weight[i] * value;
        }
        for (j, out) in out.iter_mut().enumerate() {
            *out += weight[n] * first.gradients[0][j] + weight[n + 1] * first.gradients[1][j];
        }
        out
    };
    let f: Vec<_> = weight[..n].iter().map(|v| [*v; LANES]).collect();
    let weights = [[weight[n]; LANES], [weight[n + 1]; LANES]];
    let mut second = vec![[0.0; LANES]; model.pairs.len()];
    let mut derivatives = model.derivatives(&point[n..]);
    let outputs = &mut [[0.0; LANES]; 2];
    derivatives.evaluate([&point[..n]; LANES], [&input[..]; LANES], outputs);
    derivatives.second_order(&f, &weights, &mut second);
    let second = alike(&second);
    let scale = largest(&gradient(&point)) + largest(&second);
    for j in 0..n + p {
        for (i, expected) in difference(&gradient, &point, j)
            .iter()
            .enumerate()
            .filter(|(i, _)| *i <= j)
        {
            let pair = model.pairs.iter().position(|pair| *pair == (i, j));
            let found = pair.map_or(0.0, |k| second[k]);
            assert_near(
                found,
                *expected,
                scale,
                &format!("second derivative {i}, {j}"),
            );
        }
    }
}

/// Gradient, Jacobians and Hessian of a problem, and the Lagrangian's gradient of the condensed path.
fn check_problem(problem: &Random, at: &Iterate) {
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
    let found = QpSolver::<Random>::lagrangian_gradient(&condensed);
    for (i, (found, expected)) in found.iter().zip(lagrangian(&at.z)).enumerate() {
        assert_near(
            *found,
            expected,
            1e-3 * curved,
            &format!("Lagrangian, variable {i}"),
        );
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn the_closed_loops_derivatives_are_exact(order in 1_usize..=4, seed: u64) {
        check_node(&Joint { vehicle: Quadcopter::default(), pilot: Pilot { order } }.system(), seed);
    }

    #[test]
    fn the_pilots_derivatives_are_exact(order in 1_usize..=5, seed: u64) {
        check_node(&open_loop(Pilot { order }), seed);
    }

    #[test]
    fn derivatives_of_random_collocation_problems_are_exact(seed: u64) {
        let problem: Random = problem(seed);
        check_problem(&problem, &iterate(&problem, seed));
    }

    #[test]
    fn stability_constraints_derivatives_are_exact(order in 1_usize..=6, seed: u64) {
        let constraints = RouthHurwitz { pilot: Pilot { order } };
        let theta = Draw::new(seed).vector(2 * order);
        let values = |theta: &[f64]| {
            let mut out = vec![0.0; constraints.count()];
            constraints.values(theta, &mut out);
            out
        };
        for j in 0..theta.len() {
            let mut dual: Vec<num_dual::Dual64> = theta.iter().map(|t| (*t).into()).collect();
            dual[j].eps = 1.0;
            let mut out = vec![num_dual::Dual64::from(0.0); constraints.count()];
            constraints.values(&dual, &mut out);
            for (i, expected) in difference(&values, &theta, j).iter().enumerate() {
                assert_near(out[i].eps, *expected, largest(&values(&theta)) + 1.0, &format!("{i}, {j}"));
            }
        }
    }
}

/// The paper's problem on a short trial, every scheme and kind of initial state, response and stick.
#[test]
fn derivatives_of_the_identification_problems_are_exact() {
    let time: Vec<f64> = (0..5).map(|k| 0.1 * k as f64).collect();
    let trial = Trial {
        name: "short".into(),
        origin: String::new(),
        sha256: String::new(),
        position: vec![0.0, 0.1, f64::NAN, 0.4, 0.7],
        target: vec![10.0; 5],
        stick: Some(vec![0.0, -0.2, -0.3, -0.1, 0.2]),
        weight: 0.7,
        time,
    };
    let (trials, theta) = ([trial.clone()], [0.3, 1.2, 1.1, -0.2, -0.1, -0.3]);
    for scheme in SCHEMES {
        for initial_state in InitialState::ALL {
            let options = FitOptions {
                scheme,
                initial_state,
                ..FitOptions::default()
            };
            let states = vec![start::joint_states(&trial, &options, &theta)];
            let problem = fit::response(&trials, &options, Scales::of(&states, &theta));
            let mut at = Iterate::new(&problem, problem.variables(&states, &theta));
            let mut draw = Draw::new(3);
            at.lambda = draw.vector(at.lambda.len());
            at.eta = draw.vector(at.eta.len());
            check_problem(&problem, &at);

            let states = vec![start::stick_states(&trial, &options, &theta)];
            let problem = fit::stick(&trials, &options, Scales::of(&states, &theta));
            let mut at = Iterate::new(&problem, problem.variables(&states, &theta));
            at.lambda = draw.vector(at.lambda.len());
            at.eta = draw.vector(at.eta.len());
            check_problem(&problem, &at);
        }
    }
}
