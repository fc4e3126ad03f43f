//! Losses other than squares: derivatives against differences, both QP paths against each other, and estimates
//! against what defines them.

use num_dual::DualNum;
use pilotage_collocation::{
    Bound, Collocation, Condensed, Differentiated, Loss, ParameterConstraints, Recording, Run,
    Scales, Scheme,
};
use pilotage_expression::System;
use pilotage_sqp::problem::Pattern;
use pilotage_sqp::{
    Hessian, Iterate, Problem, QpSolver, Solution, SparseProblem, SparseQp, SqpOptions, Status,
    Step,
};
use std::ops::ControlFlow;
use std::sync::Arc;

const LOSSES: [Loss; 5] = [
    Loss::Square,
    Loss::Linear,
    Loss::Student { dof: 3.0 },
    Loss::Absolute { smoothing: 0.2 },
    Loss::Huber { threshold: 0.7 },
];

/// Numbers within ±1 without a pattern.
fn scattered(k: usize) -> f64 {
    (12.9898 * k as f64 + 1.0).sin()
}

/// Two states, two parameters, two measured outputs and a bounded one, all nonlinear.
fn problem(scheme: Scheme, losses: [Loss; 2]) -> Collocation {
    let system = System::trace([2, 0, 2], |at| {
        let (x, v, a, b) = (at.x[0], at.x[1], at.p[0], at.p[1]);
        let rates = vec![v, -a * x - b * v * v + at.time.cos()];
        [rates, vec![x + a * x * v, x * x * b.exp(), x * v]]
    });
    let time: Vec<f64> = (0..7).map(|k| 0.2 * f64::from(k)).collect();
    let recorded = |(k, loss): (usize, Loss)| {
        let value = |i| {
            if i % 4 == 2 {
                f64::NAN
            } else {
                scattered(7 * k + i)
            }
        };
        Recording {
            values: (0..time.len()).map(value).collect(),
            weight: 0.7 + k as f64,
            loss,
        }
    };
    let run = Run {
        mesh: vec![0.0, 0.5, 0.9, 1.2],
        inputs: vec![vec![]; time.len()],
        measured: losses.into_iter().enumerate().map(recorded).collect(),
        initial: vec![None, Some(0.3)],
        time,
        steps: pilotage_collocation::Steps::default(),
    };
    let scales = Scales {
        states: vec![1.3, 0.8],
        parameters: vec![0.9, 1.1],
    };
    let model = Arc::new(Differentiated::new(&system.unwrap()));
    let free = ParameterConstraints::default();
    let bounds = [Bound::at_samples(-3.0, 3.0)];
    Collocation::new(model, free, scheme, vec![run.clone(), run], scales, &bounds)
}

fn problems() -> impl Iterator<Item = Collocation> {
    let schemes = [Scheme::Trapezoid, Scheme::Gauss(2), Scheme::Bernstein(3)];
    let with =
        move |loss| schemes.map(|scheme| problem(scheme, [loss, Loss::Student { dof: 1.0 }]));
    LOSSES.into_iter().flat_map(with)
}

fn iterate(problem: &Collocation) -> Iterate {
    let mut at = Iterate::new(problem, (0..problem.n_variables()).map(scattered).collect());
    at.lambda = (0..at.lambda.len()).map(|k| scattered(k + 50)).collect();
    at.eta = (0..at.eta.len()).map(|k| scattered(k + 99)).collect();
    at
}

fn add_transposed(pattern: &Pattern, values: &[f64], rows: &[f64], out: &mut [f64]) {
    for (&(i, j), v) in pattern.iter().zip(values) {
        out[j] += v * rows[i];
    }
}

fn lagrangian(problem: &Collocation, at: &Iterate, z: &[f64]) -> Vec<f64> {
    let patterns = (problem.equality_pattern(), problem.inequality_pattern());
    let (mut c, mut g) = (vec![0.0; patterns.0.len()], vec![0.0; patterns.1.len()]);
    problem.jacobians(z, &mut c, &mut g);
    let mut out = vec![0.0; z.len()];
    problem.gradient(z, &mut out);
    add_transposed(&patterns.0, &c, &at.lambda, &mut out);
    add_transposed(&patterns.1, &g, &at.eta, &mut out);
    out
}

