//! Multi-start SQP: losing starts stop early, the most promising one is completed.

use super::race::{Race, TIE};
use super::result::{FEASIBLE, StartReport, agree};
use super::solve::{Iterate, Observer, Progress, sqp_options};
use super::{Fit, FitOptions, RunFit, Uncertainty, tumbles};
use pilotage_collocation::Collocation;
use pilotage_sqp::{Iteration, Solution, Status};
use std::ops::ControlFlow;
use std::time::Instant;

/// Maximum number of SQP iterations from each start before the most promising one is completed.
const SCOUT_ITERATIONS: usize = 60;
/// Number of rounds in which the best start tries other tumbles.
const ROUNDS: u64 = 4;
/// Scaled constraint violation below which the states are nearly consistent, so that the objective shows how promising
/// a start is.
pub(super) const NEAR: f64 = 1e-2;

/// Initial values of a solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// θ.
    pub theta: Vec<f64>,
    /// States of each run at its samples; `None`: derived from the data.
    pub states: Option<Vec<Vec<Vec<f64>>>>,
    /// Number of descents of the linearised problem that ended here; 1 if it has another origin.
    pub descents: usize,
}

impl From<Vec<f64>> for Start {
    fn from(theta: Vec<f64>) -> Self {
        Self {
            theta,
            states: None,
            descents: 1,
        }
    }
}

/// Starts of the SQP.
#[derive(Debug, Clone, Default)]
pub struct Starts {
    /// Starts that always run.
    pub all: Vec<Start>,
    /// Starts that are added one after another while only one start leads to the best objective; with
    /// [`Self::tumbles`], while none has converged.
    pub spare: Vec<Start>,
    /// Whether to try other initial states at the best solution of these starts (module `tumbles`).
    pub tumbles: bool,
    /// Number of descents of the linearised problem that ended elsewhere.
    pub lost: usize,
    /// Number of SQP iterations spent on finding the starts.
    pub iterations: usize,
}

/// Computes the runs of a solution.
pub(super) type Runs<'a> = dyn Fn(&Collocation, &[f64]) -> Vec<RunFit> + 'a;

/// Runs the SQP from each start for some iterations, then continues the most promising ones until none is ahead of the
/// best converged one.
pub(super) fn multi_start(
    starts: &Starts,
    from: &impl Fn(&Start) -> (Collocation, Vec<f64>),
    options: &FitOptions,
    observer: &mut Observer<'_>,
    runs: &Runs<'_>,
) -> Fit {
    let scout = match starts.all.len() {
        1 => options.max_iterations,
        _ => SCOUT_ITERATIONS.min(options.max_iterations),
    };
    let mut watched = Watched {
        observer,
        order: options.pilot.order,
        starts: starts.all.len(),
        stopped: None,
    };
    let scouted = |attempts: &mut Vec<Attempt>, start: &Start, best, watched: &mut _| {
        let (number, race) = (attempts.len(), (scout, best));
        attempts.push(Attempt::scout(
            (number, start.descents),
            from(start),
            race,
            options,
            watched,
        ));
    };
    let mut attempts: Vec<Attempt> = Vec::new();
    for start in &starts.all {
        let nearest = attempts.iter().map(|a| a.record.near);
        let best = nearest.fold(f64::INFINITY, f64::min);
        scouted(&mut attempts, start, best, &mut watched);
        if watched.stopped.is_some() {
            break;
        }
    }
    finish(&mut attempts, options, &mut watched);
    for start in &starts.spare {
        let joins = match starts.tumbles {
            true => best_converged(&attempts).is_none().then_some(f64::INFINITY),
            false => lone(&attempts),
        };
        let Some(best) = joins.filter(|_| watched.stopped.is_none()) else {
            break;
        };
        watched.starts += 1;
        scouted(&mut attempts, start, best, &mut watched);
        finish(&mut attempts, options, &mut watched);
    }
    let skipped = starts.all.len().saturating_sub(attempts.len());
    if starts.tumbles {
        tumble(&mut attempts, options, &mut watched);
    }
    let mut fit = report(&attempts, (watched.stopped, skipped), runs, options);
    fit.iterations += starts.iterations;
    fit.tried += starts.lost;
    fit
}

/// Continues the start that is furthest ahead of the best converged one until there is none, and sorts the starts, best
/// first.
fn finish(attempts: &mut [Attempt], options: &FitOptions, watched: &mut Watched<'_, '_>) {
    loop {
        attempts.sort_by(|a, b| {
            let violations = || a.solution.kkt.primal.total_cmp(&b.solution.kkt.primal);
            (a.record.near.total_cmp(&b.record.near)).then_with(violations)
        });
        let best = best_converged(attempts).unwrap_or(f64::INFINITY);
        let ahead = |a: &&mut Attempt| {
            let gains = best.is_infinite() || a.record.near < best * (1.0 - TIE);
            gains && a.may_go_on(options)
        };
        match attempts.iter_mut().find(ahead) {
            Some(attempt) if watched.stopped.is_none() => attempt.go_on(best, options, watched),
            _ => return,
        }
    }
}

