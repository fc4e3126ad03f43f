//! The fit: starts from the data, the SQP from each, the best.

use super::problem::{self, fill_gaps};
use super::result::{AGREE, StartReport};
use super::{Fit, InitialState, Mesh, Objective, Options, RunFit, Trial, start};
use crate::sqp::{self, Iteration, Solution, Status};
use crate::transcription::{Collocation, Condensed, ParameterConstraints};
use pilotage_models::{Dynamics, Pilot};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::time::Instant;

/// What can be wrong with the data or the options of a fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// No trial was given.
    #[error("no trial to fit")]
    NoTrials,
    /// A start of the wrong length.
    #[error("the start has {found} parameters; a pilot of order {order} has {expected}")]
    StartLength {
        /// Parameters given.
        found: usize,
        /// Parameters needed.
        expected: usize,
        /// The pilot's order.
        order: usize,
    },
    /// A start that is not finite, or with every parameter zero.
    #[error("start parameter theta{index} = {value}; expected finite numbers, not all zero")]
    StartValue {
        /// Which, from 1.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// A pilot without states or with more than fit a node.
    #[error("pilot order {order}; expected {low} to {high}")]
    Order {
        /// The order asked for.
        order: usize,
        /// Lowest.
        low: usize,
        /// Highest.
        high: usize,
    },
    /// A mesh step that is no length of time.
    #[error("mesh step {step} s; expected a finite number above 0")]
    MeshStep {
        /// The step asked for [s].
        step: f64,
    },
    /// A mesh step so small that the states would not fit into memory.
    #[error(
        "trial {trial}: a mesh step of {step:?} s makes {intervals:.0} intervals, and a run may have {limit}; \
         take at least {least:?} s, or a scheme of higher order on a coarser mesh"
    )]
    MeshIntervals {
        /// Name of the trial.
        trial: String,
        /// The step asked for [s].
        step: f64,
        /// Intervals that it makes.
        intervals: f64,
        /// Most intervals of a run.
        limit: usize,
        /// A step that the trial allows [s].
        least: f64,
    },
    /// A trial without a stick, for the stick objective.
    #[error("trial {trial} has no recorded stick, which the stick objective compares with")]
    NoStick {
        /// Name of the trial.
        trial: String,
    },
}

/// Highest order of an identified pilot.
pub const MAX_ORDER: usize = 6;

/// Most mesh intervals of a run where the mesh is not its samples: some 1 GB of derivatives.
pub const MAX_INTERVALS: usize = 200_000;

/// What an observer of a fit sees.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Order of the pilot that is fitted: lower ones come first, for their optimum as a start.
    pub order: usize,
    /// Which start, from 0.
    pub start: usize,
    /// Of how many.
    pub starts: usize,
    /// The iterate.
    pub iteration: &'a Iteration,
}

/// Sees each iterate; `Break` ends the fit with the best iterate so far and that status, or with the
/// start that had converged before.
pub type Observer<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<Status> + 'a;

/// Fits one pilot to all trials (paper, eq. 5).
///
/// Without a start of the user's, a pilot of second order is fitted first, from starts estimated from the
/// data ([`start::low_order`]); each order above that starts from the one below, with a pole and a zero
/// more ([`start::with_pair`]), so that its objective is never above. Of several starts the SQP runs
/// some iterations from each and finishes the best.
///
/// Of many trials some suffice for the order below. They would not for the order asked for: what all
/// trials tell of the last pole, a few may not, and it runs away to −∞. Where initial states are free,
/// some of the trials choose among the starts all the same, since each costs many iterations there.
///
/// # Errors
/// When there is nothing to fit or an option does not suit the data. A fit that does not converge is a
/// result, with its status.
pub fn fit(
    trials: &[Trial],
    options: &Options,
    observer: &mut Observer<'_>,
) -> Result<Fit, FitError> {
    check(trials, options)?;
    let clock = Instant::now();
    let sticks: Vec<Vec<f64>> = trials
        .par_iter()
        .map(|t| start::implied_stick(t, &options.vehicle))
        .collect();
    // An observer that has ended the fit is not asked again.
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
    let (candidates, before) = candidates(trials, &sticks, options, observer)?;
    let mut fit = match options.objective {
        Objective::Response => {
            let from = |theta: &[f64]| {
                let states: Vec<_> = trials
                    .par_iter()
                    .map(|t| start::joint_states(t, options, theta))
                    .collect();
                let problem = problem::response(trials, options, start::scales(&states, theta));
                let z = start::variables(&problem, &states, theta);
                (problem, z)
            };
            multi_start(&candidates, &from, options, observer, &|problem, z| {
                runs(problem, z, trials)
            })
        }
        Objective::Stick => {
            let from = |theta: &[f64]| {
                let states: Vec<_> = trials
                    .par_iter()
                    .map(|t| start::stick_states(t, options, theta))
                    .collect();
                let problem = problem::stick(trials, options, start::scales(&states, theta));
                let z = start::variables(&problem, &states, theta);
                (problem, z)
            };
            // The pilot alone moves no vehicle: the position stays the recorded one.
            let recorded = |mut run: RunFit, trial: &Trial| {
                run.position = fill_gaps(&trial.time, &trial.position);
                run
            };
            multi_start(&candidates, &from, options, observer, &|problem, z| {
                runs(problem, z, trials)
                    .into_iter()
                    .zip(trials)
                    .map(|(run, trial)| recorded(run, trial))
                    .collect()
            })
        }
    };
    fit.iterations += before;
    fit.seconds = clock.elapsed().as_secs_f64();
    Ok(fit)
}

