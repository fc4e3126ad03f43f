//! The fit: starts from the data, the SQP from each start, the best result.

use super::multi_start::{Start, Starts, multi_start};
use super::problem::{self, Posed, fill_gaps};
use super::projection::Search;
use super::{
    Diagnostic, Fit, FitOptions, InitialState, Mesh, Objective, RunFit, Trial, closed_loop,
    diagnostics, random_starts, start,
};
use pilotage_collocation::{Collocation, Scales};
use pilotage_flights::vehicle::ClosedLoop;
use pilotage_models::Pilot;
use pilotage_sqp::{Iteration, SqpOptions, Status};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::time::Instant;

/// Errors in the data or the options of a fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// No trial was given.
    #[error("no trial to fit")]
    NoTrials,
    /// The start has the wrong length.
    #[error("the start has {found} parameters; a pilot of order {order} has {expected}")]
    StartLength {
        /// Number of parameters given.
        found: usize,
        /// Number of parameters required.
        expected: usize,
        /// The pilot's order.
        order: usize,
    },
    /// The start is not finite, or all of its parameters are zero.
    #[error("start parameter theta{index} = {value}; expected finite numbers, not all zero")]
    StartValue {
        /// Index of the parameter, from 1.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// The pilot's order is out of range.
    #[error("pilot order {order}; expected {low} to {high}")]
    Order {
        /// The requested order.
        order: usize,
        /// Lowest order.
        low: usize,
        /// Highest order.
        high: usize,
    },
    /// The mesh step is not a positive finite time.
    #[error("mesh step {step} s; expected a finite number above 0")]
    MeshStep {
        /// The requested step \[s\].
        step: f64,
    },
    /// The mesh step is so small that the states would not fit into memory.
    #[error(
        "trial {trial}: a mesh step of {step:?} s makes {intervals:.0} intervals, and a run may have {limit}; \
         take at least {least:?} s, or a scheme of higher order on a coarser mesh"
    )]
    MeshIntervals {
        /// Name of the trial.
        trial: String,
        /// The requested step \[s\].
        step: f64,
        /// Resulting number of intervals.
        intervals: f64,
        /// Maximum number of intervals of a run.
        limit: usize,
        /// A step that is allowed for the trial \[s\].
        least: f64,
    },
    /// A trial has no stick, which the stick objective requires.
    #[error("trial {trial} has no recorded stick, which the stick objective compares with")]
    NoStick {
        /// Name of the trial.
        trial: String,
    },
}

/// Maximum number of trials in a fit that only provides a start; of more trials, this many are selected
/// ([`start::spread`]).
pub const MANY_TRIALS: usize = 24;

/// Maximum number of random starts that are added by default: see [`FitOptions::random_starts`].
pub const SPARE_STARTS: usize = 8;

/// Number of pilots drawn for the search if initial states are free.
const DRAWS: usize = 2000;

/// Seed of the random starts.
const SEED: u64 = 0;

/// [`pilotage_sqp::SqpOptions::short_step`] of the fits: with 0.05 some starts with an unstable closed loop fail.
pub const SHORT_STEP: f64 = 0.01;

/// Scaled KKT residual of a fit that only provides a start.
pub(super) const ROUGH_TOLERANCE: f64 = 1e-4;

/// Highest order of an identified pilot.
pub const MAX_ORDER: usize = 6;

/// Maximum number of mesh intervals of a run if the mesh is not its samples: some 1 GB of derivatives.
pub const MAX_INTERVALS: usize = 200_000;

/// Progress of a fit, as reported to an observer.
#[derive(Debug, Clone, Copy)]
pub enum Progress<'a> {
    /// Search for starts: pilots in the linearised problem, or other initial states of the best solution.
    Search {
        /// Order of the pilots.
        order: usize,
        /// Completed share of the work, 0 to 1.
        done: f64,
    },
    /// An iterate of the solver.
    Iterate(Iterate<'a>),
}

