//! Bounds at the samples, and conditions at the start or the end of a run, against analytic solutions.

use pilotage_collocation::{
    Bound, BoundAt, Collocation, Condensed, Differentiated, Loss, ParameterConstraints, Recording,
    Run, Scales, Scheme,
};
use pilotage_expression::System;
use pilotage_sqp::{QpSolver, Solution, SparseQp, SqpOptions, Status};
use std::ops::ControlFlow;
use std::sync::Arc;

fn bound(at: BoundAt, lower: f64, upper: f64) -> Bound {
    Bound {
        at,
        ..Bound::at_samples(lower, upper)
    }
}

fn run(initial: &[Option<f64>], recorded: Option<&dyn Fn(f64) -> f64>) -> Run {
    let time: Vec<f64> = (0..21).map(|k| 0.05 * f64::from(k)).collect();
    let recorded = recorded.map(|value| Recording {
        values: time.iter().map(|t| value(*t)).collect(),
        weight: 1.0,
        loss: Loss::Square,
    });
    Run {
        mesh: time.clone(),
        inputs: vec![vec![]; time.len()],
        measured: recorded.into_iter().collect(),
        initial: initial.to_vec(),
        time,
        steps: pilotage_collocation::Steps::default(),
    }
}

fn problem(system: &System, runs: Vec<Run>, bounds: &[Bound]) -> Collocation {
    let scales = Scales {
        states: vec![1.0; system.states],
        parameters: vec![1.0; system.parameters],
    };
    let model = Arc::new(Differentiated::new(system));
    let free = ParameterConstraints::default();
    Collocation::new(model, free, Scheme::Gauss(3), runs, scales, bounds)
}

fn solved<Q: QpSolver<Collocation> + Default>(problem: &Collocation, theta: &[f64]) -> Solution {
    let states = problem.runs.iter().map(|run| {
        let first = run.initial.iter().map(|known| known.unwrap_or(0.5));
        vec![first.collect(); run.time.len()]
    });
    let z = problem.variables(&states.collect::<Vec<_>>(), theta);
    let options = SqpOptions::default();
    pilotage_sqp::solve(problem, &mut Q::default(), z, &options, &mut |_| {
        ControlFlow::Continue(())
    })
}

/// Both QP paths converge; calls `check` with each solution.
fn with_both(problem: &Collocation, theta: &[f64], check: impl Fn(&Solution)) {
    for solution in [
        solved::<Condensed>(problem, theta),
        solved::<SparseQp>(problem, theta),
    ] {
        assert_eq!(solution.status, Status::Converged, "{:?}", solution.kkt);
        check(&solution);
    }
}

/// `v̇ = θ`, `ẋ = v` from rest: x(1) = θ/2.
fn driven() -> System {
    let equations = |at: pilotage_expression::Point<'_>| {
        let (x, v, theta) = (at.x[0], at.x[1], at.p[0]);
        [vec![v, theta], vec![x]]
    };
    System::trace([2, 0, 1], equations).unwrap()
}

/// Nothing is measured: the end alone says what θ is.
#[test]
fn the_state_at_the_end_gives_the_parameter() {
    let runs = vec![run(&[Some(0.0); 2], None)];
    let problem = problem(&driven(), runs, &[bound(BoundAt::End, 1.5, 1.5)]);
    with_both(&problem, &[0.2], |solution| {
        let found = problem.physical_theta(&solution.iterate.z)[0];
        assert!((found - 3.0).abs() < 1e-8, "{found}");
    });
}