/// Starts for θ from the data and the trials' sticks ([`start::implied_stick`]), and the SQP iterations
/// that they took.
///
/// # Errors
/// As [`fit`].
pub fn candidates(
    trials: &[Trial],
    sticks: &[Vec<f64>],
    options: &Options,
    observer: &mut Observer<'_>,
) -> Result<(Vec<Vec<f64>>, usize), FitError> {
    let order = options.pilot.order;
    if let Some(theta) = &options.start {
        return Ok((vec![theta.clone()], 0));
    }
    let many = trials.len() > MANY_TRIALS;
    let at_rest = options.initial_state == InitialState::AtRest;
    if many && !at_rest {
        // Optima differ by far more than the trials do, and the way to the best is long.
        let (theta, iterations) = rough(trials, options, observer)?;
        return Ok((vec![theta], iterations));
    }
    if order <= 2 {
        return Ok((start::low_order(trials, sticks, options), 0));
    }
    let lower = Options {
        pilot: Pilot { order: order - 1 },
        ..options.clone()
    };
    let (theta, iterations) = rough(trials, &lower, observer)?;
    let mut raised = start::with_pair(&theta, trials, sticks, options);
    if !at_rest {
        // Free initial states make many optima, and the order below may have led to the wrong one.
        raised.extend(start::regressions(trials, sticks, options));
    }
    Ok((raised, iterations))
}

/// θ of a fit that only gives a start, to some of the trials if they are many, and its SQP iterations.
fn rough(
    trials: &[Trial],
    options: &Options,
    observer: &mut Observer<'_>,
) -> Result<(Vec<f64>, usize), FitError> {
    let options = Options {
        tolerance: options.tolerance.max(ROUGH_TOLERANCE),
        ..options.clone()
    };
    if trials.len() <= MANY_TRIALS {
        let fit = fit(trials, &options, observer)?;
        return Ok((fit.theta, fit.iterations));
    }
    let fit = fit(&start::spread(trials, MANY_TRIALS), &options, observer)?;
    let theta = start::restrained(options.pilot, &fit.theta);
    Ok((theta, fit.iterations))
}