/// An iterate of the solver and the start that it belongs to.
#[derive(Debug, Clone, Copy)]
pub struct Iterate<'a> {
    /// Order of the fitted pilot: lower orders are fitted first to provide starts.
    pub order: usize,
    /// Number of the start, from 0.
    pub start: usize,
    /// Number of starts so far: random ones may be added.
    pub starts: usize,
    /// The iterate.
    pub iteration: &'a Iteration,
}

/// Receives the search's progress and each iterate. `Break` stops the fit with the best iterate so far and that status,
/// or with the start that had converged before.
pub type Observer<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<Status> + 'a;

/// Fits one pilot to all trials (paper, eq. 5).
///
/// If runs start at rest, a pilot of second order is fitted first, from starts estimated from the data
/// ([`start::low_order`]), unless the user gives a start. Each higher order starts from the order below with an
/// additional pole and zero ([`start::with_pair`]), so that its objective is never higher. With several starts the SQP
/// runs some iterations from each and completes the best. If there are many trials, a selection of them is sufficient
/// for the lower order, but not for the requested one: a selection may not determine the last pole, which then diverges
/// to −∞.
///
/// If initial states are free, the starts are the optima of the linearised problem (variable projection).
///
/// # Errors
/// If there is nothing to fit or an option does not suit the data. A fit that does not converge is a result, with its
/// status.
pub fn fit(
    trials: &[Trial],
    options: &FitOptions,
    observer: &mut Observer<'_>,
) -> Result<Fit, FitError> {
    let mut fit = solve(trials, options, observer)?;
    let vehicle = options.loop_vehicle();
    fit.closed_loop = vehicle.map(|&v| ClosedLoop::of(v, options.pilot, &fit.theta));
    fit.unbounded = unbounded(&fit, trials, options)?;
    fit.diagnostics = diagnostics(&fit, options, trials);
    let is_empty = Diagnostic::is_of_data_without_pilot;
    if fit.diagnostics.iter().any(is_empty) {
        fit.uncertainty = None;
    }
    Ok(fit)
}

/// The objective without the bound on the closed loop if a solution lies on it: that of the optimum reached from this
/// solution. Computed only for few trials, since it requires another solve.
fn unbounded(fit: &Fit, trials: &[Trial], options: &FitOptions) -> Result<Option<f64>, FitError> {
    let on_bound = fit.closed_loop.as_ref().and_then(closed_loop::on_bound);
    if !(fit.converged && on_bound.is_some() && options.kept_vehicle().is_some())
        || trials.len() > MANY_TRIALS
    {
        return Ok(None);
    }
    let free = FitOptions {
        stable_loop: false,
        start: Some(fit.theta.clone()),
        random_starts: Some(0),
        tolerance: options.tolerance.max(ROUGH_TOLERANCE),
        ..options.clone()
    };
    let free = solve(trials, &free, &mut |_| ControlFlow::Continue(()))?;
    Ok(free.converged.then(|| free.objective.min(fit.objective)))
}

/// The fit without diagnostics.
fn solve(
    trials: &[Trial],
    options: &FitOptions,
    observer: &mut Observer<'_>,
) -> Result<Fit, FitError> {
    check(trials, options)?;
    let clock = Instant::now();
    let sticks: Vec<Vec<f64>> = trials
        .par_iter()
        .map(|t| start::implied_stick(t, &options.vehicle))
        .collect();
    // An observer that has stopped the fit is not called again.
    let mut ended = None;
    let mut latched = |progress: &Progress<'_>| match ended {
        Some(status) => ControlFlow::Break(status),
        None => {
            let flow = observer(progress);
            ended = flow.break_value();
            flow
        }
    };
    let observer: &mut Observer<'_> = &mut latched;
    let starts = candidates(trials, &sticks, options, observer)?;
    let mut fit = match options.objective {
        Objective::Response => {
            let posed = problem::pose_response(trials, options);
            solve_response(&posed, trials, options, &starts, observer)
        }
        Objective::Stick => {
            let posed = problem::pose_stick(trials, options);
            solve_stick(&posed, trials, options, &starts, observer)
        }
    };
    fit.seconds = clock.elapsed().as_secs_f64();
    Ok(fit)
}

