//! An answer: several starts, finer meshes, and the controls integrated again.

mod describe;
mod mesh;
mod replay;
mod starts;

use crate::interior;
use crate::interior::Iteration;
use crate::interior::Options;
use crate::interior::Solution;
use crate::interior::Status;
use crate::pose::Posed;
use crate::program::Program;
pub(crate) use describe::trajectory;
pub use describe::{Active, Moment};
use describe::{active, costates, singular};
use mesh::finer;
pub use mesh::{carried, even, mesh_errors};
use rayon::prelude::*;
pub use replay::{Certificate, replay};
pub use starts::start;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// How hard to look.
#[derive(Debug, Clone)]
pub struct Effort {
    /// Number of starts, with the given one.
    pub starts: usize,
    /// Largest number of times that the mesh is refined.
    pub rounds: usize,
    /// Permitted local error of the states, and change of the objective by a finer mesh.
    pub mesh_tolerance: f64,
    /// Iteration limit of each solve.
    pub most_iterations: usize,
}

impl Default for Effort {
    fn default() -> Self {
        Self {
            starts: 3,
            rounds: 8,
            mesh_tolerance: 1e-6,
            most_iterations: 500,
        }
    }
}

/// First barrier parameter from a point that is nearly optimal.
const WARM: f64 = 1e-4;
/// Largest number of intervals.
const MOST_INTERVALS: usize = 4000;
/// Fewest steps of the replay.
const STEPS: usize = 4000;

const AGREEMENT: f64 = 1e-4;
/// Objectives that differ less are those of one optimum.
const SAME: f64 = 1e-5;

/// What an answer is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// A local optimum whose replay agrees.
    Optimal,
    /// A converged program whose replay agrees, on a mesh that was not to be refined: what a finer one changes is not known.
    Converged,
    /// A converged program whose replay differs, or that finer meshes still change: no optimum of the problem.
    Inaccurate,
    /// No start met the constraints.
    Infeasible,
    /// No start converged.
    NotConverged,
    /// Ended by the user.
    Stopped,
}

impl Verdict {
    /// Its name in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Optimal => "optimal",
            Self::Converged => "converged",
            Self::Inaccurate => "inaccurate",
            Self::Infeasible => "infeasible",
            Self::NotConverged => "not converged",
            Self::Stopped => "stopped",
        }
    }
}

/// How a start ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Ended {
    /// Its status.
    pub status: Status,
    /// Its objective.
    pub objective: f64,
    /// Its number of iterations.
    pub iterations: usize,
    /// What they took \[s\].
    pub seconds: f64,
}

/// The answer to a problem.
#[derive(Debug, Clone)]
pub struct Answer {
    /// What it is worth.
    pub verdict: Verdict,
    /// The objective.
    pub objective: f64,
    /// Duration \[s\].
    pub duration: f64,
    /// The parameters that were sought.
    pub parameters: Vec<f64>,
    /// The trajectory, at nodes and midpoints.
    pub trajectory: Vec<Moment>,
    /// Costates of the states at the nodes, of the scaled program.
    pub costates: Vec<Vec<f64>>,
    /// The replay.
    pub certificate: Certificate,
    /// What is active.
    pub active: Vec<Active>,
    /// The constraint that is violated most, if any is.
    pub violated: Option<String>,
    /// All starts.
    pub starts: Vec<Ended>,
    /// Controls on whose values nothing depends over a part of the path: they are not at a limit and singular there.
    pub singular: Vec<String>,
    /// Objective on each mesh, with its number of intervals.
    pub meshes: Vec<(usize, f64)>,
    /// Largest local error of the states on the last mesh.
    pub mesh_error: f64,
    /// Residual of the optimality conditions.
    pub kkt: f64,
    /// Iterations of all solves.
    pub iterations: usize,
}

/// What sees each iteration and may stop.
pub type Observer<'o> = dyn FnMut(&Iteration) -> ControlFlow<()> + Send + 'o;

/// An observer of solves on several threads.
struct Watched<'o> {
    observer: Mutex<&'o mut Observer<'o>>,
    is_stopped: AtomicBool,
}

impl Watched<'_> {
    /// Shows an iteration; false if the solves should stop.
    fn sees(&self, iteration: &Iteration) -> bool {
        let mut observer = self.observer.lock().expect("no observer panics");
        if observer(iteration).is_break() {
            self.is_stopped.store(true, Ordering::Relaxed);
        }
        !self.is_stopped.load(Ordering::Relaxed)
    }
}

