//! The second-order condition of a collocation problem: on the reduced variables and on all of them.

use crate::draw::Draw;
use crate::random_collocation::{Random, constraints, iterate, problem};
use pilotage_collocation::Scheme;
use pilotage_collocation::{
    Bound, Collocation, Condensed, Differentiated, Loss, Recording, Run, Scales,
};
use pilotage_expression::System;
use pilotage_sqp::curvature::{Activity, activities};
use pilotage_sqp::problem::Pattern;
use pilotage_sqp::{
    Curvature, Hessian, Iterate, Problem, QpSolver, Solution, SparseProblem, SparseQp, SqpOptions,
    Status, solve,
};
use std::ops::ControlFlow;
use std::sync::Arc;

/// A random point, with values at their limits, with and without a multiplier.
fn with_active_rows(problem: &Random, seed: u64) -> Iterate {
    let mut at = iterate(problem, seed);
    let (lower, upper) = problem.limits();
    let mut draw = Draw::new(seed ^ 0x77);
    for i in 0..at.g.len() {
        (at.g[i], at.eta[i]) = (0.1 * draw.one(), 0.0);
        match draw.below(12) {
            0 if upper[i].is_finite() => (at.g[i], at.eta[i]) = (upper[i], 0.3),
            1 => (at.g[i], at.eta[i]) = (lower[i], -0.2),
            2 => at.g[i] = lower[i],
            3 if upper[i].is_finite() => at.g[i] = upper[i],
            _ => {}
        }
    }
    at
}

fn curvature<Q: QpSolver<Random> + Default>(problem: &Random, at: &Iterate) -> Curvature {
    let mut qp = Q::default();
    qp.linearise(problem, at, true);
    qp.curvature(problem, at).expect("small enough")
}

/// Matrix times vector, by the pattern of the matrix.
fn times(rows: usize, pattern: &Pattern, values: &[f64], d: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; rows];
    pattern
        .iter()
        .zip(values)
        .for_each(|(&(i, j), v)| out[i] += v * d[j]);
    out
}

/// Asserts that the direction lies in the critical cone and has the curvature that is said of it.
fn assert_direction(seed: u64, problem: &Random, at: &Iterate, found: &Curvature) {
    let d = &found.direction;
    let patterns = (problem.equality_pattern(), problem.inequality_pattern());
    let (mut c, mut g) = (vec![0.0; patterns.0.len()], vec![0.0; patterns.1.len()]);
    problem.jacobians(&at.z, &mut c, &mut g);
    let equalities = times(at.c.len(), &patterns.0, &c, d);
    assert!(
        equalities.iter().all(|v| v.abs() < 1e-8),
        "{seed}: {equalities:?}"
    );
    let inequalities = times(at.g.len(), &patterns.1, &g, d);
    for (value, activity) in inequalities.iter().zip(activities(problem, at)) {
        let kept = match activity {
            Activity::Free => true,
            Activity::Strong => value.abs() < 1e-7,
            Activity::Weak(sign) => value * sign < 1e-7,
        };
        assert!(kept, "{seed}: {value} {activity:?}");
    }
    let pattern = problem.hessian_pattern();
    let mut values = vec![0.0; pattern.len()];
    problem.hessian(&at.z, &at.lambda, &at.eta, Hessian::Exact, &mut values);
    let along: f64 = (pattern.iter().zip(&values))
        .map(|(&(i, j), v)| {
            if i == j {
                v * d[i] * d[i]
            } else {
                2.0 * v * d[i] * d[j]
            }
        })
        .sum();
    assert!(
        (along - found.along).abs() < 1e-7 * (1.0 + along.abs()),
        "{seed}: {along} {found:?}"
    );
}

#[test]
fn both_paths_find_the_same_smallest_curvature() {
    let (mut negative, mut vertices) = (0, 0);
    for seed in 0..120 {
        let problem = problem(seed);
        let at = with_active_rows(&problem, seed);
        let fast = curvature::<Condensed>(&problem, &at);
        let general = curvature::<SparseQp>(&problem, &at);
        assert!(
            (fast.smallest - general.smallest).abs() < 1e-6,
            "{seed}: {fast:?} {general:?}"
        );
        for found in [&fast, &general] {
            if found.direction.is_empty() {
                assert_eq!(found.smallest, 1.0);
                vertices += 1;
            } else {
                assert_direction(seed, &problem, &at, found);
                negative += usize::from(found.is_negative());
            }
        }
    }
    assert!(negative > 20 && vertices > 4, "{negative} {vertices}");
}

/// `ẋ = θ² w`, x measured and bounded: θ and -θ do the same, so θ = 0 is a KKT point whatever was measured.
fn squared() -> System {
    let equations = |at: pilotage_expression::Point<'_>| {
        let rate = at.p[0] * at.p[0] * at.u[0];
        [vec![rate], vec![at.x[0]; 2]]
    };
    System::trace([1, 1, 1], equations).unwrap()
}

/// From θ = 0 to the θ that explains `x = slope t`, with `|x| ≤ limit`.
fn from_the_saddle<Q>(slope: f64, limit: f64) -> Solution
where
    Q: QpSolver<Collocation> + Default,
{
    let time: Vec<f64> = (0..6).map(|k| 0.2 * f64::from(k)).collect();
    let run = Run {
        mesh: time.clone(),
        inputs: vec![vec![1.0]; time.len()],
        measured: vec![Recording {
            values: time.iter().map(|t| slope * t).collect(),
            weight: 1.0,
            loss: Loss::Square,
        }],
        initial: vec![Some(0.0)],
        time,
        steps: pilotage_collocation::Steps::default(),
    };
    let scales = Scales {
        states: vec![1.0],
        parameters: vec![1.0],
    };
    let problem = Collocation::new(
        Arc::new(Differentiated::new(&squared())),
        constraints(1),
        Scheme::Trapezoid,
        vec![run],
        scales,
        &[Bound::at_samples(-limit, limit)],
    );
    let start = vec![0.0; problem.n_variables()];
    let options = SqpOptions::default();
    solve(&problem, &mut Q::default(), start, &options, &mut |_| {
        ControlFlow::Continue(())
    })
}

#[test]
fn a_fit_does_not_end_at_a_saddle() {
    // What is measured asks for θ = ±1.2; for θ = ±1, since x stays below 1; for θ = 0.
    for (slope, limit, theta) in [(1.44, 50.0, 1.2), (1.44, 1.0, 1.0), (-1.0, 50.0, 0.0)] {
        for solution in [
            from_the_saddle::<Condensed>(slope, limit),
            from_the_saddle::<SparseQp>(slope, limit),
        ] {
            assert_eq!(solution.status, Status::Converged, "{solution:?}");
            let found = solution.iterate.z.last().unwrap();
            assert!((found.abs() - theta).abs() < 1e-6, "{found} for {theta}");
            assert_eq!(solution.work.curvature_steps, usize::from(theta > 0.0));
            assert!(solution.curvature.unwrap() > 0.0, "{solution:?}");
        }
    }
}
