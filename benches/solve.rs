//! Times the fit of the shipped trials with every scheme, on one core:
//!
//! ```text
//! cargo bench --bench solve
//! cargo bench --bench solve -- --solution FILE    also writes θ and the states as JSON
//! ```

use pilotage::identification::{Fit, FitError, FitOptions, InitialState, TrialSet, fit};
use pilotage::transcription::Scheme;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

const SCHEMES: [Scheme; 3] = [Scheme::Euler, Scheme::Trapezoid, Scheme::HermiteSimpson];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/trials/trials.toml");
    let set = TrialSet::read(&[manifest])?;
    println!(
        "{:<16} {:>8} {:>10} {:>8}  {:<10} objective [m²]",
        "scheme", "unknowns", "iterations", "seconds", "status"
    );
    let mut fits = Vec::new();
    for scheme in SCHEMES {
        let options = FitOptions {
            scheme,
            ..FitOptions::default()
        };
        let fit = fit(&set.fit, &options, &mut |_| ControlFlow::Continue(()))?;
        println!(
            "{:<16} {:>8} {:>10} {:>8.2}  {:<10} {:.9}",
            scheme.name(),
            fit.unknowns,
            fit.iterations,
            fit.seconds,
            fit.status,
            fit.objective
        );
        fits.push((scheme, fit));
    }
    if let Some(file) = solution_file() {
        // Near one optimum: every scheme from the default scheme's θ, as compare.py begins, at rest.
        let default = fits
            .iter()
            .find(|(scheme, _)| *scheme == FitOptions::default().scheme);
        let start = default.map(|(_, fit)| fit.theta.clone());
        let near = |scheme: Scheme| -> Result<String, FitError> {
            let options = FitOptions {
                scheme,
                start: start.clone(),
                initial_state: InitialState::AtRest,
                ..FitOptions::default()
            };
            let fit = fit(&set.fit, &options, &mut |_| ControlFlow::Continue(()))?;
            Ok(format!("{:?}: {}", scheme.name(), json(&fit)))
        };
        let solutions = SCHEMES
            .into_iter()
            .map(near)
            .collect::<Result<Vec<_>, _>>()?;
        std::fs::write(file, format!("{{{}}}\n", solutions.join(",\n")))?;
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
        "{{\"objective\": {:?}, \"theta\": {:?}, \"runs\": [{}]}}",
        fit.objective,
        fit.theta,
        runs.join(", ")
    )
}