/// Solves a posed problem. The observer sees each iteration and may stop.
pub fn optimise(posed: &Posed, effort: &Effort, observer: &mut Observer<'_>) -> Answer {
    let watched = Watched {
        observer: Mutex::new(observer),
        is_stopped: AtomicBool::new(false),
    };
    let options = Options {
        tolerance: posed.tolerance,
        most_iterations: effort.most_iterations,
        ..Options::default()
    };
    let mut program = posed.program(even(posed.intervals));
    let begin = |k: usize| {
        let clock = Instant::now();
        let z = start(posed, &program, k);
        let found = match posed.earlier.is_some() && k == 0 {
            true => warm(&program, z, &options, &watched),
            false => interior::solve(&program, z, &options, &mut |at| watched.sees(at)),
        };
        (found, clock.elapsed().as_secs_f64())
    };
    // An earlier answer is one more start.
    let count = effort.starts.max(1) + usize::from(posed.earlier.is_some());
    let all: Vec<(Solution, f64)> = (0..count).into_par_iter().map(begin).collect();
    let mut starts: Vec<Ended> = all
        .iter()
        .map(|(found, seconds)| Ended {
            status: found.status,
            objective: found.objective,
            iterations: found.iterations,
            seconds: *seconds,
        })
        .collect();
    // The first of equal ones.
    let better = |a: Solution, b: Solution| if rank(&b) < rank(&a) { b } else { a };
    let best = all.into_iter().map(|(found, _)| found).reduce(better);
    let mut best = best.expect("a start at least");
    let mut meshes = vec![(program.intervals(), best.objective)];
    let mut errors = mesh_errors(posed, &program, &best.z);
    let is_settled = |meshes: &[(usize, f64)]| {
        let [.., (_, before), (_, last)] = meshes else {
            return false;
        };
        (before - last).abs() <= effort.mesh_tolerance * last.abs().max(1e-3)
    };
    let mut iterations: usize = starts.iter().map(|own| own.iterations).sum();
    let mut accurate = false;
    for _ in 0..effort.rounds {
        if best.status != Status::Converged {
            break;
        }
        accurate =
            errors.iter().all(|error| *error <= effort.mesh_tolerance) && is_settled(&meshes);
        let mesh = finer(&program, &best.z, &errors, effort.mesh_tolerance);
        if accurate || mesh.len() > MOST_INTERVALS + 1 {
            break;
        }
        let next = posed.program(mesh);
        let z = carried(posed, &program, &best.z, &next);
        let found = warm(&next, z, &options, &watched);
        iterations += found.iterations;
        if found.status != Status::Converged {
            break;
        }
        (program, best) = (next, found);
        meshes.push((program.intervals(), best.objective));
        errors = mesh_errors(posed, &program, &best.z);
    }
    let mesh_error = errors.iter().fold(0.0_f64, |m, error| m.max(*error));
    accurate = accurate || (mesh_error <= effort.mesh_tolerance && is_settled(&meshes));
    let parts = STEPS.div_ceil(program.intervals());
    let certificate = replay(posed, &program, &best.z, parts);
    let far = (certificate.objective - best.objective).abs() / best.objective.abs().max(1e-3);
    let meets = certificate.is_whole && certificate.violation <= AGREEMENT;
    let agrees = certificate.is_whole && far <= AGREEMENT && certificate.violation <= AGREEMENT;
    let verdict = match best.status {
        _ if watched.is_stopped.into_inner() => Verdict::Stopped,
        Status::Converged if agrees && accurate => Verdict::Optimal,
        Status::Converged if agrees && effort.rounds == 0 => Verdict::Converged,
        Status::Converged => Verdict::Inaccurate,
        // What meets all limits when it is flown is not infeasible.
        _ if starts.iter().all(|own| own.status == Status::Infeasible) && !meets => {
            Verdict::Infeasible
        }
        _ => Verdict::NotConverged,
    };
    let sign = if posed.is_maximised { -1.0 } else { 1.0 };
    starts.iter_mut().for_each(|own| own.objective *= sign);
    meshes.iter_mut().for_each(|own| own.1 *= sign);
    Answer {
        verdict,
        objective: sign * best.objective,
        duration: posed.seconds(&theta(posed, &program, &best.z)),
        parameters: theta(posed, &program, &best.z),
        trajectory: trajectory(posed, &program, &best.z),
        costates: costates(&program, &best),
        active: active(posed, &program, &best),
        // The optimiser spreads a violation over the defects; the replay, which has none, shows what cannot be met.
        violated: Some(certificate.violated.clone())
            .filter(|name| best.status != Status::Converged && !name.is_empty()),
        certificate: Certificate {
            objective: sign * certificate.objective,
            ..certificate
        },
        singular: singular(posed, &program, &best),
        starts,
        meshes,
        mesh_error,
        kkt: best.kkt,
        iterations,
    }
}

/// Solves from a point that is nearly optimal; if that fails, as from any other. The iterations are those of both.
fn warm(program: &Program, z: Vec<f64>, options: &Options, watched: &Watched<'_>) -> Solution {
    let low = Options {
        barrier: WARM,
        ..options.clone()
    };
    let mut watch = |at: &Iteration| watched.sees(at);
    let found = interior::solve(program, z.clone(), &low, &mut watch);
    if matches!(found.status, Status::Converged | Status::Stopped) {
        return found;
    }
    let mut again = interior::solve(program, z, options, &mut watch);
    again.iterations += found.iterations;
    again
}

/// Order of solutions: converged ones by objective, then others by violation.
fn rank(found: &Solution) -> (u8, f64) {
    match found.status {
        Status::Converged => (0, found.objective),
        Status::Infeasible => (2, found.violation),
        _ => (1, found.violation),
    }
}

impl Answer {
    /// Number of starts that ended at the best objective, and of those that converged.
    pub fn agreeing(&self) -> (usize, usize) {
        let converged = || {
            self.starts
                .iter()
                .filter(|own| own.status == Status::Converged)
        };
        let best = self.meshes[0].1;
        let same =
            converged().filter(|own| (own.objective - best).abs() <= SAME * best.abs().max(1e-3));
        (same.count(), converged().count())
    }
}

/// Parameters in their units.
pub fn theta(posed: &Posed, program: &Program, z: &[f64]) -> Vec<f64> {
    let own = z[program.theta()..].iter().zip(&posed.parameters);
    own.map(|(value, own)| value * own.scale).collect()
}
