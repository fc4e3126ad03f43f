//! Times the fit of the shipped trials with every scheme, on one core:
//!
//! ```text
//! cargo bench --bench solve
//! cargo bench --bench solve -- --solution FILE    also writes the default fit's θ and states as JSON
//! ```

use pilotage::identification::{Fit, Options, SchemeName, TrialSet, fit};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/trials/trials.toml");
    let set = TrialSet::read(&[manifest])?;
    println!(
        "{:<16} {:>8} {:>10} {:>8}  {:<10} objective [m²]",
        "scheme", "unknowns", "iterations", "seconds", "status"
    );
    for scheme in SchemeName::ALL {
        let options = Options {
            scheme,
            ..Options::default()
        };
        let fit = fit(&set.fit, &options, &mut |_| ControlFlow::Continue(()))?;
        println!(
            "{:<16} {:>8} {:>10} {:>8.2}  {:<10} {:.9}",
            scheme.as_str(),
            fit.unknowns,
            fit.iterations,
            fit.seconds,
            fit.status,
            fit.objective
        );
        if let Some(file) = solution_file().filter(|_| scheme == Options::default().scheme) {
            std::fs::write(file, json(&fit))?;
        }
    }
    Ok(())
}

/// The argument after `--solution`.
fn solution_file() -> Option<PathBuf> {
    std::env::args()
        .skip_while(|a| a != "--solution")
        .nth(1)
        .map(PathBuf::from)
}

/// θ, objective, and the states at the boundaries of each run; numbers in full precision.
fn json(fit: &Fit) -> String {
    let runs: Vec<String> = (fit.runs.iter())
        .map(|run| format!("{{\"name\": {:?}, \"states\": {:?}}}", run.name, run.states))
        .collect();
    format!(
        "{{\"objective\": {:?}, \"theta\": {:?}, \"runs\": [{}]}}\n",
        fit.objective,
        fit.theta,
        runs.join(", ")
    )
}
