//! pilotage's side of the comparison with CasADi and IPOPT, driven by `benches/ipopt/race.py`: one request per line on
//! standard input (JSON), one answer per line on standard output, until the input ends.
//!
//! A request names a problem by `manifest`, `scheme` and `initial_state`. Without further fields the answer contains
//! the default starts, `candidates`. With a start `theta` and `max_iterations`, `max_seconds`, `tolerance` and
//! `repeats` the problem is solved from there, `repeats` times, each time with new working memory of the solver. The
//! answer then contains the scales, the start and the final point with its multipliers, and for each solve its
//! processor time `seconds` and its `wall_seconds`. If `log` is true it also contains every iteration, but the seconds
//! then include recording them.
//!
//! A request with `problem` names a problem file instead (posed.rs). It is solved on a coarser mesh first, as in a fit,
//! unless `at_once` is true.

mod posed;

use pilotage::collocation::{Collocation, Condensed, Scales};
use pilotage::identification::problem;
use pilotage::identification::solve::{SHORT_STEP, candidates};
use pilotage::identification::{FitOptions, InitialState, Progress, TrialSet, start};
use pilotage::sqp::{self, Iteration, Solution, Status};
use serde_json::{Value, json};
use std::io::Write;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};

type Failure = Box<dyn std::error::Error>;

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
    if let Some(path) = request["problem"].as_str() {
        return posed::answer(path.as_ref(), request);
    }
    let manifest = PathBuf::from(text(request, "manifest")?);
    let set = TrialSet::read(&[manifest])?;
    let initial_state = text(request, "initial_state")?;
    let options = FitOptions {
        scheme: text(request, "scheme")?.parse()?,
        initial_state: (InitialState::ALL.into_iter())
            .find(|s| s.as_str() == initial_state)
            .ok_or_else(|| format!("no initial state is called {initial_state}"))?,
        ..FitOptions::default()
    };
    match &request["theta"] {
        Value::Null => {
            let stick = |trial| start::implied_stick(trial, &options.vehicle);
            let sticks: Vec<_> = set.fit.iter().map(stick).collect();
            let quiet = &mut |_: &Progress<'_>| ControlFlow::Continue(());
            let candidates = candidates(&set.fit, &sticks, &options, quiet)?;
            let thetas: Vec<_> = candidates.all.iter().map(|start| &start.theta).collect();
            Ok(json!({ "candidates": thetas }))
        }
        theta => race(
            &set,
            &options,
            &serde_json::from_value::<Vec<f64>>(theta.clone())?,
            request,
        ),
    }
}

fn race(
    set: &TrialSet,
    options: &FitOptions,
    theta: &[f64],
    request: &Value,
) -> Result<Value, Failure> {
    let clock = Clock::start();
    let states: Vec<_> = (set.fit.iter())
        .map(|trial| start::joint_states(trial, options, theta))
        .collect();
    let problem = problem::response(&set.fit, options, Scales::of(&states, theta));
    let start = problem.variables(&states, theta);
    let (setup_seconds, _) = clock.seconds();

    let sqp_options = sqp::SqpOptions {
        tolerance: number(request, "tolerance")?,
        max_iterations: number(request, "max_iterations")? as usize,
        short_step: SHORT_STEP,
        ..sqp::SqpOptions::default()
    };
    let limit = Duration::from_secs_f64(number(request, "max_seconds")?);
    let (mut seconds, mut wall_seconds) = (Vec::new(), Vec::new());
    let wanted = request["log"] == true;
    let (mut solution, mut log) = (None, Vec::new());
    for _ in 0..number(request, "repeats")? as usize {
        log.clear();
        let mut record = |iteration: &Iteration| {
            if wanted {
                log.push(line(iteration));
            }
        };
        let clock = Clock::start();
        solution = Some(solve(
            &problem,
            start.clone(),
            &sqp_options,
            limit,
            &mut record,
        ));
        let (processor, wall) = clock.seconds();
        seconds.push(processor);
        wall_seconds.push(wall);
    }
    let Solution {
        status,
        iterate,
        kkt,
        work,
        ..
    } = solution.ok_or("repeats = 0: expected one at least")?;
    let scales = &problem.model.scales;
    Ok(json!({
        "scales": { "states": scales.states, "parameters": scales.parameters },
        "start": start,
        "setup_seconds": setup_seconds,
        "seconds": seconds,
        "wall_seconds": wall_seconds,
        "status": status.as_str(),
        "iterations": work.iterations,
        "evaluations": work.evaluations,
        "qps": work.qps,
        "log": log,
        "objective": iterate.f,
        "kkt": kkt.residual(),
        "theta": problem.physical_theta(&iterate.z),
        "z": iterate.z,
        "lambda": iterate.lambda,
        "eta": iterate.eta,
    }))
}

fn solve(
    problem: &Collocation,
    start: Vec<f64>,
    options: &sqp::SqpOptions,
    limit: Duration,
    record: &mut dyn FnMut(&Iteration),
) -> Solution {
    let clock = Instant::now();
    sqp::solve(
        problem,
        &mut Condensed::default(),
        start,
        options,
        &mut |iteration| {
            record(iteration);
            match clock.elapsed() < limit {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(Status::TimeLimit),
            }
        },
    )
}

fn line(iteration: &Iteration) -> Value {
    let kkt = iteration.kkt;
    json!({
        "number": iteration.number,
        "objective": iteration.objective,
        "primal": kkt.primal,
        "dual": kkt.dual,
        "complementarity": kkt.complementarity,
        "step": iteration.step,
        "length": iteration.length,
        "damping": iteration.damping,
        "penalty": iteration.penalty,
        "active": iteration.active,
        "model": iteration.model.as_str(),
    })
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
