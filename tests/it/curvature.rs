//! The second-order condition of a collocation problem: on the reduced variables and on all of them.

use crate::random_collocation::{Draw, Random, iterate, problem};
use pilotage::sqp::curvature::{Activity, activities};
use pilotage::sqp::problem::Pattern;
use pilotage::sqp::{Curvature, Hessian, Iterate, Problem, QpSolver, SparseProblem, SparseQp};
use pilotage::transcription::Condensed;

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

/// Asserts that the direction lies in the critical cone, has unit length and the curvature that is said
/// of it.
fn assert_direction(seed: u64, problem: &Random, at: &Iterate, found: &Curvature) {
    let d = &found.direction;
    let weighted = d.iter().zip(problem.damping_weights());
    let length: f64 = weighted.map(|(d, w)| w * d * d).sum();
    assert!((length - 1.0).abs() < 1e-8, "{seed}: {length}");
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
