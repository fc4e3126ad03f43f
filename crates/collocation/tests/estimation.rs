//! Models of many sizes, from data whose parameters are known.

use num_dual::DualNum;
use pilotage_collocation::{
    Bound, Collocation, Condensed, Differentiated, Loss, ParameterConstraints, Recording, Run,
    Scales, Scheme, solve,
};
use pilotage_expression::System;
use pilotage_sqp::{Iteration, Solution, SparseQp, SqpOptions, Status};
use std::ops::ControlFlow;
use std::sync::Arc;

fn times(count: u32, step: f64) -> Vec<f64> {
    (0..count).map(|k| step * f64::from(k)).collect()
}

/// θ of a fit from this start by Gauss's method, and the solution.
fn fitted(
    system: &System,
    runs: Vec<Run>,
    start: &[f64],
    initial: &[f64],
    bounds: &[Bound],
) -> (Vec<f64>, Solution, Collocation) {
    by_scheme(Scheme::Gauss(2), system, runs, (start, initial), bounds)
}

fn by_scheme(
    scheme: Scheme,
    system: &System,
    runs: Vec<Run>,
    (start, initial): (&[f64], &[f64]),
    bounds: &[Bound],
) -> (Vec<f64>, Solution, Collocation) {
    let model = Arc::new(Differentiated::new(system));
    let states: Vec<_> = (runs.iter())
        .map(|run| model.simulate(run, start, initial))
        .collect();
    let scales = Scales::of(&states, start);
    let free = ParameterConstraints::default();
    let problem = Collocation::new(model, free, scheme, runs, scales, bounds);
    let z = problem.variables(&states, start);
    let quiet = &mut |_: &_| ControlFlow::Continue(());
    let solution = solve(&problem, z, &SqpOptions::default(), quiet);
    (
        problem.physical_theta(&solution.iterate.z),
        solution,
        problem,
    )
}

/// A chain of lags, each with a rate of its own: as many states, parameters and measured outputs as it is
/// long. The states of the exact solution are sums of exponentials; here the data are those of a simulation
/// in steps so small that its error does not show.
fn chain(length: usize) -> System {
    let traced = System::trace([length, 1, length], |at| {
        let before = |i: usize| if i == 0 { at.u[0] } else { at.x[i - 1] };
        let rates = (0..length).map(|i| at.p[i] * (before(i) - at.x[i]));
        [rates.collect(), at.x.to_vec()]
    });
    traced.unwrap()
}

/// A step through a chain, with known or free initial states.
fn step_through(length: usize, known: bool) -> (Vec<f64>, Solution, Collocation, Vec<f64>) {
    let truth: Vec<f64> = (0..length).map(|i| 1.5 + 0.4 * (i as f64).sin()).collect();
    let system = chain(length);
    let time = times(25, 0.4);
    let mut run = Run {
        mesh: times(97, 0.1),
        inputs: vec![vec![1.0]; time.len()],
        measured: Vec::new(),
        initial: vec![known.then_some(0.0); length],
        time,
        steps: pilotage_collocation::Steps::default(),
    };
    run.mesh[96] = run.time[24];
    let states = Differentiated::new(&system).simulate(&run, &truth, &vec![0.0; length]);
    let of = |i: usize| Recording {
        values: states.iter().map(|x| x[i]).collect(),
        weight: 1.0,
        loss: Loss::Square,
    };
    run.measured = (0..length).map(of).collect();
    let start: Vec<f64> = truth.iter().map(|t| 1.2 * t).collect();
    let (theta, solution, problem) = fitted(&system, vec![run], &start, &vec![0.0; length], &[]);
    (theta, solution, problem, truth)
}

fn assert_near(found: &[f64], truth: &[f64], tolerance: f64) {
    for (found, truth) in found.iter().zip(truth) {
        assert!(
            (found / truth - 1.0).abs() < tolerance,
            "{found} for {truth}"
        );
    }
}

#[test]
fn a_model_may_have_more_states_parameters_and_outputs_than_sixteen() {
    let (theta, solution, problem, truth) = step_through(20, true);
    assert!(Condensed::takes(&problem));
    assert_eq!(solution.status, Status::Converged);
    assert_near(&theta, &truth, 1e-5);
}

