//! From recorded flights to a pilot, through the library.
//!
//!     cargo run --release --example identify -- examples/trials/trials.toml
//!
//! Fits the vehicle's response, then the stick alone, and flies both pilots alone, from rest. The first
//! is the one that brings the vehicle nearest to where it was recorded; how much the second misses
//! depends on the flights (in the paper's Fig. 2 it never reaches the target).

use pilotage::identification::joint::Joint;
use pilotage::identification::statistics::rms;
use pilotage::identification::{FitOptions, Objective, TrialSet, fit, simulate};
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
