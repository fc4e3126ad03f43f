//! Identifies a pilot from recorded flights, with the library.
//!
//!     cargo run --release --example identify -- examples/trials/trials.toml
//!
//! Fits the vehicle's response, then the stick only, and simulates the flights of both pilots from rest. The first
//! pilot brings the vehicle closest to its recorded positions; the error of the second depends on the flights (in the
//! paper's Fig. 2 it never reaches the target).

use pilotage::estimation::evaluate::evaluate;
use pilotage::flights::options::Objective;
use pilotage::inference::statistics::rms;
use pilotage::{FlightOptions, Posed, TrialSet, fit, open};
use std::error::Error;
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn Error>> {
    let paths: Vec<_> = std::env::args().skip(1).map(Into::into).collect();
    let flights = TrialSet::read(&paths)?;
    for objective in Objective::ALL {
        let options = FlightOptions {
            objective,
            ..FlightOptions::default()
        };
        let problem = options.problem(&flights)?;
        let found = fit(&Posed::new(&problem, &open)?, &mut |_| {
            ControlFlow::Continue(())
        });
        let theta: Vec<f64> = (1..=2 * options.order)
            .filter_map(|k| found.value(&format!("pilot.theta{k}")))
            .collect();
        println!(
            "{} fit: {}, θ = {theta:.4?}",
            objective.as_str(),
            found.status
        );

        // The loop of this pilot and the vehicle, without the optimiser.
        let alone = FlightOptions {
            theta: Some(theta),
            ..FlightOptions::default()
        };
        let problem = alone.problem(&flights)?;
        for run in evaluate(&Posed::new(&problem, &open)?).runs {
            let pairs = run.recorded[0].iter().zip(&run.predicted[0]);
            let off = rms(&pairs.map(|(y, h)| y - h).collect::<Vec<f64>>());
            println!("  {}: flown alone, rms {off:.3} m", run.name);
        }
    }
    Ok(())
}