/// Solves the response problem from these starts.
fn solve_response(
    posed: &Posed,
    trials: &[Trial],
    options: &FitOptions,
    starts: &Starts,
    observer: &mut Observer<'_>,
) -> Fit {
    solve_posed(
        posed,
        trials,
        options,
        starts,
        observer,
        start::joint_states,
    )
}

/// Solves the stick problem from these starts.
fn solve_stick(
    posed: &Posed,
    trials: &[Trial],
    options: &FitOptions,
    starts: &Starts,
    observer: &mut Observer<'_>,
) -> Fit {
    let mut fit = solve_posed(
        posed,
        trials,
        options,
        starts,
        observer,
        start::stick_states,
    );
    for (run, trial) in fit.runs.iter_mut().zip(trials) {
        // The pilot alone does not move a vehicle: the position is the recorded one.
        run.position = fill_gaps(&trial.time, &trial.position);
    }
    fit
}

/// Computes states of a trial from its data for a pilot.
type FromData = fn(&Trial, &FitOptions, &[f64]) -> Vec<Vec<f64>>;

/// Solves a problem from these starts.
fn solve_posed(
    posed: &Posed,
    trials: &[Trial],
    options: &FitOptions,
    starts: &Starts,
    observer: &mut Observer<'_>,
    from_data: FromData,
) -> Fit {
    let from = |start: &Start| {
        let from_data = |trial: &Trial| from_data(trial, options, &start.theta);
        begin(posed, trials, options, start, from_data)
    };
    let runs = |problem: &Collocation, z: &[f64]| runs(problem, z, trials);
    multi_start(starts, &from, options, observer, &runs)
}

/// The discretised problem, scaled for a start, and its variables at the start.
fn begin(
    posed: &Posed,
    trials: &[Trial],
    options: &FitOptions,
    start: &Start,
    from_data: impl Fn(&Trial) -> Vec<Vec<f64>> + Send + Sync,
) -> (Collocation, Vec<f64>) {
    let states = match &start.states {
        Some(states) => states.clone(),
        None => trials.par_iter().map(from_data).collect(),
    };
    let problem = posed.discretised(options, Scales::of(&states, &start.theta));
    let z = problem.variables(&states, &start.theta);
    (problem, z)
}

/// The discretised problem of a fit, and its variables at the solution.
pub(super) fn again(fit: &Fit, trials: &[Trial], options: &FitOptions) -> (Collocation, Vec<f64>) {
    let posed = match options.objective {
        Objective::Response => problem::pose_response(trials, options),
        Objective::Stick => problem::pose_stick(trials, options),
    };
    let states: Vec<_> = fit.runs.iter().map(|run| run.states.clone()).collect();
    let problem = posed.discretised(options, Scales::of(&states, &fit.theta));
    let z = problem.variables(&states, &fit.theta);
    (problem, z)
}

/// Options of one solve.
pub(super) fn sqp_options(options: &FitOptions) -> SqpOptions {
    SqpOptions {
        tolerance: options.tolerance,
        max_iterations: options.max_iterations,
        short_step: SHORT_STEP,
        ..SqpOptions::default()
    }
}

/// Whether free initial states cause many local optima.
fn is_free(options: &FitOptions) -> bool {
    options.initial_state != InitialState::AtRest
}