/// `H d`, the Hessian being of this kind.
fn hessian_times(problem: &Collocation, at: &Iterate, kind: Hessian, d: &[f64]) -> Vec<f64> {
    let pattern = problem.hessian_pattern();
    let mut values = vec![0.0; pattern.len()];
    problem.hessian(&at.z, &at.lambda, &at.eta, kind, &mut values);
    let mut out = vec![0.0; d.len()];
    for (&(i, j), v) in pattern.iter().zip(values) {
        out[i] += v * d[j];
        if i != j {
            out[j] += v * d[i];
        }
    }
    out
}

/// Derivative along `d` of what `f` gives, by central differences of the fourth order.
fn along(f: impl Fn(&[f64]) -> Vec<f64>, z: &[f64], d: &[f64]) -> Vec<f64> {
    let h = 1e-3;
    let at = |s: f64| {
        f(&z.iter()
            .zip(d)
            .map(|(z, d)| z + s * h * d)
            .collect::<Vec<_>>())
    };
    let (far, near) = ([at(-2.0), at(2.0)], [at(-1.0), at(1.0)]);
    (0..near[0].len())
        .map(|i| (8.0 * (near[1][i] - near[0][i]) - (far[1][i] - far[0][i])) / (12.0 * h))
        .collect()
}

fn assert_near(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let bound = tolerance * (1.0 + expected.abs());
        assert!((found - expected).abs() < bound, "{found} for {expected}");
    }
}

fn direction(problem: &Collocation) -> Vec<f64> {
    (0..problem.n_variables())
        .map(|k| scattered(k + 500))
        .collect()
}

#[test]
fn gradients_and_exact_hessians_are_those_of_differences() {
    for problem in problems() {
        let (at, d) = (iterate(&problem), direction(&problem));
        let objective = |z: &[f64]| vec![Iterate::new(&problem, z.to_vec()).f];
        let mut gradient = vec![0.0; at.z.len()];
        problem.gradient(&at.z, &mut gradient);
        for k in 0..at.z.len() {
            let mut unit = vec![0.0; at.z.len()];
            unit[k] = 1.0;
            assert_near(&[gradient[k]], &along(objective, &at.z, &unit), 1e-8);
        }
        let expected = along(|z| lagrangian(&problem, &at, z), &at.z, &d);
        let found = hessian_times(&problem, &at, Hessian::Exact, &d);
        assert_near(&found, &expected, 1e-7);
    }
}

/// Gauss–Newton has `ℓ'(r)/r (∇hᵀd)²` for every term, and nothing for a linear one.
#[test]
fn gauss_newton_is_a_reweighted_square() {
    for problem in problems() {
        let (at, d) = (iterate(&problem), direction(&problem));
        let outputs = |z: &[f64]| -> Vec<f64> {
            let of_run = |j| problem.outputs_at_samples(z, j)[..2].concat();
            (0..2).flat_map(of_run).collect()
        };
        let changes = along(outputs, &at.z, &d);
        let recordings = problem.runs.iter().flat_map(|run| &run.measured);
        let terms = recordings.flat_map(|own| own.values.iter().map(move |y| (own, y)));
        let mut expected = 0.0;
        for (((own, y), output), change) in terms.zip(outputs(&at.z)).zip(changes) {
            let r = y - output;
            let reweighted = match own.loss {
                _ if y.is_nan() => 0.0,
                Loss::Square => 2.0,
                Loss::Linear => 0.0,
                Loss::Student { dof } => 2.0 * (dof + 1.0) / (dof + r * r),
                Loss::Huber { threshold } => 2.0 * (threshold / r.abs()).min(1.0),
                Loss::Absolute { smoothing: s } => 8.0_f64.sqrt() / (r * r + s * s).sqrt(),
            };
            expected += own.weight * reweighted * change * change;
        }
        let product = hessian_times(&problem, &at, Hessian::GaussNewton, &d);
        let found: f64 = product.iter().zip(&d).map(|(h, d)| h * d).sum();
        assert_near(&[found], &[expected], 1e-8);
    }
}