/// Data ask for θ = 2; at the end x = θ/2 may be 0.6 at most, at the start it may be what it likes.
#[test]
fn a_limit_at_the_end_holds_there_alone() {
    let system = System::trace([2, 0, 1], |at| {
        let (x, v, theta) = (at.x[0], at.x[1], at.p[0]);
        [vec![v, theta], vec![v, x, x]]
    });
    let runs = vec![run(&[Some(0.0); 2], Some(&|t| 2.0 * t))];
    let limits = [
        bound(BoundAt::End, f64::NEG_INFINITY, 0.6),
        bound(BoundAt::Start, 0.0, 0.3),
    ];
    let problem = problem(&system.unwrap(), runs, &limits);
    with_both(&problem, &[0.2], |solution| {
        let found = problem.physical_theta(&solution.iterate.z)[0];
        assert!((found - 1.2).abs() < 1e-8, "{found}");
        // The multiplier is minus the slope of Σ (2t - θt)² by x(1) = θ/2.
        let squares: f64 = problem.runs[0].time.iter().map(|t| t * t).sum();
        let most = solution.iterate.eta.iter().fold(0.0, |m, y| y.max(m));
        assert!((most - 2.0 * 2.0 * 0.8 * squares).abs() < 1e-5, "{most}");
    });
}

/// `ẋ = z - θ x`, `ż = -z`: a start with `ẋ = 0` has `z₀ = θ x₀`. The data are of θ = 2 and x₀ = 1 with that start,
/// once exactly, once shifted: then the optimum is that of the formula for x in (x₀, θ), by hand.
#[test]
fn a_rate_that_is_zero_at_the_start_is_an_equation() {
    let system = System::trace([2, 0, 1], |at| {
        let rate = at.x[1] - at.p[0] * at.x[0];
        [vec![rate, -at.x[1]], vec![at.x[0], rate]]
    })
    .unwrap();
    // z₀ e^(-t) drives x: x = x₀ e^(-θt) + z₀ (e^(-t) - e^(-θt)) / (θ - 1).
    let formula = |x: f64, theta: f64, t: f64| {
        let (slow, fast) = ((-t).exp(), (-theta * t).exp());
        x * fast + theta * x * (slow - fast) / (theta - 1.0)
    };
    let still = [bound(BoundAt::Start, 0.0, 0.0)];
    let exact = |t: f64| formula(1.0, 2.0, t);
    let of_exact = problem(&system, vec![run(&[None; 2], Some(&exact))], &still);
    with_both(&of_exact, &[1.5], |solution| {
        let found = of_exact.physical_theta(&solution.iterate.z)[0];
        assert!((found - 2.0).abs() < 1e-6, "{found}");
    });
    let noisy = |t: f64| exact(t) + 0.05 * (17.0 * t).sin();
    let of_noisy = problem(&system, vec![run(&[None; 2], Some(&noisy))], &still);
    with_both(&of_noisy, &[1.5], |solution| {
        let (z, theta) = (&solution.iterate.z, of_noisy.theta(&solution.iterate.z)[0]);
        assert!((z[1] - theta * z[0]).abs() < 1e-8, "{z:?}");
        let cost = |x: f64, theta: f64| -> f64 {
            let times = of_noisy.runs[0].time.iter();
            times
                .map(|t| (noisy(*t) - formula(x, theta, *t)).powi(2))
                .sum()
        };
        let (least, h) = (cost(z[0], theta), 1e-4);
        assert!((solution.iterate.f - least).abs() < 1e-8);
        for (dx, dtheta) in [(h, 0.0), (0.0, h)] {
            let slope = cost(z[0] + dx, theta + dtheta) - cost(z[0] - dx, theta - dtheta);
            assert!((slope / (2.0 * h)).abs() < 1e-6, "{slope}");
        }
    });
}

/// Two conditions that exclude each other are none that a solver keeps.
#[test]
fn ends_that_exclude_each_other_are_not_met() {
    let system = System::trace([2, 0, 1], |at| {
        let (x, v, theta) = (at.x[0], at.x[1], at.p[0]);
        [vec![v, theta], vec![x, v]]
    });
    // x(1) = θ/2 and v(1) = θ.
    let ends = [bound(BoundAt::End, 1.5, 1.5), bound(BoundAt::End, 1.0, 1.0)];
    let runs = vec![run(&[Some(0.0); 2], None)];
    let problem = problem(&system.unwrap(), runs, &ends);
    for status in [
        solved::<Condensed>(&problem, &[0.2]).status,
        solved::<SparseQp>(&problem, &[0.2]).status,
    ] {
        assert_ne!(status, Status::Converged);
    }
}
