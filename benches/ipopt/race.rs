//! pilotage's side of the comparison with CasADi and IPOPT, driven by `benches/ipopt/race.py`: one request per line on
//! standard input (JSON), one answer per line on standard output, until the input ends.
//!
//! A request names a problem file by `problem`, or flights by `manifest`, `scheme` and `initial_state`, with the start
//! `theta`; without `theta` the answer contains the first default starts of these flights, `candidates`. The samples are
//! the mesh. The problem is solved from its start alone, `repeats` times, each time with new working memory, with
//! `max_iterations`, `max_seconds` and `tolerance`; on a coarser mesh first, as in a fit, unless `at_once` is true. The
//! answer contains what the problem is, the scales, the start and the final point with its multipliers, and for each
//! solve its processor time `seconds` and its `wall_seconds`.

use pilotage::collocation::{Collocation, Scales, Scheme};
use pilotage::estimation::file::Mesh;
use pilotage::estimation::fit::{nearer, solve};
use pilotage::estimation::posed::Stands;
use pilotage::estimation::search::begin::begin;
use pilotage::estimation::search::solved::Solved;
use pilotage::estimation::starts::starts;
use pilotage::flights::options::InitialState;
use pilotage::sqp::{Iteration, Problem, Status};
use pilotage::{FlightOptions, Posed, ProblemFile, TrialSet, open};
use serde_json::{Value, json};
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

type Failure = Box<dyn std::error::Error>;

/// Amplitude of the probe's shift from the start.
const PROBE: f64 = 0.1;

fn main() -> Result<(), Failure> {
    for line in std::io::stdin().lines() {
        let request: Value = serde_json::from_str(&line?)?;
        let answer = answer(&request).unwrap_or_else(|e| json!({ "error": e.to_string() }));
        println!("{answer}");
        std::io::stdout().flush()?;
    }
    Ok(())
}

fn answer(request: &Value) -> Result<Value, Failure> {
    let clock = Clock::start();
    let path = request["problem"].as_str();
    let mut file = match path {
        Some(path) => ProblemFile::read(Path::new(path))?,
        None => flights(request)?,
    };
    file.options.scheme.get_or_insert(Scheme::HermiteSimpson);
    file.options.mesh = Mesh::Samples;
    file.options.tolerance = number(request, "tolerance")?;
    let mut posed = Posed::new(&file, &open)?;
    if path.is_none() {
        // Objectives are in m².
        posed.factor = 1.0;
        if request["theta"].is_null() {
            return Ok(json!({ "candidates": candidates(&posed) }));
        }
    }
    let from = begin(&posed, &starts(&posed, 1)[0], &|| false);
    let (setup_seconds, _) = clock.seconds();
    race(&posed, from, request, setup_seconds)
}

/// The problem of flights.
fn flights(request: &Value) -> Result<ProblemFile, Failure> {
    let set = TrialSet::read(&[PathBuf::from(text(request, "manifest")?)])?;
    let initial_state = text(request, "initial_state")?;
    let mut options = FlightOptions {
        theta: serde_json::from_value(request["theta"].clone())?,
        initial_state: (InitialState::ALL.into_iter())
            .find(|own| own.as_str() == initial_state)
            .ok_or_else(|| format!("no initial state is called {initial_state}"))?,
        ..FlightOptions::default()
    };
    options.fit.scheme = Some(text(request, "scheme")?.parse()?);
    Ok(options.problem(&set)?)
}

/// θ of the first starts that differ in it.
fn candidates(posed: &Posed<'_>) -> Vec<Vec<f64>> {
    const COUNT: usize = 3;
    let all = starts(posed, COUNT).into_iter();
    let mut all: Vec<_> = all.map(|start| start.parameters).collect();
    all.dedup();
    all
}