/// Starts for θ from the data and the trials' sticks ([`start::implied_stick`]).
///
/// # Errors
/// As [`fit`].
pub fn candidates(
    trials: &[Trial],
    sticks: &[Vec<f64>],
    options: &FitOptions,
    observer: &mut Observer<'_>,
) -> Result<Starts, FitError> {
    let order = options.pilot.order;
    let mut starts = Starts::default();
    if let Some(theta) = &options.start {
        starts.all.push(theta.clone().into());
    } else if is_free(options) {
        starts = optima(trials, sticks, options, observer);
    } else if order <= 2 {
        let low = start::low_order(trials, sticks, options);
        starts.all.extend(low.into_iter().map(Start::from));
    } else {
        let lower = FitOptions {
            pilot: Pilot { order: order - 1 },
            random_starts: Some(0),
            ..options.clone()
        };
        let (theta, iterations) = rough(trials, &lower, observer)?;
        let pairs = start::with_pair(&theta, trials, sticks, options);
        starts.all.extend(pairs.into_iter().map(Start::from));
        starts.iterations = iterations;
    }
    if starts.all.is_empty() {
        // No evaluated pilot fulfils the conditions, but the solver may find one.
        let regressions = start::regressions(trials, sticks, options);
        starts.all.extend(regressions.into_iter().map(Start::from));
    }
    let (joining, spare) = random(options);
    starts.all.extend(joining.into_iter().map(Start::from));
    starts.tumbles = options.initial_state == InitialState::Free
        && options.objective == Objective::Response
        && options.start.is_none()
        && trials.len() <= MANY_TRIALS;
    if trials.len() <= MANY_TRIALS {
        starts.spare = spare.into_iter().map(Start::from).collect();
    }
    Ok(starts)
}

/// Optima of the linearised problem, from random pilots and from regressions of the sticks; if there are many trials, a
/// selection is used.
///
/// The vehicle is at rest here even if its states are free: free states make it tumble in the first tenths of a second,
/// which no linearisation can follow.
fn optima(
    trials: &[Trial],
    sticks: &[Vec<f64>],
    options: &FitOptions,
    observer: &mut Observer<'_>,
) -> Starts {
    if trials.len() > MANY_TRIALS {
        let some = start::spread(trials, MANY_TRIALS);
        let sticks: Vec<_> = (some.iter())
            .map(|t| start::implied_stick(t, &options.vehicle))
            .collect();
        let mut starts = optima(&some, &sticks, options, observer);
        starts.all.iter_mut().for_each(|start| start.states = None);
        return starts;
    }
    let mut draws = random_starts::draw(options, SEED, DRAWS);
    draws.extend(start::regressions(trials, sticks, options));
    let order = options.pilot.order;
    let mut watch = |done: f64| observer(&Progress::Search { order, done }).is_break();
    let free = match options.objective {
        Objective::Response => InitialState::VehicleAtRest,
        Objective::Stick => InitialState::Free,
    };
    let options = &FitOptions {
        initial_state: free,
        tolerance: options.tolerance.max(ROUGH_TOLERANCE),
        ..options.clone()
    };
    match options.objective {
        Objective::Stick => {
            let posed = problem::pose_stick(trials, options);
            let search = Search::of(&posed);
            search.starts(search.descents(draws, &mut watch))
        }
        Objective::Response => {
            let posed = problem::pose_response(trials, options);
            let search = Search::of(&posed);
            let descents = search.descents(draws, &mut watch);
            let ends: Vec<_> = descents
                .iter()
                .map(|descent| descent.theta.clone())
                .collect();
            let mut first = search.starts(descents);
            first.all.truncate(1);
            if first.all.is_empty() {
                return first;
            }
            let fit = solve_response(&posed, trials, options, &first, observer);
            let states: Vec<_> = fit.runs.iter().map(|run| run.states.clone()).collect();
            let search = Search::about(&posed, &fit.theta, &states);
            let mut watch = |done: f64| observer(&Progress::Search { order, done }).is_break();
            let mut starts = search.starts(search.descents(ends, &mut watch));
            starts.all.push(Start {
                theta: fit.theta,
                states: Some(states),
                descents: 1,
            });
            starts.iterations = fit.iterations;
            starts
        }
    }
}

/// The random starts by [`FitOptions::random_starts`]: those that always run, and those that may be added.
fn random(options: &FitOptions) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let (count, sure) = match (options.random_starts, &options.start) {
        (Some(count), _) => (count, count),
        (None, Some(_)) => (0, 0),
        (None, None) if options.initial_state == InitialState::VehicleAtRest => (0, 0),
        (None, None) => (SPARE_STARTS, 0),
    };
    let mut all = random_starts::draw(options, SEED, count);
    let spare = all.split_off(sure);
    (all, spare)
}

