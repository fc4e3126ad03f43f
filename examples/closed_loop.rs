//! A pilot flies the quadcopter to a target, coupled by the co-simulation master, without FMUs.
//!
//!     cargo run --release --example closed_loop
//!
//! The smaller the communication step, the closer the coupled models come to the joint ODE. At a step of 50 ms, as in
//! recordings of humans, the choice of algorithm is visible.

use pilotage::cosim::{Algorithm, Clock, NativeComponent, SeriesRecorder, System, run};
use pilotage::estimation::evaluate::evaluate;
use pilotage::flights::options::InitialPosition;
use pilotage::models::{Model, Quadcopter};
use pilotage::{FlightOptions, Posed, Trial, TrialSet, open};
use std::error::Error;

/// `-0.03 (1 + 2.5 s) / (1 + s/6)³`: a pilot with a lead of 2.5 s and lags of half a second in total.
const THETA: [f64; 6] = [216.0, 108.0, 18.0, -6.48, -16.2, 0.0];
/// Close enough that the stick stays off its stops: the joint ODE has none.
const TARGET: f64 = 5.0;
const DURATION: f64 = 15.0;

fn main() -> Result<(), Box<dyn Error>> {
    let exact = joint_position()?;
    println!("position after {DURATION} s of the joint ODE: {exact:.6} m");
    println!("step [ms]  error of jacobi [m]  error of gauss-seidel [m]");
    for step in [0.05, 0.025, 0.0125, 0.00625] {
        let jacobi = coupled_position(step, Algorithm::Jacobi)? - exact;
        let gauss_seidel = coupled_position(step, Algorithm::GaussSeidel)? - exact;
        println!("{:>9}  {jacobi:>19.6}  {gauss_seidel:>25.6}", 1e3 * step);
    }
    Ok(())
}

/// Final position of the vehicle, coupled with the given communication step [s].
fn coupled_position(step: f64, algorithm: Algorithm) -> Result<f64, Box<dyn Error>> {
    let mut system = System::new();
    let pilot = NativeComponent::new(Model::pilot(&THETA, f64::INFINITY));
    let quadcopter = NativeComponent::new(Model::quadcopter(&Quadcopter::default()));
    system.add("pilot", Box::new(pilot))?;
    system.add("quadcopter", Box::new(quadcopter))?;
    system.connect("pilot.stick", "quadcopter.stick")?;
    system.connect("quadcopter.z", "pilot.position")?;
    system.set("pilot.target", &TARGET.to_string())?;

    let clock = Clock::new(0.0, DURATION, step)?;
    let mut recorder = SeriesRecorder::default();
    run(system, &clock, None, algorithm, &mut recorder)?;
    let position = recorder
        .series
        .column("quadcopter.z")
        .ok_or("no position recorded")?;
    Ok(position.values[position.values.len() - 1])
}

/// Final position of the vehicle if it is integrated with the pilot as one system.
fn joint_position() -> Result<f64, Box<dyn Error>> {
    let rows: String = (0..=300)
        .map(|k| format!("{},{TARGET},0\n", 0.05 * f64::from(k)))
        .collect();
    let trial = Trial::parse(format!("time,target,position\n{rows}").as_bytes(), "start")?;
    let flights = TrialSet {
        fit: vec![trial],
        validation: Vec::new(),
        notes: Vec::new(),
        files: Vec::new(),
    };
    let options = FlightOptions {
        theta: Some(THETA.to_vec()),
        initial_position: InitialPosition::Known,
        ..FlightOptions::default()
    };
    let problem = options.problem(&flights)?;
    let run = evaluate(&Posed::new(&problem, &open)?).runs.remove(0);
    Ok(run.predicted[0][run.predicted[0].len() - 1])
}