/// On the widest rows the fast QP leads where the general one does.
#[test]
fn wide_rows_lead_where_the_general_qp_leads() {
    let (theta, solution, problem, truth) = step_through(18, false);
    assert!(Condensed::takes(&problem));
    assert_eq!(solution.status, Status::Converged);
    assert_near(&theta, &truth, 1e-5);
    let states = vec![problem.states_at_samples(&solution.iterate.z, 0)];
    let nearby: Vec<f64> = theta.iter().map(|t| 1.05 * t).collect();
    let z = problem.variables(&states, &nearby);
    let (options, mut general) = (SqpOptions::default(), SparseQp::default());
    let quiet = &mut |_: &Iteration| ControlFlow::Continue(());
    let other = pilotage_sqp::solve(&problem, &mut general, z, &options, quiet);
    assert_eq!(other.status, Status::Converged);
    assert_near(&problem.physical_theta(&other.iterate.z), &theta, 1e-6);
}

/// `ẋ = a cos(ω t) + b u₁ u₂`: time, two inputs, an output that is measured and one within bounds.
#[test]
fn time_and_several_inputs_are_taken() {
    let system = System::trace([1, 2, 3], |at| {
        let rate = at.p[0] * (at.p[1] * at.time).cos() + at.p[2] * at.u[0] * at.u[1];
        [vec![rate], vec![at.x[0], at.x[0] * at.u[0]]]
    });
    let time = times(81, 0.05);
    let truth = [0.8, 2.0, -0.3];
    let run = Run {
        mesh: time.clone(),
        inputs: time.iter().map(|t| vec![*t, 2.0]).collect(),
        measured: vec![Recording {
            values: (time.iter().map(|t| 0.4 * (2.0 * t).sin() - 0.3 * t * t)).collect(),
            weight: 3.0,
            loss: Loss::Square,
        }],
        initial: vec![Some(0.0)],
        time,
        steps: pilotage_collocation::Steps::default(),
    };
    let start = [0.5, 1.8, 0.1];
    let free = [Bound::at_samples(-f64::INFINITY, f64::INFINITY)];
    let (theta, solution, _) = fitted(
        &system.clone().unwrap(),
        vec![run.clone()],
        &start,
        &[0.0],
        &free,
    );
    assert_eq!(solution.status, Status::Converged);
    assert_near(&theta, &truth, 1e-6);
    // x u₁ comes to -19; kept above -15, it lies on the bound somewhere.
    let (_, solution, problem) = fitted(
        &system.unwrap(),
        vec![run],
        &start,
        &[0.0],
        &[Bound::at_samples(-15.0, 20.0)],
    );
    assert_eq!(solution.status, Status::Converged);
    let bounded = &problem.outputs_at_samples(&solution.iterate.z, 0)[1];
    let least = bounded.iter().copied().fold(f64::INFINITY, f64::min);
    assert!((least + 15.0).abs() < 1e-6, "{least}");
}

/// Rows of equal times are counted each: θ is that of their mean with twice the weight, and the objective
/// has their scatter beside it.
#[test]
fn samples_of_one_instant_are_counted_each() {
    let system = System::trace([1, 0, 1], |at| [vec![-at.p[0] * at.x[0]], vec![at.x[0]]]).unwrap();
    let scatter = |k: usize| 0.03 * ((k * 37 % 11) as f64 - 5.0);
    let single = times(21, 0.1);
    let curve = |t: f64| 2.0 * (-0.7 * t).exp();
    let run = |time: Vec<f64>, values: Vec<f64>, weight: f64| Run {
        mesh: single.clone(),
        inputs: vec![vec![]; time.len()],
        measured: vec![Recording {
            values,
            weight,
            loss: Loss::Square,
        }],
        initial: vec![None],
        time,
        steps: pilotage_collocation::Steps::default(),
    };
    let first: Vec<f64> = single
        .iter()
        .enumerate()
        .map(|(k, t)| curve(*t) + scatter(k))
        .collect();
    let second: Vec<f64> = single
        .iter()
        .enumerate()
        .map(|(k, t)| curve(*t) - scatter(3 * k))
        .collect();
    let mean: Vec<f64> = first
        .iter()
        .zip(&second)
        .map(|(a, b)| 0.5 * (a + b))
        .collect();
    let twice: Vec<f64> = single.iter().flat_map(|t| [*t, *t]).collect();
    let both: Vec<f64> = first
        .iter()
        .zip(&second)
        .flat_map(|(a, b)| [*a, *b])
        .collect();
    let fit = |run: Run| {
        let (theta, solution, _) = fitted(&system, vec![run], &[1.0], &[1.5], &[]);
        assert_eq!(solution.status, Status::Converged);
        (theta[0], solution.iterate.f)
    };
    let (each, objective) = fit(run(twice, both, 1.0));
    let (of_means, smaller) = fit(run(single.clone(), mean, 2.0));
    assert!((each - of_means).abs() < 1e-9, "{each} {of_means}");
    let scattered: f64 = first
        .iter()
        .zip(&second)
        .map(|(a, b)| 0.5 * (a - b).powi(2))
        .sum();
    assert!((objective - smaller - scattered).abs() < 1e-9);
    assert!(scattered > 0.1);
}