/// θ of a fit that only provides a start, to a selection of the trials if they are many, and its SQP iterations.
fn rough(
    trials: &[Trial],
    options: &FitOptions,
    observer: &mut Observer<'_>,
) -> Result<(Vec<f64>, usize), FitError> {
    let options = FitOptions {
        tolerance: options.tolerance.max(ROUGH_TOLERANCE),
        ..options.clone()
    };
    if trials.len() <= MANY_TRIALS {
        let fit = solve(trials, &options, observer)?;
        return Ok((fit.theta, fit.iterations));
    }
    let fit = solve(&start::spread(trials, MANY_TRIALS), &options, observer)?;
    let theta = start::restrained(options.pilot, &fit.theta);
    Ok((theta, fit.iterations))
}

fn check(trials: &[Trial], options: &FitOptions) -> Result<(), FitError> {
    let order = options.pilot.order;
    if trials.is_empty() {
        return Err(FitError::NoTrials);
    }
    if !(1..=MAX_ORDER).contains(&order) {
        return Err(FitError::Order {
            order,
            low: 1,
            high: MAX_ORDER,
        });
    }
    if let Some(theta) = &options.start {
        if theta.len() != 2 * order {
            return Err(FitError::StartLength {
                found: theta.len(),
                expected: 2 * order,
                order,
            });
        }
        let all_zero = theta.iter().all(|v| *v == 0.0);
        if let Some(index) = theta.iter().position(|v| !v.is_finite() || all_zero) {
            return Err(FitError::StartValue {
                index: index + 1,
                value: theta[index],
            });
        }
    }
    for trial in trials {
        check_mesh(trial, options.mesh)?;
    }
    let has_stick = |t: &Trial| {
        t.stick
            .as_ref()
            .is_some_and(|s| s.iter().any(|u| u.is_finite()))
    };
    match trials
        .iter()
        .find(|t| options.objective == Objective::Stick && !has_stick(t))
    {
        Some(trial) => Err(FitError::NoStick {
            trial: trial.name.clone(),
        }),
        None => Ok(()),
    }
}

fn check_mesh(trial: &Trial, mesh: Mesh) -> Result<(), FitError> {
    let Mesh::Step(step) = mesh else {
        return Ok(());
    };
    if !(step.is_finite() && step > 0.0) {
        return Err(FitError::MeshStep { step });
    }
    let intervals = Mesh::intervals(&trial.time, step);
    if intervals <= MAX_INTERVALS as f64 {
        return Ok(());
    }
    let (first, last) = (trial.time[0], trial.time[trial.time.len() - 1]);
    Err(FitError::MeshIntervals {
        trial: trial.name.clone(),
        step,
        intervals,
        limit: MAX_INTERVALS,
        least: rounded_up((last - first) / MAX_INTERVALS as f64),
    })
}

/// Rounds up to two significant digits.
fn rounded_up(x: f64) -> f64 {
    let unit = 10_f64.powi(x.log10().floor() as i32 - 1);
    let up = (x / unit).ceil() * unit;
    // Removes the rounding error of the product.
    format!("{up:.1e}").parse().unwrap_or(up)
}

/// The runs of a solution at the samples.
fn runs(problem: &Collocation, z: &[f64], trials: &[Trial]) -> Vec<RunFit> {
    let one = |(j, trial): (usize, &Trial)| {
        let run = &problem.runs[j];
        let states = problem.states_at_samples(z, j);
        let mut outputs = problem.outputs_at_samples(z, j).into_iter();
        let mut next = || outputs.next().expect("position or stick, and stick");
        let (measured, stick) = (next(), next());
        let residual = (run.measured[0].values)
            .iter()
            .zip(&measured)
            .map(|(y, m)| y - m)
            .collect();
        RunFit {
            name: trial.name.clone(),
            time: run.time.clone(),
            target: trial.target.clone(),
            position: measured,
            stick,
            residual,
            states,
        }
    };
    trials.iter().enumerate().map(one).collect()
}
