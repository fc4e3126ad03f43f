//! pilotage's side of the comparison on problem files: from the start values of the file, without other starts and
//! without mesh refinement. The answer contains the fields of that for a data set, and the names of states and
//! parameters in the order of the unknowns.

use super::{Clock, Failure, number};
use pilotage::collocation::{Collocation, Scales, Scheme};
use pilotage::estimation::file::Mesh;
use pilotage::estimation::fit::{Solved, begin, nearer, solve};
use pilotage::estimation::posed::{Posed, Stands};
use pilotage::estimation::starts::starts;
use pilotage::estimation::{ProblemFile, part};
use pilotage::sqp::{Iteration, Problem, Status};
use serde_json::{Value, json};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

pub fn answer(path: &Path, request: &Value) -> Result<Value, Failure> {
    let clock = Clock::start();
    let mut file = ProblemFile::read(path)?;
    file.options.scheme.get_or_insert(Scheme::HermiteSimpson);
    file.options.mesh = Mesh::Samples;
    let posed = Posed::new(&file, &part::open)?;
    let (problem, start) = begin(&posed, &starts(&posed, 1)[0], &|| false);
    let (setup_seconds, _) = clock.seconds();
    let mut answer = json!({
        "states": posed.states.iter().map(|state| &state.name).collect::<Vec<_>>(),
        "parameters": parameters(&posed)?,
        "scales": scales(&problem.model.scales),
        "start": start,
        "probe": probe(&problem, &start),
        "factor": posed.factor,
        "setup_seconds": setup_seconds,
    });
    let (mut seconds, mut wall_seconds, mut last) = (Vec::new(), Vec::new(), None);
    for _ in 0..number(request, "repeats")? as usize {
        let from = (problem.clone(), start.clone());
        let clock = Clock::start();
        last = Some(run(&posed, from, request)?);
        let (processor, wall) = clock.seconds();
        seconds.push(processor);
        wall_seconds.push(wall);
    }
    let (solved, iterations) = last.ok_or("repeats = 0: expected one at least")?;
    let (problem, solution) = (solved.problem, solved.solution);
    let rest = json!({
        "seconds": seconds,
        "wall_seconds": wall_seconds,
        "status": solution.status.as_str(),
        "coarse_iterations": iterations[0],
        "iterations": iterations[1],
        "evaluations": solution.work.evaluations,
        "qps": solution.work.qps,
        "objective": solution.iterate.f,
        "kkt": solution.kkt.residual(),
        "end_scales": scales(&problem.model.scales),
        "theta": problem.physical_theta(&solution.iterate.z),
        "z": solution.iterate.z,
        "lambda": solution.iterate.lambda,
        "eta": solution.iterate.eta,
    });
    if let (Some(answer), Value::Object(rest)) = (answer.as_object_mut(), rest) {
        answer.extend(rest);
    }
    Ok(answer)
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
        if request["log"] == true {
            eprintln!("{}", super::line(iteration));
        }
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

/// Amplitude of the probe's shift from the start.
const PROBE: f64 = 0.1;

/// Names of the shared parameters in their order.
fn parameters<'p>(posed: &'p Posed<'_>) -> Result<Vec<&'p str>, Failure> {
    let mut names = vec![""; posed.shared];
    for (unknown, stands) in &posed.unknowns {
        match stands {
            Stands::Shared(k) => names[*k] = &unknown.name,
            _ => {
                return Err(
                    format!("{}: one value for all runs alone is raced", unknown.name).into(),
                );
            }
        }
    }
    Ok(names)
}
