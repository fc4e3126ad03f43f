//! Times the fit of the shipped trials with every scheme, and a covariance relative to an iteration, on one core:
//!
//! ```text
//! cargo bench --bench solve
//! cargo bench --bench solve -- --solution FILE    also writes θ and the states as JSON
//! ```

use pilotage::collocation::Scheme;
use pilotage::estimation::refits::{covariance_by, uncertainty_by};
use pilotage::inference::Method;
use pilotage::sqp::SqpOptions;
use pilotage::{Fit, FlightOptions, Posed, ProblemFile, TrialSet, fit, open};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

const SCHEMES: [Scheme; 3] = [Scheme::Euler, Scheme::Trapezoid, Scheme::HermiteSimpson];

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/trials/trials.toml");
    let set = TrialSet::read(&[manifest])?;
    println!(
        "{:<16} {:>8} {:>10} {:>8}  {:<10} objective [m²]",
        "scheme", "unknowns", "iterations", "seconds", "status"
    );
    let mut last = Vec::new();
    for scheme in SCHEMES {
        let fit = fitted(&set, scheme, None)?;
        let solved = fit.solved.as_ref().ok_or("a fit without its solution")?;
        println!(
            "{:<16} {:>8} {:>10} {:>8.2}  {:<10} {:.9}",
            scheme.name(),
            solved.solution.iterate.z.len(),
            fit.starts.iter().map(|own| own.iterations).sum::<usize>(),
            fit.seconds.total(),
            fit.status,
            fit.objective
        );
        last = theta(&fit);
    }
    covariances(Path::new(env!("CARGO_MANIFEST_DIR")))?;
    if let Some(file) = solution_file() {
        // Near one optimum: every scheme starts from the default scheme's θ, the last one's, as in compare.py.
        let near = |scheme: Scheme| -> Result<String, Failure> {
            let fit = fitted(&set, scheme, Some(&last))?;
            Ok(format!("{:?}: {}", scheme.name(), json(&fit)))
        };
        let solutions: Result<Vec<_>, _> = SCHEMES.into_iter().map(near).collect();
        std::fs::write(file, format!("{{{}}}\n", solutions?.join(",\n")))?;
    }
    Ok(())
}

/// The fit of these flights from the default starts, or from θ alone.
fn fitted(set: &TrialSet, scheme: Scheme, start: Option<&[f64]>) -> Result<Fit, Failure> {
    let mut options = FlightOptions {
        theta: start.map(<[f64]>::to_vec),
        ..FlightOptions::default()
    };
    options.fit.scheme = Some(scheme);
    if start.is_some() {
        options.fit.starts = Some(1);
    }
    let problem = options.problem(set)?;
    let posed = Posed::new(&problem, &open)?;
    Ok(fit(&posed, &mut |_| ControlFlow::Continue(())))
}

/// The fitted θ.
fn theta(fit: &Fit) -> Vec<f64> {
    let all = (1..).map_while(|k| fit.value(&format!("pilot.theta{k}")));
    all.collect()
}

/// The argument after `--solution`.
fn solution_file() -> Option<PathBuf> {
    std::env::args()
        .skip_while(|a| a != "--solution")
        .nth(1)
        .map(PathBuf::from)
}

/// θ, objective, and each state at the samples of each run; numbers in full precision.
fn json(fit: &Fit) -> String {
    let runs: Vec<String> = (fit.runs.iter())
        .map(|run| format!("{{\"name\": {:?}, \"states\": {:?}}}", run.name, run.states))
        .collect();
    format!(
        "{{\"objective\": {:?}, \"theta\": {:?}, \"runs\": [{}]}}",
        fit.objective,
        theta(fit),
        runs.join(", ")
    )
}

/// For each example problem: time of an iteration at the end of the fit, and the cost of a covariance in iterations.
fn covariances(root: &Path) -> Result<(), Failure> {
    const AGAIN: u32 = 20;
    let methods = Method::ALL.map(Method::as_str).join(", ");
    println!(
        "\n{:<24} {:>9} {:>6}  in iterations: covariance ({methods}), with all that follows",
        "problem", "iteration", "runs"
    );
    for entry in std::fs::read_dir(root.join("examples/problems"))? {
        let path = entry?.path().join("problem.toml");
        let file = ProblemFile::read(&path)?;
        let posed = Posed::new(&file, &open)?;
        let found = fit(&posed, &mut |_| ControlFlow::Continue(()));
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
