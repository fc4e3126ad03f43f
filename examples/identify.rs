//! Identifies a pilot from recorded flights, with the library.
//!
//!     cargo run --release --example identify -- examples/trials/trials.toml
//!
//! Fits the vehicle's response, then the stick only, and simulates the flights of both pilots from rest. The first
//! pilot brings the vehicle closest to its recorded positions; the error of the second depends on the flights (in the
//! paper's Fig. 2 it never reaches the target).

use pilotage::identification::joint::Joint;
use pilotage::identification::{FitOptions, Objective, TrialSet, fit, simulate};
use pilotage::inference::statistics::rms;
use std::error::Error;
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn Error>> {
    let paths: Vec<_> = std::env::args().skip(1).map(Into::into).collect();
    let trials = TrialSet::read(&paths)?.fit;
    for objective in Objective::ALL {
        let options = FitOptions {
            objective,
            ..FitOptions::default()
        };
        let fit = fit(&trials, &options, &mut |_| ControlFlow::Continue(()))?;
        let joint = Joint {
            vehicle: options.vehicle,
            pilot: options.pilot,
        };
        println!(
            "{} fit: {}, θ = {:.4?}",
            objective.as_str(),
            fit.status,
            fit.theta
        );
        for trial in &trials {
            let flown = simulate(&joint, &fit.theta, trial)?;
            println!(
                "  {}: flown alone, rms {:.3} m",
                trial.name,
                rms(&flown.residual)
            );
        }
    }
    Ok(())
}
