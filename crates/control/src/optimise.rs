//! An answer: several starts, finer meshes, and the controls integrated again.

use crate::interior::{self, Iteration, Options, Solution, Status};
use crate::pose::{Posed, bare_run};
use crate::program::{Place, Program, Shape};
use pilotage_collocation::{Differentiated, Quality};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
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

/// Largest number of intervals.
const MOST_INTERVALS: usize = 2000;
/// Second difference of a control, relative to its range, from which an interval is divided: it jumps there, or bends.
const BENT: f64 = 0.02;
/// Relative error of the replay, and how far it may be from what the optimiser says.
const REPLAY: f64 = 1e-10;
const AGREEMENT: f64 = 1e-4;
/// Objectives that differ less are those of one optimum.
const SAME: f64 = 1e-5;

/// What an answer is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// A local optimum whose replay agrees.
    Optimal,
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
            Self::Inaccurate => "inaccurate",
            Self::Infeasible => "infeasible",
            Self::NotConverged => "not converged",
            Self::Stopped => "stopped",
        }
    }
}

/// A point of a trajectory.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Time \[s\].
    pub time: f64,
    /// The states.
    pub states: Vec<f64>,
    /// The controls.
    pub controls: Vec<f64>,
    /// The other signals.
    pub signals: Vec<f64>,
}

/// What the controls do when the equations are integrated with error control.
#[derive(Debug, Clone, PartialEq)]
pub struct Certificate {
    /// The objective of that flight.
    pub objective: f64,
    /// Its largest violation of a limit, relative to the size of the limited quantity, with its name.
    pub violation: f64,
    /// Name of the limited quantity that is violated most; empty if none is.
    pub violated: String,
    /// Largest distance of its states from those of the optimiser at the nodes, relative to their sizes.
    pub distance: f64,
    /// Whether the equations could be integrated to the end.
    pub is_whole: bool,
}