/// Adds a start at the best converged solution and continues it, round by round, from better tumbles of its runs
/// ([`tumbles`]).
fn tumble(attempts: &mut Vec<Attempt>, options: &FitOptions, watched: &mut Watched<'_, '_>) {
    let Some(best) = attempts.iter().find(|a| a.has_converged()) else {
        return;
    };
    let mut attempt = best.again(attempts.len());
    let mut converged = None;
    watched.starts += 1;
    for round in 0..ROUNDS {
        let mut watch = |done| watched.search((round as f64 + done) / ROUNDS as f64);
        let z = &attempt.solution.iterate.z;
        let better = tumbles::better(&attempt.problem, z, options, round, &mut watch);
        if let Some(z) = better {
            attempt.improve(z, SCOUT_ITERATIONS, options, watched);
        }
        if watched.stopped.is_some() {
            break;
        }
        if attempt.has_converged() {
            converged = Some(attempt.solution.clone());
        }
    }
    if !attempt.has_converged() && watched.stopped.is_none() {
        let z = attempt.solution.iterate.z.clone();
        attempt.improve(z, options.max_iterations, options, watched);
    }
    if let (false, Some(converged)) = (attempt.has_converged(), converged) {
        attempt.record.near = converged.iterate.f;
        attempt.solution = converged;
    }
    if attempt.solution.iterate.f < best.solution.iterate.f {
        attempts.insert(0, attempt);
    }
}

/// The lowest objective of the converged starts.
fn best_converged(attempts: &[Attempt]) -> Option<f64> {
    let converged = attempts.iter().filter(|a| a.has_converged());
    converged.map(|a| a.record.near).min_by(f64::total_cmp)
}

/// The best objective, if only one start leads to it.
fn lone(attempts: &[Attempt]) -> Option<f64> {
    let best = best_converged(attempts)?;
    let agreeing = attempts.iter().filter(|a| agree(a.record.near, best));
    (agreeing.count() == 1).then_some(best)
}

/// The caller's observer, and whether it has stopped the fit.
struct Watched<'a, 'b> {
    observer: &'a mut Observer<'b>,
    order: usize,
    starts: usize,
    stopped: Option<Status>,
}

impl Watched<'_, '_> {
    /// Reports an iteration of a solve after `before` earlier iterations.
    fn show(&mut self, start: usize, before: usize, iteration: &Iteration) -> ControlFlow<Status> {
        let flow = (self.observer)(&Progress::Iterate(Iterate {
            order: self.order,
            start,
            starts: self.starts,
            iteration: &Iteration {
                number: before + iteration.number,
                ..*iteration
            },
        }));
        self.stopped = flow.break_value();
        flow
    }

    /// Reports the completed share of a search; returns true if it is to stop.
    fn search(&mut self, done: f64) -> bool {
        let order = self.order;
        let flow = (self.observer)(&Progress::Search { order, done });
        self.stopped = flow.break_value();
        self.stopped.is_some()
    }
}

/// Progress of a solve.
#[derive(Debug, Clone, Copy)]
struct Record {
    /// Number of the start, from 0.
    number: usize,
    /// Objective of the last iterate with nearly consistent states ([`NEAR`]), by which starts are compared. A solve
    /// may be interrupted after a long step, away from such an iterate.
    near: f64,
    /// Lowest objective of a feasible iterate ([`FEASIBLE`]).
    feasible: f64,
    iterations: usize,
    seconds: f64,
}

impl Record {
    fn see(&mut self, iteration: &Iteration) {
        let (f, violation) = (iteration.objective, iteration.kkt.primal);
        if violation < NEAR && f.is_finite() {
            self.near = f;
        }
        if violation < FEASIBLE {
            self.feasible = self.feasible.min(f);
        }
    }

    /// Runs the SQP from `z` for at most `limit` iterations, or until it loses against `best`.
    fn run(
        &mut self,
        problem: &Collocation,
        z: Vec<f64>,
        (limit, best): (usize, f64),
        options: &FitOptions,
        watched: &mut Watched<'_, '_>,
    ) -> Solution {
        let clock = Instant::now();
        let (number, before) = (self.number, self.iterations);
        let mut race = Race::against(best);
        let mut watch = |iteration: &Iteration| {
            self.see(iteration);
            let flow = watched.show(number, before, iteration);
            if flow.is_continue() && race.is_lost(iteration) {
                ControlFlow::Break(Status::Stopped)
            } else {
                flow
            }
        };
        let sqp_options = pilotage_sqp::SqpOptions {
            max_iterations: limit,
            ..sqp_options(options)
        };
        let solution = pilotage_collocation::solve(problem, z, &sqp_options, &mut watch);
        self.iterations += solution.work.iterations;
        self.seconds += clock.elapsed().as_secs_f64();
        solution
    }
}

