//! Derivatives of the outputs at a solution, against differences of simulations.

use nalgebra::DMatrix;
use pilotage_collocation::{
    Bound, Collocation, Condensed, Differentiated, Loss, ParameterConstraints, Quality, Recording,
    Run, Scales, Scheme, Sensitivities,
};
use pilotage_expression::System;
use pilotage_sqp::{Iterate, Problem, SqpOptions};
use std::ops::ControlFlow;
use std::sync::Arc;

/// Van der Pol's oscillator, driven; its outputs are of states and parameters.
fn oscillator() -> Arc<Differentiated> {
    let system = System::trace([2, 1, 2], |at| {
        let (x, v, u, mu, gain) = (at.x[0], at.x[1], at.u[0], at.p[0], at.p[1]);
        [
            vec![v, mu * (-x * x + 1.0) * v - x + gain * u],
            vec![x * gain, v + mu, x],
        ]
    });
    Arc::new(Differentiated::new(&system.unwrap()))
}

fn run(initial: [Option<f64>; 2], duration: f64) -> Run {
    let time: Vec<f64> = (0..31).map(|k| duration * f64::from(k) / 30.0).collect();
    let recording = |phase: f64| Recording {
        values: time.iter().map(|t| (t + phase).cos()).collect(),
        weight: 4.0,
        loss: Loss::Square,
    };
    Run {
        mesh: (0..121).map(|k| duration * f64::from(k) / 120.0).collect(),
        inputs: time.iter().map(|t| vec![(0.7 * t).sin()]).collect(),
        measured: vec![recording(0.0), recording(1.0)],
        initial: initial.to_vec(),
        time,
        steps: pilotage_collocation::Steps::default(),
    }
}

/// The outputs at the samples, simulated.
fn simulated(model: &Differentiated, run: &Run, theta: &[f64], initial: &[f64]) -> DMatrix<f64> {
    let quality = Quality {
        tolerance: 1e-12,
        magnitudes: vec![1.0; 2],
        most_steps: usize::MAX,
    };
    let course = model.course(run, theta, initial, &quality, &|| false);
    let states: Vec<Vec<f64>> = course.at_samples().cloned().collect();
    let outputs = |k: usize| model.evaluate(run.time[k], &states[k], &run.inputs[k], theta);
    DMatrix::from_fn(run.time.len(), 2, |k, output| outputs(k)[2 + output])
}

fn problem(scheme: Scheme, bounds: &[Bound]) -> Collocation {
    let model = oscillator();
    let runs = vec![run([None, Some(0.3)], 6.0), run([None, None], 4.0)];
    let scales = Scales {
        states: vec![2.0, 3.0],
        parameters: vec![0.7, 0.1],
    };
    let constraints = ParameterConstraints::trace(2, |p| vec![-p[1] + 0.5]).unwrap();
    Collocation::new(model, constraints, scheme, runs, scales, bounds)
}

fn solved(problem: &Collocation) -> Iterate {
    let model = &problem.model.tapes;
    let theta = [0.8, 0.3];
    let states = problem
        .runs
        .iter()
        .map(|run| model.simulate(run, &theta, &[0.9, 0.3]));
    let z = problem.variables(&states.collect::<Vec<_>>(), &theta);
    let options = SqpOptions::default();
    let see = &mut |_: &_| ControlFlow::Continue(());
    pilotage_collocation::solve(problem, z, &options, see).iterate
}

fn open() -> Bound {
    Bound::at_samples(f64::NEG_INFINITY, f64::INFINITY)
}

#[test]
fn derivatives_are_those_of_simulations() {
    for scheme in [Scheme::HermiteSimpson, Scheme::Radau(3), Scheme::Gauss(3)] {
        let problem = problem(scheme, &[open()]);
        let at = solved(&problem);
        let found = Sensitivities::new(&problem, &at).unwrap();
        let theta = problem.physical_theta(&at.z);
        for (j, own) in found.runs.iter().enumerate() {
            let initial = problem.states_at_samples(&at.z, j)[0].clone();
            let moved = |column: usize, by: f64| {
                let (mut theta, mut initial) = (theta.clone(), initial.clone());
                match column.checked_sub(2) {
                    None => theta[column] += by,
                    Some(k) => initial[own.free[k]] += by,
                }
                simulated(&problem.model.tapes, &problem.runs[j], &theta, &initial)
            };
            assert_eq!(own.outputs[0].ncols(), 2 + own.free.len());
            for column in 0..2 + own.free.len() {
                let h = 1e-4;
                let difference = (moved(column, h) - moved(column, -h)) / (2.0 * h);
                for (k, output) in own.outputs.iter().enumerate() {
                    let error = (output.column(column) - difference.column(k)).amax();
                    assert!(
                        error < 1e-4,
                        "{scheme}: output {k}, column {column}: {error}"
                    );
                }
            }
        }
    }
}

#[test]
fn active_constraints_are_told_in_units() {
    // The position of the first run would go beyond 1.1; the gain is kept below 0.5.
    let problem = problem(Scheme::HermiteSimpson, &[Bound::at_samples(-2.0, 1.1)]);
    let at = solved(&problem);
    let found = Sensitivities::new(&problem, &at).unwrap();
    let active = |j: usize| {
        let own = problem.layout.runs[j].inequalities();
        let (upper, at) = (problem.limits().1, &at);
        own.filter(|i| at.eta[*i] > 1e-3 && upper[*i] - at.g[*i] < 1e-6)
            .count()
    };
    for (j, own) in found.runs.iter().enumerate() {
        assert_eq!(own.active.nrows(), active(j));
    }
    assert!(found.runs.iter().any(|own| own.active.nrows() > 0));
    // The bounded output is the position: its gradient at the sample is that of the first output over the gain, which
    // the gain also multiplies; an upper bound allows what is against it.
    let gain = problem.physical_theta(&at.z)[1];
    let (j, own) = (found.runs.iter().enumerate())
        .find(|(_, own)| own.active.nrows() > 0)
        .unwrap();
    let states = problem.states_at_samples(&at.z, j);
    let matches_gradient = |k: usize| {
        let mut expected = own.outputs[0].row(k) / gain;
        expected[1] -= states[k][0] / gain;
        (expected + own.active.row(0)).amax() < 1e-9
    };
    assert!((0..states.len()).any(matches_gradient));
}

#[test]
fn too_many_free_unknowns_are_not_taken() {
    let system = System::trace([1, 0, 130], |at| {
        let sum = at.p.iter().fold(at.x[0] * 0.0, |sum, p| sum + *p);
        [vec![sum], vec![at.x[0]]]
    });
    let model = Arc::new(Differentiated::new(&system.unwrap()));
    let mut run = run([None, None], 1.0);
    run.inputs.iter_mut().for_each(Vec::clear);
    run.measured.truncate(1);
    run.initial.truncate(1);
    let scales = Scales {
        states: vec![1.0],
        parameters: vec![1.0; 130],
    };
    let free = ParameterConstraints::default();
    let problem = Collocation::new(model, free, Scheme::Trapezoid, vec![run], scales, &[]);
    assert!(!Condensed::takes(&problem));
    let at = Iterate::new(&problem, vec![0.0; problem.n_variables()]);
    assert!(Sensitivities::new(&problem, &at).is_none());
}