fn race(
    posed: &Posed<'_>,
    from: (Collocation, Vec<f64>),
    request: &Value,
    setup_seconds: f64,
) -> Result<Value, Failure> {
    let (mut seconds, mut wall_seconds, mut last) = (Vec::new(), Vec::new(), None);
    for _ in 0..number(request, "repeats")? as usize {
        let from = from.clone();
        let clock = Clock::start();
        last = Some(run(posed, from, request)?);
        let (processor, wall) = clock.seconds();
        seconds.push(processor);
        wall_seconds.push(wall);
    }
    let (solved, iterations) = last.ok_or("repeats = 0: expected one at least")?;
    let ((begun, start), Solved { problem, solution }) = (from, solved);
    Ok(json!({
        "states": posed.states.iter().map(|state| &state.name).collect::<Vec<_>>(),
        "parameters": parameters(posed)?,
        "scales": scales(&begun.model.scales),
        "bound_sizes": begun.bounds.iter().map(|own| own.size).collect::<Vec<_>>(),
        "start": start,
        "probe": probe(&begun, &start),
        "factor": posed.factor,
        "setup_seconds": setup_seconds,
        "seconds": seconds,
        "wall_seconds": wall_seconds,
        "status": solution.status.as_str(),
        "coarse_iterations": iterations[0],
        "iterations": iterations[1],
        "objective": solution.iterate.f,
        "kkt": solution.kkt.residual(),
        "end_scales": scales(&problem.model.scales),
        "theta": problem.physical_theta(&solution.iterate.z),
        "z": solution.iterate.z,
        "lambda": solution.iterate.lambda,
        "eta": solution.iterate.eta,
    }))
}

/// A solve, and its numbers of iterations on the coarse mesh and on the fine one.
fn run(
    posed: &Posed<'_>,
    from: (Collocation, Vec<f64>),
    request: &Value,
) -> Result<(Solved, [usize; 2]), Failure> {
    let limit = Duration::from_secs_f64(number(request, "max_seconds")?);
    let most = number(request, "max_iterations")? as usize;
    let (clock, iterations) = (Instant::now(), AtomicUsize::new(0));
    let see = |iteration: &Iteration| {
        iterations.fetch_add(usize::from(iteration.number > 0), Ordering::Relaxed);
        match clock.elapsed() < limit {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(Status::TimeLimit),
        }
    };
    let from = match request["at_once"] == true {
        true => from,
        false => nearer(posed, from, most, &see).0,
    };
    let before = iterations.swap(0, Ordering::Relaxed);
    let solved = solve(posed, from, most, &see);
    Ok((solved, [before, iterations.into_inner()]))
}

fn scales(scales: &Scales) -> Value {
    json!({ "states": scales.states, "parameters": scales.parameters })
}

/// Objective, and sums of squares of the equalities and of the limited signals, at the start shifted in proportion to
/// sin k in unknown k: another program with the same three values poses the same problem.
fn probe(problem: &Collocation, start: &[f64]) -> Value {
    let shifted = start.iter().enumerate();
    let z: Vec<f64> = shifted
        .map(|(k, value)| value + PROBE * (k as f64).sin())
        .collect();
    let mut equalities = vec![0.0; problem.n_equalities()];
    let mut inequalities = vec![0.0; problem.limits().0.len()];
    let objective = problem.evaluate(&z, &mut equalities, &mut inequalities);
    let limited = &inequalities[..problem.layout.parameter_constraints];
    let squares = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    json!([objective, squares(&equalities), squares(limited)])
}

/// Names of the shared parameters in their order.
fn parameters<'p>(posed: &'p Posed<'_>) -> Result<Vec<&'p str>, Failure> {
    let mut names = vec![""; posed.shared];
    for (unknown, stands) in &posed.unknowns {
        let Stands::Shared(k) = stands else {
            let message = format!("{}: one value for all runs alone is raced", unknown.name);
            return Err(message.into());
        };
        names[*k] = &unknown.name;
    }
    Ok(names)
}

/// Processor time of this process and wall time.
struct Clock {
    processor: f64,
    wall: Instant,
}

impl Clock {
    fn start() -> Self {
        Self {
            processor: processor_seconds(),
            wall: Instant::now(),
        }
    }

    /// Processor time and wall time since the start [s].
    fn seconds(&self) -> (f64, f64) {
        let wall = self.wall.elapsed().as_secs_f64();
        (processor_seconds() - self.processor, wall)
    }
}

/// Processor time of all threads of this process [s].
#[cfg(unix)]
fn processor_seconds() -> f64 {
    use rustix::time::{ClockId, clock_gettime};
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Wall time, if the system has no such clock.
#[cfg(not(unix))]
fn processor_seconds() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}

fn text<'a>(request: &'a Value, field: &str) -> Result<&'a str, Failure> {
    Ok(request[field]
        .as_str()
        .ok_or_else(|| format!("{field}: expected a text"))?)
}

fn number(request: &Value, field: &str) -> Result<f64, Failure> {
    Ok(request[field]
        .as_f64()
        .ok_or_else(|| format!("{field}: expected a number"))?)
}
