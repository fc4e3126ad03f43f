//! Times the fit of the shipped trials with every scheme, and a covariance relative to an iteration, on one core:
//!
//! ```text
//! cargo bench --bench solve
//! cargo bench --bench solve -- --solution FILE    also writes θ and the states as JSON
//! ```

use pilotage::collocation::Scheme;
use pilotage::estimation::refits::{covariance_by, uncertainty_by};
use pilotage::estimation::{Posed, ProblemFile, part};
use pilotage::identification::{Fit, FitError, FitOptions, InitialState, TrialSet, fit};
use pilotage::inference::Method;
use pilotage::sqp::SqpOptions;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

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
    covariances(Path::new(env!("CARGO_MANIFEST_DIR")))?;
    if let Some(file) = solution_file() {
        // Near one optimum: every scheme starts from the default scheme's θ, as in compare.py, at rest.
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

/// For each example problem: time of an iteration at the end of the fit, and the cost of a covariance in iterations.
fn covariances(root: &Path) -> Result<(), Box<dyn std::error::Error>> {
    const AGAIN: u32 = 20;
    let methods = Method::ALL.map(Method::as_str).join(", ");
    println!(
        "\n{:<24} {:>9} {:>6}  in iterations: covariance ({methods}), with all that follows",
        "problem", "iteration", "runs"
    );
    for entry in std::fs::read_dir(root.join("examples/problems"))? {
        let path = entry?.path().join("problem.toml");
        let file = ProblemFile::read(&path)?;
        let posed = Posed::new(&file, &part::open)?;
        let found = pilotage::estimation::fit(&posed, &mut |_| ControlFlow::Continue(()));
        let Some(solved) = found.solved.as_ref().filter(|_| posed.filter.is_none()) else {
            continue;
        };
        // Start beside the solution, so that iterations remain.
        let mut z = solved.solution.iterate.z.clone();
        let first = solved.problem.layout.theta;
        z[first..].iter_mut().for_each(|own| *own *= 1.02);
        let options = SqpOptions {
            max_iterations: AGAIN as usize,
            ..SqpOptions::default()
        };
        let clock = Instant::now();
        let last = pilotage::collocation::solve(&solved.problem, z, &options, &mut |_| {
            ControlFlow::Continue(())
        });
        let iteration = clock.elapsed().as_secs_f64() / last.work.iterations.max(1) as f64;
        let times = |of: &dyn Fn(Method)| {
            let share = |method: Method| {
                let clock = Instant::now();
                (0..AGAIN).for_each(|_| of(method));
                let one = clock.elapsed().as_secs_f64() / f64::from(AGAIN);
                format!("{:>4.2}", one / iteration)
            };
            Method::ALL.map(share).join(", ")
        };
        let alone = times(&|method| drop(covariance_by(&posed, &found, method)));
        let all = times(&|method| drop(uncertainty_by(&posed, &found, method)));
        println!(
            "{:<24} {:>6.2} ms {:>6}  {alone}   {all}",
            path.parent()
                .and_then(Path::file_name)
                .unwrap_or_default()
                .display(),
            1e3 * iteration,
            posed.runs.len(),
        );
    }
    Ok(())
}
