//! A user-defined vehicle, written once: fitted, driven by the master, and simulated.
//!
//!     cargo run --release --example own_model
//!
//! A second-order pilot drives a rover on a line towards moving targets. A fit of the recorded position and stick
//! recovers the pilot's four parameters and the rover's drag, although both signals are noisy, with standard deviations.
//! The same `Rover` then drives in a co-simulation; `pilotage pack` would make an FMU of it.

use nalgebra::{DMatrix, DVector};
use pilotage::collocation::{
    Bound, Collocation, Differentiated, Loss, ParameterConstraints, Recording, Run, Scales, Scheme,
    Sensitivities, Sensitivity, solve,
};
use pilotage::cosim::{Algorithm, Clock, NativeComponent, SeriesRecorder, System, run};
use pilotage::expression::Model;
use pilotage::inference::{self, Data, Inference, Method};
use pilotage::models::{Model as BuiltIn, traced};
use pilotage::sqp::{Iterate, SqpOptions, Status};
use pilotage_sdk::{At, Equations, Scalar, Table};
use std::error::Error;
use std::ops::ControlFlow;
use std::sync::Arc;

/// The pilot's θ, then the rover's drag \[1/m\].
const TRUTH: [f64; 5] = [9.0, 5.0, 3.0, 4.5, 0.25];
const SAMPLES: usize = 401;
const STEP: f64 = 0.05;
/// Standard deviations of the noise of position \[m\] and stick.
const NOISE: [f64; 2] = [0.02, 0.01];

struct Rover;

impl Equations for Rover {
    fn table(&self) -> Table {
        Table::new("rover", "A rover on a line, with quadratic drag.")
            .input("stick", "1", "Stick, full ahead is 1")
            .parameter("thrust", "m/s2", 2.0, "Acceleration at full stick")
            .parameter("drag", "1/m", 0.25, "Drag, per speed squared")
            .output_state("position", "m", 0.0, "Position")
            .state("speed", "m/s", 0.0, "Speed")
    }

