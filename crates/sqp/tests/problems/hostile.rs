//! Problems that nobody should pose: not defined in parts of their space, without bounds, without
//! variables, with contradictions. Whatever they are, a solve ends and says what it knows.

use super::draw::Draw;
use super::{Functions, Nlp, run};
use num_dual::DualNum;
use num_dual::HyperDual64 as H;
use pilotage_sqp::{Solution, Status};
use std::collections::BTreeMap;

/// One term, with two numbers in [-1, 1]; several are not finite, or not differentiable, somewhere.
fn term(kind: usize, a: f64, b: f64, x: H, y: H) -> H {
    match kind {
        0 => x * x * a + y * b,
        1 => x * y * a + x * x * x * b,
        2 => (x + a).ln() * b,
        3 => (y + a).sqrt() * b,
        4 => (x - a).recip() * b,
        5 => (x * y * 9.0).exp() * a,
        6 => (x * x * y * y).exp().exp() * b,
        7 => (x - y + a).sin() * 3.0,
        8 => x.powi(4) - y.powi(2) * (2.0 + a),
        9 => (x * x).sqrt().sqrt() * a + y * b,
        10 if x.re > a => H::from(f64::NAN),
        11 if y.re < a => H::from(f64::INFINITY) * b,
        12 if x.re * y.re > b => H::from(f64::NEG_INFINITY),
        _ => (x - a) * (x - a) + (y - b) * (y - b),
    }
}

/// Terms of a function: kind, numbers, which variables.
type Terms = Vec<(usize, f64, f64, usize, usize)>;

fn terms(draw: &mut Draw, n: usize) -> Terms {
    (0..1 + draw.below(3))
        .map(|_| {
            let variable = |draw: &mut Draw| draw.below(n.max(1));
            let (kind, i, j) = (draw.below(14), variable(draw), variable(draw));
            (kind, draw.one(), draw.one(), i, j)
        })
        .collect()
}

fn sum(terms: &Terms, z: &[H]) -> H {
    let at = |i: usize| z.get(i).copied().unwrap_or(H::from(0.0));
    let values = terms
        .iter()
        .map(|&(kind, a, b, i, j)| term(kind, a, b, at(i), at(j)));
    values.fold(H::from(0.0), |sum, value| sum + value)
}

/// A random problem with its start.
fn problem(seed: u64) -> (Nlp<impl Functions>, Vec<f64>) {
    let mut draw = Draw::new(seed);
    let n = draw.below(5);
    let several = |draw: &mut Draw, at_most: usize| -> Vec<Terms> {
        (0..draw.below(at_most + 1))
            .map(|_| terms(draw, n))
            .collect()
    };
    let objective = terms(&mut draw, n);
    let (equalities, inequalities) = (several(&mut draw, 2), several(&mut draw, 3));
    let limits: Vec<(f64, f64)> = (inequalities.iter())
        .map(|_| match draw.below(4) {
            0 => (draw.one(), f64::INFINITY),
            1 => (f64::NEG_INFINITY, draw.one()),
            2 => (-0.5, 0.5 + draw.one().abs()),
            _ => (0.25, 0.25),
        })
        .collect();
    let size = [1.0, 1.0, 1e3, 1e150][draw.below(4)];
    let start = draw.vector(n).into_iter().map(|v| size * v).collect();
    let functions = move |z: &[H], c: &mut Vec<H>, g: &mut Vec<H>| {
        c.extend(equalities.iter().map(|terms| sum(terms, z)));
        g.extend(inequalities.iter().map(|terms| sum(terms, z)));
        sum(&objective, z)
    };
    (Nlp::new(functions, &limits, n), start)
}

/// What must hold whatever the problem is.
fn assert_honest(seed: u64, solution: &Solution) {
    let Solution {
        status,
        iterate,
        kkt,
        curvature,
        ..
    } = solution;
    if *status != Status::UndefinedStart {
        let all = iterate.z.iter().chain(&iterate.c).chain(&iterate.g);
        assert!(
            iterate.f.is_finite() && all.clone().all(|v| v.is_finite()),
            "{seed}: {solution:?}"
        );
    }
    if *status == Status::Converged {
        assert!(kkt.residual() <= 1e-8, "{seed}: {solution:?}");
        assert!(curvature.is_none_or(|c| c >= -1e-8), "{seed}: {solution:?}");
    }
    if *status == Status::Infeasible {
        assert!(kkt.primal > 1e-8, "{seed}: {solution:?}");
    }
}

#[test]
fn a_solve_ends_whatever_the_problem_is() {
    let mut ended: BTreeMap<&str, usize> = BTreeMap::new();
    for seed in 0..600 {
        let (nlp, start) = problem(seed);
        let solution = run(&nlp, &start);
        assert_honest(seed, &solution);
        *ended.entry(solution.status.as_str()).or_default() += 1;
    }
    // The generator reaches all that it is for.
    for status in [
        "converged",
        "infeasible",
        "no-progress",
        "undefined-start",
        "unbounded",
    ] {
        assert!(ended.contains_key(status), "{ended:?}");
    }
}

#[test]
fn nothing_to_choose() {
    let none: fn(&[H], &mut Vec<H>, &mut Vec<H>) -> H = |_, _, _| H::from(3.0);
    let solution = run(&Nlp::new(none, &[], 0), &[]);
    assert_eq!(
        (solution.status, solution.curvature),
        (Status::Converged, Some(1.0))
    );

    let equality: fn(&[H], &mut Vec<H>, &mut Vec<H>) -> H = |_, c, _| {
        c.push(H::from(1.0));
        H::from(3.0)
    };
    assert_eq!(
        run(&Nlp::new(equality, &[], 0), &[]).status,
        Status::Infeasible
    );

    let inequality: fn(&[H], &mut Vec<H>, &mut Vec<H>) -> H = |_, _, g| {
        g.push(H::from(1.0));
        H::from(3.0)
    };
    for (limits, status) in [
        ((0.0, 2.0), Status::Converged),
        ((2.0, 3.0), Status::Infeasible),
    ] {
        assert_eq!(run(&Nlp::new(inequality, &[limits], 0), &[]).status, status);
    }
}

#[test]
fn a_start_out_of_the_domain_is_said_so() {
    let root: fn(&[H], &mut Vec<H>, &mut Vec<H>) -> H = |z, _, _| z[0].sqrt();
    // Not defined; defined, but without a derivative.
    for start in [-1.0, f64::NAN, f64::INFINITY, 0.0] {
        let solution = run(&Nlp::new(root, &[], 1), &[start]);
        assert_eq!(solution.status, Status::UndefinedStart, "{start}");
        assert!(solution.kkt.residual().is_nan() && solution.curvature.is_none());
    }
}
