//! The SQP from several starts: losers stop early, the most promising is finished.

use super::race::{Race, TIE};
use super::result::{FEASIBLE, StartReport, agree};
use super::solve::{Iterate, Observer, Progress, sqp_options};
use super::{Fit, FitOptions, RunFit, Uncertainty, tumbles};
use pilotage_collocation::Collocation;
use pilotage_sqp::{Iteration, Solution, Status};
use std::ops::ControlFlow;
use std::time::Instant;

/// SQP iterations from each start before the most promising is finished.
const SCOUT_ITERATIONS: usize = 60;
/// Times that the best start tries other tumbles.
const ROUNDS: u64 = 4;
/// Scaled violation of the constraints below which the states are nearly consistent, so that the objective
/// tells how promising a start is.
pub(super) const NEAR: f64 = 1e-2;

/// Where a solve starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// θ.
    pub theta: Vec<f64>,
    /// States of each run at its samples; none: those that follow from the data.
    pub states: Option<Vec<Vec<Vec<f64>>>>,
    /// How many descents of the linearised problem ended here; 1 where it comes from elsewhere.
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

/// Where the SQP starts.
#[derive(Debug, Clone, Default)]
pub struct Starts {
    /// Those that all run.
    pub all: Vec<Start>,
    /// Those that join, one after another, while one start alone leads to the best objective; where
    /// [`Self::tumbles`], while none has converged.
    pub spare: Vec<Start>,
    /// True where the best that these lead to is to be looked at with other initial states (module `tumbles`).
    pub tumbles: bool,
    /// Descents of the linearised problem that ended elsewhere.
    pub lost: usize,
    /// SQP iterations that finding them took.
    pub iterations: usize,
}

/// Makes the runs of a solution.
pub(super) type Runs<'a> = dyn Fn(&Collocation, &[f64]) -> Vec<RunFit> + 'a;

/// Runs the SQP from each start for some iterations, then goes on with the most promising until none is
/// ahead of the best that has converged.
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

/// Goes on with the start that is most ahead of the best converged one, until there is none, and sorts
/// them, best first.
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

/// Adds a start that begins where the best has converged, and goes on from better tumbles of its runs
/// ([`tumbles`]), round by round.
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

/// The least objective of the converged starts.
fn best_converged(attempts: &[Attempt]) -> Option<f64> {
    let converged = attempts.iter().filter(|a| a.has_converged());
    converged.map(|a| a.record.near).min_by(f64::total_cmp)
}

/// The best objective, if one start alone leads to it.
fn lone(attempts: &[Attempt]) -> Option<f64> {
    let best = best_converged(attempts)?;
    let agreeing = attempts.iter().filter(|a| agree(a.record.near, best));
    (agreeing.count() == 1).then_some(best)
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

    /// Shows the part of a search that is done; true where it is to end.
    fn search(&mut self, done: f64) -> bool {
        let order = self.order;
        let flow = (self.observer)(&Progress::Search { order, done });
        self.stopped = flow.break_value();
        self.stopped.is_some()
    }
}

/// How a solve goes.
#[derive(Debug, Clone, Copy)]
struct Record {
    /// Which start, from 0.
    number: usize,
    /// Objective of the last iterate whose states are nearly consistent ([`NEAR`]): what the starts are
    /// compared by. A solve may be cut short after a long step, away from such an iterate.
    near: f64,
    /// Least objective of a feasible iterate ([`FEASIBLE`]).
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

/// A solve that may go on.
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

    /// True when it ended for its limit on iterations or a lost race.
    fn may_go_on(&self, options: &FitOptions) -> bool {
        let cut_short = [Status::IterationLimit, Status::Stopped].contains(&self.solution.status);
        cut_short && self.record.iterations < options.max_iterations
    }

    /// Another start, which is where this one has come to.
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
    /// The first iterations.
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

    /// The iterations that are left.
    fn go_on(&mut self, best: f64, options: &FitOptions, watched: &mut Watched<'_, '_>) {
        let left = options.max_iterations - self.record.iterations;
        let z = self.solution.iterate.z.clone();
        self.solution = (self.record).run(&self.problem, z, (left, best), options, watched);
    }

    /// Goes to where these variables lead, if that is feasible and better.
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

/// Of the best that has converged, or the most promising. `stopped` is why the observer ended the fit, if it
/// did.
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