#[test]
fn the_condensed_qp_has_the_same_steps() {
    let mut exact = 0;
    for problem in problems() {
        let at = iterate(&problem);
        let (mut fast, mut general) = (Condensed::default(), SparseQp::default());
        fast.linearise(&problem, &at, true);
        general.linearise(&problem, &at, true);
        let general_qp: &mut dyn QpSolver<Collocation> = &mut general;
        assert_near(
            fast.lagrangian_gradient(),
            general_qp.lagrangian_gradient(),
            1e-12,
        );
        for (kind, damping) in [(Hessian::GaussNewton, 0.1), (Hessian::Exact, 30.0)] {
            let (mut step, mut other) = (Step::default(), Step::default());
            let outcome = fast.solve(&problem, kind, damping, &mut step);
            assert_eq!(
                outcome,
                general_qp.solve(&problem, kind, damping, &mut other)
            );
            if outcome.is_ok() {
                exact += usize::from(kind == Hessian::Exact);
                assert_near(&step.d, &other.d, 1e-8);
                assert_near(&step.lambda, &other.lambda, 1e-7);
                assert_near(&[step.slope], &[other.slope], 1e-7);
                assert_near(&[step.curvature], &[other.curvature], 1e-7);
            }
        }
    }
    assert!(exact > 6, "{exact}");
}

fn solved(problem: &Collocation, states: Vec<f64>, theta: &[f64]) -> [Solution; 2] {
    let states = vec![vec![states; problem.runs[0].time.len()]];
    let z = problem.variables(&states, theta);
    let options = SqpOptions::default();
    let quiet = |_: &_| ControlFlow::Continue(());
    let fast = &mut Condensed::default();
    let solutions = [
        pilotage_sqp::solve(problem, fast, z.clone(), &options, &mut { quiet }),
        pilotage_sqp::solve(problem, &mut SparseQp::default(), z, &options, &mut {
            quiet
        }),
    ];
    for solution in &solutions {
        assert_eq!(solution.status, Status::Converged, "{:?}", solution.kkt);
    }
    solutions
}

/// Data of `ẋ = -θ x` from 2 with θ = 0.8, and noise.
fn decay(count: usize, noise: impl Fn(usize) -> f64) -> (Vec<f64>, Vec<f64>) {
    let time: Vec<f64> = (0..count).map(|k| 0.05 * k as f64).collect();
    let values = time.iter().enumerate();
    let values = values.map(|(k, t)| 2.0 * (-0.8 * t).exp() + noise(k));
    let values = values.collect();
    (time, values)
}

/// The optimum of −2 log likelihood in sd is the root of the mean square residual, and θ that of least squares.
#[test]
fn a_noise_level_is_the_root_of_the_mean_square_residual() {
    let (time, data) = decay(41, |k| 0.05 * scattered(k));
    let run = |inputs: Vec<Vec<f64>>, measured: Vec<Recording>| Run {
        mesh: time.clone(),
        time: time.clone(),
        initial: vec![Some(2.0)],
        inputs,
        measured,
        steps: pilotage_collocation::Steps::default(),
    };
    let of = |values: Vec<f64>, loss: Loss| Recording {
        values,
        weight: 1.0,
        loss,
    };
    let posed = |system: System, run: Run| {
        let scales = Scales {
            states: vec![1.0],
            parameters: vec![1.0; system.parameters],
        };
        let (model, free) = (
            Arc::new(Differentiated::new(&system)),
            ParameterConstraints::default(),
        );
        Collocation::new(model, free, Scheme::Gauss(2), vec![run], scales, &[])
    };
    let plain = System::trace([1, 0, 1], |at| [vec![-at.p[0] * at.x[0]], vec![at.x[0]]]);
    let squares = run(vec![vec![]; 41], vec![of(data.clone(), Loss::Square)]);
    let squares = posed(plain.unwrap(), squares);
    let [least, _] = solved(&squares, vec![2.0], &[0.5]);
    let level = (least.iterate.f / 41.0).sqrt();

    let likely = System::trace([1, 1, 2], |at| {
        let (x, y, sd) = (at.x[0], at.u[0], at.p[1]);
        [vec![-at.p[0] * x], vec![(y - x) / sd, sd.ln() * 2.0]]
    });
    let zeros = vec![0.0; 41];
    let measured = vec![of(zeros.clone(), Loss::Square), of(zeros, Loss::Linear)];
    let run = run(data.iter().map(|y| vec![*y]).collect(), measured);
    let problem = posed(likely.unwrap(), run);
    for solution in solved(&problem, vec![2.0], &[0.5, 0.3]) {
        let found = problem.physical_theta(&solution.iterate.z);
        let theta = squares.physical_theta(&least.iterate.z)[0];
        assert_near(&found, &[theta, level], 1e-7);
    }
}