/// A solve that can be continued.
struct Attempt {
    problem: Collocation,
    solution: Solution,
    record: Record,
    descents: usize,
}

impl Attempt {
    fn has_converged(&self) -> bool {
        self.solution.status == Status::Converged
    }

    /// Whether it ended by its iteration limit or by a lost race.
    fn may_go_on(&self, options: &FitOptions) -> bool {
        let cut_short = [Status::IterationLimit, Status::Stopped].contains(&self.solution.status);
        cut_short && self.record.iterations < options.max_iterations
    }

    /// A new start at the current iterate of this one.
    fn again(&self, number: usize) -> Self {
        Self {
            problem: self.problem.clone(),
            solution: self.solution.clone(),
            record: Record {
                number,
                iterations: 0,
                seconds: 0.0,
                ..self.record
            },
            descents: 1,
        }
    }

    fn report(&self) -> StartReport {
        StartReport {
            number: self.record.number + 1,
            status: self.solution.status,
            objective: self.solution.iterate.f,
            feasible: Some(self.record.feasible).filter(|f| f.is_finite()),
            kkt: self.solution.kkt.residual(),
            curvature: self.solution.curvature,
            iterations: self.record.iterations,
            seconds: self.record.seconds,
            descents: self.descents,
        }
    }
}

impl Attempt {
    /// Runs the first iterations.
    fn scout(
        (number, descents): (usize, usize),
        (problem, z): (Collocation, Vec<f64>),
        race: (usize, f64),
        options: &FitOptions,
        watched: &mut Watched<'_, '_>,
    ) -> Self {
        let mut record = Record {
            number,
            near: f64::INFINITY,
            feasible: f64::INFINITY,
            iterations: 0,
            seconds: 0.0,
        };
        let solution = record.run(&problem, z, race, options, watched);
        Self {
            problem,
            solution,
            record,
            descents,
        }
    }

    /// Runs the remaining iterations.
    fn go_on(&mut self, best: f64, options: &FitOptions, watched: &mut Watched<'_, '_>) {
        let left = options.max_iterations - self.record.iterations;
        let z = self.solution.iterate.z.clone();
        self.solution = (self.record).run(&self.problem, z, (left, best), options, watched);
    }

    /// Solves from these variables and keeps the result if it is feasible and better.
    fn improve(
        &mut self,
        z: Vec<f64>,
        limit: usize,
        options: &FitOptions,
        watched: &mut Watched<'_, '_>,
    ) {
        let (before, near) = (self.solution.iterate.f, self.record.near);
        let unraced = (limit.min(options.max_iterations), f64::INFINITY);
        let solution = (self.record).run(&self.problem, z, unraced, options, watched);
        match solution.iterate.f <= before && solution.kkt.primal < FEASIBLE {
            true => self.solution = solution,
            false => self.record.near = near,
        }
    }
}

/// The fit of the best converged start, or else of the most promising one. `stopped` is the status with which the
/// observer stopped the fit, if it did.
fn report(
    attempts: &[Attempt],
    (stopped, skipped): (Option<Status>, usize),
    runs: &Runs<'_>,
    options: &FitOptions,
) -> Fit {
    let converged = attempts.iter().find(|a| a.has_converged());
    let best = converged.unwrap_or(&attempts[0]);
    let Solution {
        iterate,
        status,
        kkt,
        curvature,
        ..
    } = &best.solution;
    let status = match stopped {
        Some(stopped) if converged.is_none() => stopped,
        _ => *status,
    };
    Fit {
        theta: best.problem.physical_theta(&iterate.z),
        objective: iterate.f,
        converged: converged.is_some(),
        status,
        kkt: kkt.residual(),
        violation: kkt.primal,
        curvature: *curvature,
        iterations: attempts.iter().map(|a| a.record.iterations).sum(),
        unknowns: iterate.z.len(),
        seconds: 0.0,
        starts: attempts.iter().map(Attempt::report).collect(),
        tried: attempts.iter().map(|a| a.descents).sum(),
        skipped,
        runs: runs(&best.problem, &iterate.z),
        closed_loop: None,
        unbounded: None,
        uncertainty: converged.and_then(|_| Uncertainty::of(&best.problem, iterate, options)),
        diagnostics: Vec::new(),
    }
}