fn check(trials: &[Trial], options: &Options) -> Result<(), FitError> {
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
    trials
        .iter()
        .try_for_each(|t| check_mesh(t, options.mesh))?;
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

/// The next number of two significant digits.
fn rounded_up(x: f64) -> f64 {
    let unit = 10_f64.powi(x.log10().floor() as i32 - 1);
    let up = (x / unit).ceil() * unit;
    // The decimal that is meant, without the digits that the product left.
    format!("{up:.1e}").parse().unwrap_or(up)
}

/// Makes the runs of a solution.
type Runs<'a, D, C> = dyn Fn(&Collocation<D, C>, &[f64]) -> Vec<RunFit> + 'a;

/// A solve that may go on.
struct Attempt<D, C> {
    /// Which start, from 0.
    number: usize,
    problem: Collocation<D, C>,
    solution: Solution,
    iterations: usize,
    seconds: f64,
}

/// Runs the SQP from each candidate for some iterations, then goes on with the most promising until
/// one has converged.
fn multi_start<D: Dynamics, C: ParameterConstraints>(
    candidates: &[Vec<f64>],
    from: &impl Fn(&[f64]) -> (Collocation<D, C>, Vec<f64>),
    options: &Options,
    observer: &mut Observer<'_>,
    runs: &Runs<'_, D, C>,
) -> Fit {
    let alone = candidates.len() == 1;
    let scout = if alone {
        options.max_iterations
    } else {
        SCOUT_ITERATIONS.min(options.max_iterations)
    };
    let mut watched = Watched {
        observer,
        order: options.pilot.order,
        starts: candidates.len(),
        stopped: None,
    };
    let mut attempts: Vec<Attempt<D, C>> = Vec::new();
    for (number, theta) in candidates.iter().enumerate() {
        let clock = Instant::now();
        let (problem, z) = from(theta);
        let best = attempts
            .iter()
            .map(|a| rank(&a.solution))
            .fold(f64::INFINITY, f64::min);
        let mut race = Race {
            best,
            window: Vec::new(),
        };
        let mut watch = |iteration: &Iteration| {
            let flow = watched.show(number, 0, iteration);
            if flow.is_continue() && race.is_lost(iteration) {
                ControlFlow::Break(Status::Stopped)
            } else {
                flow
            }
        };
        let solution = run(&problem, z, options, scout, &mut watch);
        attempts.push(Attempt {
            number,
            problem,
            iterations: solution.work.iterations,
            solution,
            seconds: clock.elapsed().as_secs_f64(),
        });
        if watched.stopped.is_some() {
            break;
        }
    }
    attempts.sort_by(|a, b| {
        let violations = || a.solution.kkt.primal.total_cmp(&b.solution.kkt.primal);
        rank(&a.solution)
            .total_cmp(&rank(&b.solution))
            .then_with(violations)
    });
    for attempt in &mut attempts {
        if watched.stopped.is_some() || attempt.has_converged() {
            break;
        }
        attempt.go_on(options, &mut watched);
    }
    let best = attempts.iter().position(Attempt::has_converged);
    let skipped = candidates.len() - attempts.len();
    report(&attempts, best.unwrap_or(0), watched.stopped, skipped, runs)
}

/// The caller's observer, and whether it has ended the fit.
struct Watched<'a, 'b> {
    observer: &'a mut Observer<'b>,
    order: usize,
    starts: usize,
    stopped: Option<Status>,
}

impl Watched<'_, '_> {
    /// Shows an iteration of a solve that had `before` iterations earlier.
    fn show(&mut self, start: usize, before: usize, iteration: &Iteration) -> ControlFlow<Status> {
        let flow = (self.observer)(&Progress {
            order: self.order,
            start,
            starts: self.starts,
            iteration: &Iteration {
                number: before + iteration.number,
                ..*iteration
            },
        });
        self.stopped = flow.break_value();
        flow
    }
}

impl<D: Dynamics, C: ParameterConstraints> Attempt<D, C> {
    fn has_converged(&self) -> bool {
        self.solution.status == Status::Converged
    }

    /// Goes on where the scouting stopped, if that was for its limit on iterations or a lost race.
    fn go_on(&mut self, options: &Options, watched: &mut Watched<'_, '_>) {
        let left = options.max_iterations.saturating_sub(self.iterations);
        let may = matches!(
            self.solution.status,
            Status::IterationLimit | Status::Stopped
        );
        if left == 0 || !may {
            return;
        }
        let clock = Instant::now();
        let (number, before) = (self.number, self.iterations);
        let mut watch = |iteration: &Iteration| watched.show(number, before, iteration);
        let z = self.solution.iterate.z.clone();
        self.solution = run(&self.problem, z, options, left, &mut watch);
        self.iterations += self.solution.work.iterations;
        self.seconds += clock.elapsed().as_secs_f64();
    }

    fn report(&self) -> StartReport {
        StartReport {
            number: self.number + 1,
            status: self.solution.status.to_string(),
            objective: self.solution.iterate.f,
            kkt: self.solution.kkt.residual(),
            curvature: self.solution.curvature,
            iterations: self.iterations,
            seconds: self.seconds,
        }
    }
}

/// Whether a start still may beat the best so far.
struct Race {
    best: f64,
    window: Vec<f64>,
}

impl Race {
    /// True when the states are consistent and the objective is behind the best and hardly moves: it
    /// gained less than half of what is left over [`RACE_WINDOW`] iterations, or nothing that counts
    /// over [`TIE_WINDOW`] and ends where the best is.
    fn is_lost(&mut self, iteration: &Iteration) -> bool {
        let f = iteration.objective;
        self.window.push(f);
        let gained = |window: usize| {
            let earlier = self.window.len().checked_sub(window + 1);
            earlier.map_or(f64::INFINITY, |k| (self.window[k] - f).abs())
        };
        let behind = f - self.best;
        match behind > AGREE * self.best {
            true => iteration.kkt.primal < 1e-2 && gained(RACE_WINDOW) < 0.5 * behind,
            false => {
                iteration.kkt.primal < 1e-4
                    && behind > -ROUNDING * self.best
                    && gained(TIE_WINDOW) < TIE * self.best
            }
        }
    }
}

/// Iterations over which a start must gain half of what it lies behind.
const RACE_WINDOW: usize = 10;

/// Iterations over which a start beside the best must gain something, and the relative gain that counts.
const TIE_WINDOW: usize = 2;
const TIE: f64 = 1e-5;
/// Relative difference below which two objectives are equal.
const ROUNDING: f64 = 1e-8;

/// Trials to which a fit that only gives a start is made; of more, so many are taken
/// ([`start::spread`]).
const MANY_TRIALS: usize = 24;

/// Scaled KKT residual of a fit that only gives a start.
const ROUGH_TOLERANCE: f64 = 1e-4;

/// SQP iterations from each start before the most promising is finished.
const SCOUT_ITERATIONS: usize = 60;

/// [`sqp::Options::short_step`] of the fits: with 0.05 some starts whose closed loop is unstable fail.
pub const SHORT_STEP: f64 = 0.01;

/// What the starts are compared by: the objective, when the states are nearly consistent.
fn rank(solution: &Solution) -> f64 {
    match solution.kkt.primal < 1e-2 && solution.iterate.f.is_finite() {
        true => solution.iterate.f,
        false => f64::INFINITY,
    }
}

fn run<D: Dynamics, C: ParameterConstraints>(
    problem: &Collocation<D, C>,
    z: Vec<f64>,
    options: &Options,
    max_iterations: usize,
    watch: &mut dyn FnMut(&Iteration) -> ControlFlow<Status>,
) -> Solution {
    let sqp_options = sqp::Options {
        tolerance: options.tolerance,
        max_iterations,
        short_step: SHORT_STEP,
        ..sqp::Options::default()
    };
    sqp::solve(problem, &mut Condensed::default(), z, &sqp_options, watch)
}

/// `stopped` is why the observer ended the fit, if it did.
fn report<D: Dynamics, C: ParameterConstraints>(
    attempts: &[Attempt<D, C>],
    best: usize,
    stopped: Option<Status>,
    skipped: usize,
    runs: &Runs<'_, D, C>,
) -> Fit {
    let attempt = &attempts[best];
    let Attempt {
        problem, solution, ..
    } = attempt;
    let status = match stopped {
        Some(status) if !attempt.has_converged() => status,
        _ => solution.status,
    };
    Fit {
        theta: problem.physical_theta(&solution.iterate.z),
        objective: solution.iterate.f,
        converged: attempt.has_converged(),
        status: status.to_string(),
        kkt: solution.kkt.residual(),
        curvature: solution.curvature,
        iterations: attempts.iter().map(|a| a.iterations).sum(),
        unknowns: solution.iterate.z.len(),
        seconds: 0.0,
        starts: attempts.iter().map(Attempt::report).collect(),
        skipped,
        runs: runs(problem, &solution.iterate.z),
    }
}

/// The runs of a solution at the samples.
fn runs<D: Dynamics, C: ParameterConstraints>(
    problem: &Collocation<D, C>,
    z: &[f64],
    trials: &[Trial],
) -> Vec<RunFit> {
    let theta = problem.physical_theta(z);
    let one = |(j, trial): (usize, &Trial)| {
        let run = &problem.runs[j];
        let states = problem.states_at_samples(z, j);
        let model = &problem.model.dynamics;
        let at = |f: &dyn Fn(&[f64], &[f64]) -> f64| -> Vec<f64> {
            states
                .iter()
                .zip(&run.inputs)
                .map(|(x, w)| f(x, w))
                .collect()
        };
        let measured = at(&|x, w| model.measured(x, w, &theta));
        let stick = at(&|x, w| model.bounded(x, w, &theta));
        let residual = run
            .measured
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