/// `ẋ = u - a x` under a square wave, `y = x + b u`: each jump is two samples, before and after it, and stands on a
/// boundary of the mesh. The states are exact, interval by interval.
#[test]
fn inputs_jump_between_two_samples_of_one_instant() {
    let system = System::trace([1, 1, 2], |at| {
        let (x, u) = (at.x[0], at.u[0]);
        [vec![u - at.p[0] * x], vec![x + at.p[1] * u]]
    });
    let truth = [0.7, 2.0];
    let (mut time, mut inputs, mut values) = (vec![0.0], vec![vec![1.0]], Vec::new());
    let (mut x, mut u) = (0.0, 1.0);
    values.push(x + truth[1] * u);
    for k in 1..=80 {
        x = u / truth[0] + (x - u / truth[0]) * (-truth[0] * 0.1_f64).exp();
        for is_after in [false, true].into_iter().take(1 + usize::from(k % 10 == 0)) {
            u = if is_after { -u } else { u };
            time.push(0.1 * f64::from(k));
            inputs.push(vec![u]);
            values.push(x + truth[1] * u);
        }
    }
    let mut mesh = time.clone();
    mesh.dedup();
    let run = Run {
        mesh,
        inputs,
        measured: vec![Recording {
            values,
            weight: 1.0,
            loss: Loss::Square,
        }],
        initial: vec![Some(0.0)],
        time,
        steps: pilotage_collocation::Steps::default(),
    };
    let system = system.unwrap();
    let simulated = Differentiated::new(&system).simulate(&run, &truth, &[0.0]);
    assert!((simulated.last().unwrap()[0] - x).abs() < 1e-8);
    for (scheme, tolerance) in [
        (Scheme::HermiteSimpson, 1e-6),
        (Scheme::Trapezoid, 2e-3),
        (Scheme::Radau(3), 1e-6),
        (Scheme::Lobatto(3), 1e-6),
        (Scheme::Gauss(2), 1e-6),
    ] {
        let runs = vec![run.clone()];
        let start: (&[f64], &[f64]) = (&[0.5, 1.0], &[0.0]);
        let (theta, solution, _) = by_scheme(scheme, &system, runs, start, &[]);
        assert_eq!(solution.status, Status::Converged);
        assert_near(&theta, &truth, tolerance);
    }
}

#[test]
fn runs_that_break_the_contract_are_refused() {
    let system = System::trace([1, 1, 1], |at| {
        [vec![at.u[0] - at.p[0] * at.x[0]], vec![at.x[0]]]
    });
    let model = Arc::new(Differentiated::new(&system.unwrap()));
    let time = times(5, 0.1);
    let good = Run {
        mesh: time.clone(),
        inputs: vec![vec![1.0]; 5],
        measured: vec![Recording {
            values: vec![0.0; 5],
            weight: 1.0,
            loss: Loss::Square,
        }],
        initial: vec![None],
        time,
        steps: pilotage_collocation::Steps::default(),
    };
    let is_refused = |change: &dyn Fn(&mut Run)| {
        let mut run = good.clone();
        change(&mut run);
        let made = std::panic::AssertUnwindSafe(|| {
            let scales = Scales {
                states: vec![1.0],
                parameters: vec![1.0],
            };
            let free = ParameterConstraints::default();
            Collocation::new(
                model.clone(),
                free,
                Scheme::Trapezoid,
                vec![run],
                scales,
                &[],
            )
        });
        std::panic::catch_unwind(made).is_err()
    };
    assert!(!is_refused(&|_| {}));
    assert!(is_refused(&|run| run.mesh[4] = 0.35));
    assert!(is_refused(&|run| run.mesh[0] = 0.05));
    assert!(is_refused(&|run| run.mesh.swap(1, 2)));
    assert!(is_refused(&|run| run.time.swap(1, 2)));
    assert!(is_refused(&|run| run.inputs[3].clear()));
    assert!(is_refused(&|run| run.inputs.push(vec![1.0])));
    assert!(is_refused(&|run| run.measured[0].values.push(1.0)));
    assert!(is_refused(&|run| run.measured[0].values[2] = f64::INFINITY));
    assert!(is_refused(&|run| run.initial.push(None)));
}
