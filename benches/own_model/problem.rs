//! Tracking data as recorded, with a user-defined model: 10 runs of 1,351 samples, two measured signals, 54,046
//! unknowns.

use num_dual::DualNum;
use pilotage_collocation::{
    Collocation, Differentiated, Loss, ParameterConstraints, Recording, Run, Scales, Scheme, solve,
};
use pilotage_expression::System;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

const RUNS: usize = 10;
const SAMPLES: usize = 1351;
/// Time between samples [s].
const STEP: f64 = 0.05;
/// Pilot: two coefficients of the denominator, two of the numerator; vehicle: gain and quadratic drag.
const TRUTH: [f64; 6] = [9.0, 5.0, 2.5, 4.0, 0.8, 0.05];

/// A vehicle `z̈ = k u - d ż |ż|`, smoothed, and a second-order pilot that sees target and position.
fn tracking() -> System {
    let traced = System::trace([4, 1, 6], |at| {
        let [z, v, a, b] = [at.x[0], at.x[1], at.x[2], at.x[3]];
        let stick = at.p[2] * a + at.p[3] * b;
        let drag = at.p[5] * v * (v * v + 0.01).sqrt();
        let seen = at.u[0] - z - at.p[0] * a - at.p[1] * b;
        [vec![v, at.p[4] * stick - drag, b, seen], vec![z, stick]]
    });
    traced.expect("the equations are expressions")
}

/// Results of a solve.
pub struct Figures {
    /// Number of unknowns.
    pub unknowns: usize,
    /// Number of iterations of the SQP.
    pub iterations: usize,
    /// Time per iteration [ms]: the minimum of several solves.
    pub milliseconds: f64,
    /// Largest relative error of θ, estimated from noisy data.
    pub error: f64,
}

fn run(model: &Differentiated, k: usize) -> Run {
    let time: Vec<f64> = (0..SAMPLES).map(|i| STEP * i as f64).collect();
    let target = |t: f64| {
        let sines = (1..6).map(|n| (0.4 * f64::from(n * n) * t + k as f64 * f64::from(n)).sin());
        sines.sum::<f64>()
    };
    let mut run = Run {
        mesh: time.clone(),
        inputs: time.iter().map(|t| vec![target(*t)]).collect(),
        measured: Vec::new(),
        initial: vec![Some(0.0); 4],
        time,
        steps: pilotage_collocation::Steps::default(),
    };
    let states = model.simulate(&run, &TRUTH, &[0.0; 4]);
    let outputs = states.iter().enumerate().map(|(i, x)| {
        let all = model.evaluate(run.time[i], x, &run.inputs[i], &TRUTH);
        // Noise that is the same on every machine.
        let noise = |n: usize| ((i * 7919 + k * 104_729 + n * 613) % 1000) as f64 / 500.0 - 1.0;
        [all[4] + 0.02 * noise(1), all[5] + 0.05 * noise(2)]
    });
    let outputs: Vec<[f64; 2]> = outputs.collect();
    run.measured = [(0, 2500.0), (1, 400.0)]
        .map(|(n, weight)| Recording {
            values: outputs.iter().map(|y| y[n]).collect(),
            weight,
            loss: Loss::Square,
        })
        .to_vec();
    run
}

/// Solves the problem several times from a start that is 30 % off, on one core.
pub fn measure() -> Figures {
    let model = Arc::new(Differentiated::new(&tracking()));
    let runs: Vec<Run> = (0..RUNS).map(|k| run(&model, k)).collect();
    let start: Vec<f64> = TRUTH.iter().map(|t| 1.3 * t).collect();
    let states: Vec<_> = (runs.iter())
        .map(|run| model.simulate(run, &start, &[0.0; 4]))
        .collect();
    let scales = Scales::of(&states, &start);
    let free = ParameterConstraints::default();
    let problem = Collocation::new(model, free, Scheme::Trapezoid, runs, scales, &[]);
    let z = problem.variables(&states, &start);
    let options = pilotage_sqp::SqpOptions::default();
    let mut figures = Figures {
        unknowns: z.len(),
        iterations: 0,
        milliseconds: f64::INFINITY,
        error: f64::NAN,
    };
    for _ in 0..5 {
        let clock = Instant::now();
        let quiet = &mut |_: &_| ControlFlow::Continue(());
        let solution = solve(&problem, z.clone(), &options, quiet);
        let each = clock.elapsed().as_secs_f64() * 1e3 / solution.work.iterations as f64;
        figures.milliseconds = figures.milliseconds.min(each);
        figures.iterations = solution.work.iterations;
        let theta = problem.physical_theta(&solution.iterate.z);
        let errors = theta
            .iter()
            .zip(TRUTH)
            .map(|(found, true_)| (found / true_ - 1.0).abs());
        figures.error = errors.fold(0.0, f64::max);
    }
    figures
}