    fn derivative<T: Scalar>(&self, At { x, u, p, .. }: At<T>, dx: &mut [T]) {
        dx[0] = x[1];
        // |v| v, smooth at rest.
        dx[1] = u[0] * p[0] - p[1] * x[1] * (x[1] * x[1] + 1e-4).sqrt();
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    // Pilot and rover as one system of equations: θ and the drag are estimated.
    let pilot = traced(&BuiltIn::pilot(&[0.0; 4], 1.0))?.with_values([("stick_limit", 1.0)])?;
    let rover = traced(&Rover)?.with_values([("thrust", 2.0)])?;
    let parts = [("pilot", pilot), ("rover", rover)];
    let wires = [
        ("pilot.stick", "rover.stick"),
        ("rover.position", "pilot.position"),
    ];
    let names = ["rover.position", "pilot.stick", "pilot.stick"];
    let system = Model::join(&parts, &wires)?.observed(&names)?;
    let model = Arc::new(Differentiated::new(&system));

    // Three runs; the noise has standard deviations of 2 cm and 1 % of the stick, which determine the weights.
    let runs: Vec<Run> = (1..=3).map(|k| recorded(&model, k)).collect();
    let start = TRUTH.map(|t| 0.7 * t);
    let states: Vec<_> = runs
        .iter()
        .map(|run| model.simulate(run, &start, &[0.0; 4]))
        .collect();
    let scales = Scales::of(&states, &start);
    let free = ParameterConstraints::default();
    // The stick is measured, and also bounded: it has stops.
    let bounds = [Bound::at_samples(-1.0, 1.0)];
    let problem = Collocation::new(
        model,
        free,
        Scheme::HermiteSimpson,
        runs.clone(),
        scales,
        &bounds,
    );
    let z = problem.variables(&states, &start);
    let solution = solve(&problem, z, &SqpOptions::default(), &mut |_| {
        ControlFlow::Continue(())
    });
    if solution.status != Status::Converged {
        return Err(format!("the fit ended with {}", solution.status).into());
    }
    let found = problem.physical_theta(&solution.iterate.z);
    println!(
        "{} unknowns, {} iterations",
        solution.iterate.z.len(),
        solution.work.iterations
    );
    let deviations = deviations(&problem, &runs, &solution.iterate)?;
    for (k, (found, truth)) in found.iter().zip(TRUTH).enumerate() {
        let name = if k < 4 {
            format!("theta{}", k + 1)
        } else {
            "drag".into()
        };
        let sd = deviations[k];
        println!("{name:<7} {found:8.4} ± {sd:.4}   (true: {truth})");
    }
    println!(
        "the pilot found drives the rover to {:.3} m",
        driven(&found)?
    );
    Ok(())
}

/// Standard deviations of the parameters: the linearised fit as a regression, each row a residual in standard deviations of
/// its noise.
fn deviations(
    problem: &Collocation,
    runs: &[Run],
    at: &Iterate,
) -> Result<Vec<f64>, Box<dyn Error>> {
    let derivatives = Sensitivities::new(problem, at).ok_or("the equations are singular")?;
    let p = problem.n_parameters();
    let row_of_run = |(j, (run, own)): (usize, (&Run, &Sensitivity))| {
        let predicted = problem.outputs_at_samples(&at.z, j);
        let rows = NOISE.len() * SAMPLES;
        let of = |row: usize| (row / SAMPLES, row % SAMPLES);
        // Columns of θ first; those of free initial states, of which there are none here, would follow.
        let column =
            |row: usize, c: usize| own.outputs[of(row).0][(of(row).1, c)] / NOISE[of(row).0];
        let residual = |row: usize, _| {
            let (k, i) = of(row);
            (run.measured[k].values[i] - predicted[k][i]) / NOISE[k]
        };
        inference::Run {
            shared: DMatrix::from_fn(rows, p, column),
            own: DMatrix::from_fn(rows, own.free.len(), |row, c| column(row, p + c)),
            own_scales: own.scales.clone().into(),
            residuals: DVector::from_fn(rows, residual),
            time: (0..rows).map(|row| run.time[of(row).1]).collect(),
            signals: (0..NOISE.len())
                .map(|k| k * SAMPLES..(k + 1) * SAMPLES)
                .collect(),
            prior: rows..rows,
            // Where a bound holds, the fit cannot move.
            active: own.active.clone(),
        }
    };
    let rows = runs
        .iter()
        .zip(&derivatives.runs)
        .enumerate()
        .map(row_of_run);
    let data = Data::of(rows.collect());
    let inference = Inference::new(&data)?;
    // The noise of the recordings is white. `None` chooses the method by the residuals.
    Ok(inference.covariance(Some(Method::Plain))?.deviations())
}

/// A run to a moving target, with noise that is the same on every machine.
fn recorded(model: &Differentiated, number: usize) -> Run {
    let time: Vec<f64> = (0..SAMPLES).map(|i| STEP * i as f64).collect();
    let target = |t: f64| (0.3 * number as f64 * t).sin() + 0.3 * (1.1 * t).sin();
    let mut run = Run {
        mesh: time.clone(),
        inputs: time.iter().map(|t| vec![target(*t)]).collect(),
        measured: Vec::new(),
        initial: vec![Some(0.0); 4],
        time,
        steps: pilotage_collocation::Steps::default(),
    };
    let states = model.simulate(&run, &TRUTH, &[0.0; 4]);
    run.measured = NOISE
        .iter()
        .enumerate()
        .map(|(k, sd)| {
            let value = |(i, x): (usize, &Vec<f64>)| {
                let clean = model.evaluate(run.time[i], x, &run.inputs[i], &TRUTH)[4 + k];
                let noise = ((i * 7919 + k * 104_729 + number * 613) % 1000) as f64 / 500.0 - 1.0;
                clean + 3.0_f64.sqrt() * sd * noise
            };
            Recording {
                values: states.iter().enumerate().map(value).collect(),
                weight: sd.powi(-2),
                loss: Loss::Square,
            }
        })
        .collect();
    run
}

/// Position of the rover after 20 s in the co-simulation master, with its target 1 m ahead.
fn driven(found: &[f64]) -> Result<f64, Box<dyn Error>> {
    let mut system = System::new();
    let pilot = NativeComponent::new(BuiltIn::pilot(&found[..4], 1.0));
    system.add("pilot", Box::new(pilot))?;
    system.add("rover", Box::new(NativeComponent::new(Rover)))?;
    system.connect("pilot.stick", "rover.stick")?;
    system.connect("rover.position", "pilot.position")?;
    system.set("pilot.target", "1")?;
    system.set("rover.drag", &found[4].to_string())?;
    let clock = Clock::new(0.0, 20.0, 0.01)?;
    let mut recorder = SeriesRecorder::default();
    run(system, &clock, None, Algorithm::GaussSeidel, &mut recorder)?;
    let position = recorder
        .series
        .column("rover.position")
        .ok_or("no position")?;
    Ok(position.values[position.values.len() - 1])
}