/// A constraint that the solution touches.
#[derive(Debug, Clone, PartialEq)]
pub struct Active {
    /// Its name.
    pub name: String,
    /// At its upper limit rather than its lower.
    pub is_upper: bool,
    /// Number of places.
    pub count: usize,
    /// Sum of the magnitudes of its multipliers, of the scaled program.
    pub multiplier: f64,
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

/// Nodes at equal distances.
pub fn even(intervals: usize) -> Vec<f64> {
    (0..=intervals)
        .map(|k| k as f64 / intervals as f64)
        .collect()
}

/// An observer of solves on several threads.
struct Watched<'o> {
    observer: Mutex<&'o mut (dyn FnMut(&Iteration) -> ControlFlow<()> + Send)>,
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
pub fn optimise(
    posed: &Posed,
    effort: &Effort,
    observer: &mut (dyn FnMut(&Iteration) -> ControlFlow<()> + Send),
) -> Answer {
    let watched = Watched {
        observer: Mutex::new(observer),
        is_stopped: AtomicBool::new(false),
    };
    let mut watch = |iteration: &Iteration| watched.sees(iteration);
    let options = Options {
        tolerance: posed.tolerance,
        most_iterations: effort.most_iterations,
        ..Options::default()
    };
    let mut program = posed.program(even(posed.intervals));
    let begin = |k: usize| {
        let clock = Instant::now();
        let z = start(posed, &program, k);
        let found = interior::solve(&program, z, &options, &mut |at| watched.sees(at));
        (found, clock.elapsed().as_secs_f64())
    };
    let all: Vec<(Solution, f64)> = (0..effort.starts.max(1))
        .into_par_iter()
        .map(begin)
        .collect();
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
        let warm = Options {
            barrier: 1e-4,
            ..options.clone()
        };
        let mut found = interior::solve(&next, z.clone(), &warm, &mut watch);
        iterations += found.iterations;
        if found.status != Status::Converged && found.status != Status::Stopped {
            found = interior::solve(&next, z, &options, &mut watch);
            iterations += found.iterations;
        }
        if found.status != Status::Converged {
            break;
        }
        (program, best) = (next, found);
        meshes.push((program.intervals(), best.objective));
        errors = mesh_errors(posed, &program, &best.z);
    }
    let mesh_error = errors.iter().fold(0.0_f64, |m, error| m.max(*error));
    accurate = accurate || (mesh_error <= effort.mesh_tolerance && is_settled(&meshes));
    let certificate = replay(posed, &program, &best.z);
    let far = (certificate.objective - best.objective).abs() / best.objective.abs().max(1e-3);
    let agrees = certificate.is_whole && far <= AGREEMENT && certificate.violation <= AGREEMENT;
    let verdict = match best.status {
        _ if watched.is_stopped.into_inner() => Verdict::Stopped,
        Status::Converged if agrees && (accurate || effort.rounds == 0) => Verdict::Optimal,
        Status::Converged => Verdict::Inaccurate,
        _ if starts.iter().all(|own| own.status == Status::Infeasible) => Verdict::Infeasible,
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

/// Variables where start `k` begins: the given guess, then controls at other levels and other durations, simulated.
pub fn start(posed: &Posed, program: &Program, k: usize) -> Vec<f64> {
    // Fractions of the ranges that fill it evenly: the plastic sequence.
    let fraction =
        |k: usize, c: usize| (0.5 + k as f64 * [0.754_877_666, 0.569_840_291][c % 2]).fract();
    let mut theta = posed.theta();
    if let (crate::program::Duration::Sought(d), true) = (posed.duration, k > 0) {
        let (low, high) = posed.parameters[d].limits;
        theta[d] = (theta[d] * [0.6, 1.6, 0.35, 2.5][(k - 1) % 4]).clamp(low, high);
    }
    let level = |c: usize| {
        let own = &posed.controls[c];
        let (low, high) = own.limits;
        match k > 0 && low.is_finite() && high.is_finite() {
            true => low + fraction(k, c) * (high - low),
            false => own.guess[0],
        }
    };
    let controls: Vec<f64> = (0..posed.controls.len()).map(level).collect();
    let linear = |tau: f64| -> Vec<f64> {
        let mix = |own: &crate::pose::Variable| own.guess[0] + tau * (own.guess[1] - own.guess[0]);
        posed.states.iter().map(mix).collect()
    };
    let simulated = (k > 0 || posed.is_simulated)
        .then(|| simulate(posed, program, &controls, &theta))
        .flatten();
    let states = |tau: f64| -> Vec<f64> {
        match &simulated {
            Some(course) => between(course, tau),
            None => linear(tau),
        }
    };
    posed.variables(program, &states, &|_| controls.clone(), &theta)
}

/// Times in τ, and states then.
type Course = (Vec<f64>, Vec<Vec<f64>>);

fn between((times, states): &Course, tau: f64) -> Vec<f64> {
    let k = times
        .partition_point(|time| *time <= tau)
        .clamp(1, times.len() - 1);
    let part = (tau - times[k - 1]) / (times[k] - times[k - 1]);
    let pairs = states[k - 1].iter().zip(&states[k]);
    pairs.map(|(a, b)| a + part * (b - a)).collect()
}

/// The states with constant controls; none if they cannot be integrated to the end, or grow far beyond their sizes.
fn simulate(posed: &Posed, program: &Program, controls: &[f64], theta: &[f64]) -> Option<Course> {
    const FAR: f64 = 1e3;
    let model = &posed.equations[0];
    let mut x: Vec<f64> = posed.states.iter().map(|own| own.guess[0]).collect();
    x.extend_from_slice(controls);
    let run = bare_run([0.0, 1.0], vec![0.0; controls.len()], x.len());
    let quality = Quality {
        tolerance: 1e-6,
        magnitudes: program.model.scales.states.clone(),
        most_steps: 2000,
    };
    let course = model.course(&run, theta, &x, &quality, &|| false);
    let within = |x: &Vec<f64>| {
        let mut pairs = x.iter().zip(&program.model.scales.states);
        pairs.all(|(x, scale)| x.abs() <= FAR * scale)
    };
    let good = course.is_whole && course.time.len() > 1 && course.states.iter().all(within);
    let cut = |x: Vec<f64>| x[..posed.states.len()].to_vec();
    good.then(|| (course.time, course.states.into_iter().map(cut).collect()))
}

/// Parameters in their units.
pub fn theta(posed: &Posed, program: &Program, z: &[f64]) -> Vec<f64> {
    let own = z[program.theta()..].iter().zip(&posed.parameters);
    own.map(|(value, own)| value * own.scale).collect()
}

/// `[x u]` at the start or the end of an interval, in their units; a control that jumps has there its value of the interval.
fn ends(program: &Program, z: &[f64], k: usize) -> [Vec<f64>; 2] {
    let (n, m) = (program.n(), program.m());
    [0, 2].map(|at| {
        let node = program.node(k + at / 2);
        let mut x = z[node..node + n].to_vec();
        x.extend((0..m).map(|c| {
            let (first, second) = program.weights(c, at);
            first * z[program.node(k) + n + c] + second * z[program.node(k + 1) + n + c]
        }));
        let scales = &program.model.scales.states;
        x.iter().zip(scales).map(|(x, scale)| x * scale).collect()
    })
}

/// The states at the end of an interval from given ones at its start, with the controls of the program, and what `see` makes
/// of the steps; none if they cannot be integrated.
fn integrated(
    posed: &Posed,
    program: &Program,
    (z, theta): (&[f64], &[f64]),
    k: usize,
    x: &[f64],
    see: &mut dyn FnMut(f64, &[f64]),
) -> Option<Vec<f64>> {
    let n = program.n();
    let [mut first, last] = ends(program, z, k);
    first[..n].copy_from_slice(x);
    let h = program.h(k);
    let slopes: Vec<f64> = first[n..]
        .iter()
        .zip(&last[n..])
        .map(|(a, b)| (b - a) / h)
        .collect();
    let run = bare_run([program.mesh[k], program.mesh[k + 1]], slopes, first.len());
    let quality = Quality {
        tolerance: REPLAY,
        magnitudes: program.model.scales.states.clone(),
        most_steps: 4000,
    };
    let course = posed.equations[0].course(&run, theta, &first, &quality, &|| false);
    let finite = course.states.iter().flatten().all(|x| x.is_finite());
    for (time, x) in course.time.iter().zip(&course.states) {
        see(*time, x);
    }
    let last = course.states.last()?;
    (course.is_whole && finite).then(|| last[..n].to_vec())
}

/// Local error of each interval: the largest difference at its end from what error control finds from its start, relative
/// to the state's largest magnitude.
pub fn mesh_errors(posed: &Posed, program: &Program, z: &[f64]) -> Vec<f64> {
    let n = program.n();
    let theta = theta(posed, program, z);
    let scales = &program.model.scales.states;
    let largest = |i: usize| {
        let all = (0..=program.intervals()).map(|k| z[program.node(k) + i].abs());
        scales[i] * all.fold(1e-3, f64::max)
    };
    let sizes: Vec<f64> = (0..n).map(largest).collect();
    let error = |k: usize| {
        let [first, last] = ends(program, z, k);
        match integrated(posed, program, (z, &theta), k, &first[..n], &mut |_, _| {}) {
            Some(x) => (0..n).fold(0.0_f64, |m, i| m.max((x[i] - last[i]).abs() / sizes[i])),
            None => f64::INFINITY,
        }
    };
    (0..program.intervals()).map(error).collect()
}

/// A mesh with more nodes where errors are large or controls bend.
fn finer(program: &Program, z: &[f64], errors: &[f64], tolerance: f64) -> Vec<f64> {
    let (n, count) = (program.n(), program.intervals());
    let mut parts: Vec<usize> = errors
        .iter()
        .map(|error| match error / tolerance {
            ratio if ratio <= 1.0 => 1,
            ratio => ((2.0 * ratio).powf(0.25).ceil() as usize).clamp(2, 4),
        })
        .collect();
    for (c, control) in program.controls.iter().enumerate() {
        let value = |k: usize| z[program.node(k) + n + c];
        let (low, high) = control.limits;
        let all = (0..=count).map(value);
        let spread =
            all.clone().fold(f64::NEG_INFINITY, f64::max) - all.fold(f64::INFINITY, f64::min);
        let range = if (high - low).is_finite() {
            high - low
        } else {
            spread
        };
        let from = usize::from(control.shape == Shape::Constant);
        for k in from..count {
            // A jump of a constant control is at a node, and both its intervals are divided.
            let bend = match control.shape {
                Shape::Constant => value(k + 1) - value(k),
                Shape::Linear if k > 0 => {
                    let before = (value(k) - value(k - 1)) / program.h(k - 1);
                    let after = (value(k + 1) - value(k)) / program.h(k);
                    (after - before) * program.h(k - 1).min(program.h(k))
                }
                Shape::Linear => 0.0,
            };
            if bend.abs() > BENT * range && range > 0.0 {
                for own in &mut parts[k.saturating_sub(1)..=k] {
                    *own = (*own).max(2);
                }
            }
        }
    }
    if parts.iter().all(|own| *own == 1) {
        // Nothing stands out: the objective must not change on a finer mesh all the same.
        parts.fill(2);
    }
    let mut mesh = vec![0.0];
    for (k, own) in parts.iter().enumerate() {
        let (from, h) = (program.mesh[k], program.h(k));
        mesh.extend((1..*own).map(|part| from + h * part as f64 / *own as f64));
        mesh.push(program.mesh[k + 1]);
    }
    mesh
}

/// Variables on another mesh.
pub fn carried(posed: &Posed, program: &Program, z: &[f64], onto: &Program) -> Vec<f64> {
    let (n, m) = (program.n(), program.m());
    let scales = &program.model.scales.states;
    let interval = |tau: f64| {
        let k = program
            .mesh
            .partition_point(|own| *own <= tau)
            .clamp(1, program.intervals())
            - 1;
        (k, (tau - program.mesh[k]) / program.h(k))
    };
    let states = |tau: f64| -> Vec<f64> {
        let (k, t) = interval(tau);
        let [a, b, middle] = [program.node(k), program.node(k + 1), program.middle(k)];
        let weights = [
            (1.0 - t) * (1.0 - 2.0 * t),
            4.0 * t * (1.0 - t),
            t * (2.0 * t - 1.0),
        ];
        let of = |i: usize| {
            scales[i] * (weights[0] * z[a + i] + weights[1] * z[middle + i] + weights[2] * z[b + i])
        };
        (0..n).map(of).collect()
    };
    let controls = |tau: f64| -> Vec<f64> {
        let (k, t) = interval(tau);
        let of = |c: usize| {
            let [a, b] = [k, k + 1].map(|k| z[program.node(k) + n + c]);
            // At a node, that of the interval before: a program has the value of an interval at its end.
            scales[n + c]
                * match program.controls[c].shape {
                    Shape::Linear => a + t * (b - a),
                    Shape::Constant if t == 0.0 && k > 0 => a,
                    Shape::Constant => b,
                }
        };
        (0..m).map(of).collect()
    };
    posed.variables(onto, &states, &controls, &theta(posed, program, z))
}

/// Evaluates outputs of equations at a point in physical variables.
fn outputs(model: &Differentiated, tau: f64, x: &[f64], theta: &[f64]) -> Vec<f64> {
    let slopes = vec![0.0; model.n_inputs()];
    model
        .evaluate(tau, x, &slopes, theta)
        .split_off(model.n_states())
}

/// Integrates the equations with the controls of a solution.
pub fn replay(posed: &Posed, program: &Program, z: &[f64]) -> Certificate {
    let n = program.n();
    let theta = theta(posed, program, z);
    let scales = &program.model.scales.states;
    let [path, start, end] = &posed.equations;
    let mut worst = (0.0_f64, String::new());
    let mut note = |values: &[f64], of: &[crate::pose::Limited]| {
        for (value, own) in values.iter().zip(of) {
            let (low, high) = (own.limits.0 / own.size, own.limits.1 / own.size);
            let outside = (low - value).max(value - high);
            if own.name != "the objective" && (outside > worst.0 || outside.is_nan()) {
                worst = (outside, own.name.clone());
            }
        }
    };
    let [first, _] = ends(program, z, 0);
    note(&outputs(start, 0.0, &first, &theta), &posed.limited[1]);
    let mut x = first[..n].to_vec();
    let mut distance = 0.0_f64;
    let mut is_whole = true;
    for k in 0..program.intervals() {
        let mut see = |tau: f64, x: &[f64]| {
            if !posed.limited[0].is_empty() {
                note(&outputs(path, tau, x, &theta), &posed.limited[0]);
            }
        };
        let Some(next) = integrated(posed, program, (z, &theta), k, &x, &mut see) else {
            is_whole = false;
            break;
        };
        x = next;
        let node = &z[program.node(k + 1)..];
        for i in 0..n {
            distance = distance.max((x[i] / scales[i] - node[i]).abs());
        }
    }
    let [_, mut last] = ends(program, z, program.intervals() - 1);
    last[..n].copy_from_slice(&x);
    let values = outputs(end, 1.0, &last, &theta);
    note(&values[1..], &posed.limited[2]);
    // Under a maximum, the objective is the largest piece rather than the bound that the optimiser found.
    let pieces = values[1..].iter().zip(&posed.limited[2]);
    let pieces = pieces.filter(|(_, own)| own.name == "the objective");
    let highest = pieces
        .map(|(value, own)| value * own.size)
        .fold(f64::NEG_INFINITY, f64::max);
    Certificate {
        objective: if highest.is_finite() {
            values[0] + highest
        } else {
            values[0]
        },
        violation: worst.0.max(0.0),
        violated: if worst.0 > 0.0 {
            worst.1
        } else {
            String::new()
        },
        distance,
        is_whole,
    }
}

fn name_of(posed: &Posed, place: Place) -> String {
    match place {
        Place::Path { output, .. } => posed.limited[0][output].name.clone(),
        Place::Control { control, .. } => posed.controls[control].name.clone(),
        Place::Rate { control, .. } => format!("the rate of {}", posed.controls[control].name),
        Place::Parameter(k) => posed.parameters[k].name.clone(),
        Place::Start(k) => posed.limited[1][k].name.clone(),
        Place::End(k) => posed.limited[2][k - 1].name.clone(),
    }
}

/// The limits that the solution touches, in the order of the rows.
fn active(posed: &Posed, program: &Program, found: &Solution) -> Vec<Active> {
    const TOUCHED: f64 = 1e-6;
    let mut all: Vec<Active> = Vec::new();
    for (row, multiplier) in program.rows().0.iter().zip(&found.multipliers) {
        let (name, is_upper) = (name_of(posed, row.place), *multiplier > 0.0);
        if multiplier.abs() <= TOUCHED || name == "the objective" {
            continue;
        }
        let known = all
            .iter_mut()
            .find(|own| own.name == name && own.is_upper == is_upper);
        match known {
            Some(own) => {
                own.count += 1;
                own.multiplier += multiplier.abs();
            }
            None => all.push(Active {
                name,
                is_upper,
                count: 1,
                multiplier: multiplier.abs(),
            }),
        }
    }
    all
}

/// Controls that enter the equations linearly and lie between their limits over a tenth of the path or more.
fn singular(posed: &Posed, program: &Program, found: &Solution) -> Vec<String> {
    const PART: f64 = 0.1;
    const ROOM: f64 = 1e-3;
    let (n, m) = (program.n(), program.m());
    let pairs = posed.equations[0].pairs();
    let is_linear = |c: &usize| !pairs.contains(&(n + c, n + c));
    let (z, mesh) = (&found.z, &program.mesh);
    let inner = |c: usize| -> f64 {
        let (low, high) = program.controls[c].limits;
        let room = ROOM * (high - low);
        let inside = |k: &usize| {
            let u = z[program.node(*k) + n + c];
            room.is_finite() && u > low + room && u < high - room
        };
        let whole = |k: &usize| inside(k) && inside(&(k + 1));
        (0..program.intervals())
            .filter(whole)
            .map(|k| mesh[k + 1] - mesh[k])
            .sum()
    };
    let limited = (0..m).filter(is_linear).filter(|c| {
        found.status == Status::Converged
            && program.controls[*c].rate.is_infinite()
            && inner(*c) >= PART
    });
    limited.map(|c| posed.controls[c].name.clone()).collect()
}

fn costates(program: &Program, found: &Solution) -> Vec<Vec<f64>> {
    let n = program.n();
    let own = |k: usize| found.costates[2 * n * k + n..2 * n * (k + 1)].to_vec();
    (0..program.intervals()).map(own).collect()
}

/// The trajectory at nodes and midpoints.
fn trajectory(posed: &Posed, program: &Program, z: &[f64]) -> Vec<Moment> {
    let n = program.n();
    let theta = theta(posed, program, z);
    let seconds = posed.seconds(&theta);
    let scales = &program.model.scales.states;
    let instant = |tau: f64, x: Vec<f64>| Moment {
        time: tau * seconds,
        signals: outputs(&posed.shown, tau, &x, &theta),
        controls: x[n..].to_vec(),
        states: x[..n].to_vec(),
    };
    let mut all = Vec::new();
    for k in 0..program.intervals() {
        let [first, last] = ends(program, z, k);
        let middle = &z[program.middle(k)..][..n];
        let mut x: Vec<f64> = middle
            .iter()
            .zip(scales)
            .map(|(x, scale)| x * scale)
            .collect();
        x.extend(
            first[n..]
                .iter()
                .zip(&last[n..])
                .map(|(a, b)| 0.5 * (a + b)),
        );
        all.push(instant(program.mesh[k], first));
        all.push(instant(0.5 * (program.mesh[k] + program.mesh[k + 1]), x));
        if k + 1 == program.intervals() {
            all.push(instant(1.0, last));
        }
    }
    all
}