/// A constant from data with outliers: `x` alone is unknown.
fn constant(data: &[f64], loss: Loss) -> [f64; 2] {
    let system = System::trace([1, 0, 0], |at| [vec![at.x[0] * 0.0], vec![at.x[0]]]);
    let time: Vec<f64> = (0..data.len()).map(|k| k as f64).collect();
    let run = Run {
        mesh: vec![0.0, time[data.len() - 1]],
        inputs: vec![vec![]; data.len()],
        measured: vec![Recording {
            values: data.to_vec(),
            weight: 1.0,
            loss,
        }],
        initial: vec![None],
        time,
        steps: pilotage_collocation::Steps::default(),
    };
    let scales = Scales {
        states: vec![1.0],
        parameters: vec![],
    };
    let model = Arc::new(Differentiated::new(&system.unwrap()));
    let free = ParameterConstraints::default();
    let problem = Collocation::new(model, free, Scheme::Gauss(1), vec![run], scales, &[]);
    solved(&problem, vec![3.0], &[]).map(|solution| solution.iterate.z[0])
}

/// Ten numbers near 1 and two far away, whose mean is 3.
fn outliers() -> Vec<f64> {
    let mut data: Vec<f64> = (0..10).map(|k| 1.0 + 0.1 * scattered(k)).collect();
    data.extend([11.0, 15.0]);
    data
}

/// Where a function is least: on a fine grid, which golden sections improve.
fn least(cost: impl Fn(f64) -> f64) -> f64 {
    let grid = (0..2000).map(|k| 0.01 * f64::from(k));
    let best = grid.min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap();
    let (mut low, mut high) = (best - 0.01, best + 0.01);
    while high - low > 1e-9 {
        let part = 0.381_966 * (high - low);
        match cost(low + part) < cost(high - part) {
            true => high -= part,
            false => low += part,
        }
    }
    low
}

#[test]
fn students_loss_finds_the_most_likely_constant() {
    let (data, dof) = (outliers(), 2.0);
    let found = least(|x| {
        let terms = data.iter().map(|y| (1.0 + (y - x).powi(2) / dof).ln());
        terms.sum::<f64>() * (dof + 1.0)
    });
    assert!((found - 1.0).abs() < 0.2, "near the ten: {found}");
    assert_near(&constant(&data, Loss::Student { dof }), &[found; 2], 1e-6);
}

/// Where all ten are within the threshold k and the two beyond, the ten residuals add up to -2k.
#[test]
fn hubers_loss_finds_the_clipped_mean() {
    let (data, threshold) = (outliers(), 0.3);
    let found = least(|x| {
        let cost = |r: f64| {
            if r <= threshold {
                r * r
            } else {
                threshold * (2.0 * r - threshold)
            }
        };
        data.iter().map(|y| cost((y - x).abs())).sum()
    });
    let of_ten: f64 = data[..10].iter().sum();
    assert_near(&[found], &[(of_ten + 2.0 * threshold) / 10.0], 1e-7);
    assert_near(
        &constant(&data, Loss::Huber { threshold }),
        &[found; 2],
        1e-6,
    );
}

/// With a small smoothing the constant is the median; an odd number of data makes it one of them.
#[test]
fn the_absolute_loss_finds_the_median() {
    let mut data = outliers();
    data.truncate(11);
    let found = constant(&data, Loss::Absolute { smoothing: 1e-4 });
    data.sort_by(f64::total_cmp);
    assert!(
        found.iter().all(|x| (x - data[5]).abs() < 1e-3),
        "{found:?} {data:?}"
    );
}
