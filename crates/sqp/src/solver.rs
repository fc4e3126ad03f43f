//! The SQP loop (Nocedal & Wright, *Numerical Optimization*, 2nd ed., algorithm 18.3) with
//! Levenberg–Marquardt damping of the QP.

use super::curvature::Curvature;
use super::globalisation::Merit;
use super::iterate::violation;
use super::qp::{QpFailure, QpSolver, Step};
use super::solution::{Iteration, Solution, StepModel, Work};
use super::{Hessian, Iterate, Kkt, Problem, SqpOptions, Status, vector};
use std::ops::ControlFlow;

/// Factor by which the damping grows after a step with too little decrease.
const DAMPING_UP: f64 = 8.0;
/// Factor by which it shrinks after a step with the predicted decrease.
const DAMPING_DOWN: f64 = 0.1;
/// Damping below this is set to zero: the last steps are pure Newton steps.
const DAMPING_FLOOR: f64 = 1e-10;
/// Number of damping increases after which the line search may go down to its shortest step.
const PATIENCE: usize = 8;
/// Magnitude that no variable of a problem scaled to the order of one reaches.
const DIVERGED: f64 = 1e10;
/// Growth in a QP's elimination that is harmless.
const TAME_GROWTH: f64 = 10.0;
/// Factor by which one step may raise the growth above the harmless one.
const GROWTH_RISE: f64 = 100.0;
/// Violation up to which iterates are feasible, and relative change of the objective that counts as none, for
/// [`SqpOptions::stall`].
const FEASIBLE: f64 = 1e-6;
const UNCHANGED: f64 = 1e-8;
/// Multiple of the tolerance up to which a KKT residual is nearly that of an optimum, likewise; the ratio is that of IPOPT's
/// `acceptable_tol` and `tol`.
pub const ACCEPTABLE: f64 = 100.0;
/// Relative decrease of the violation below which the linearised constraints predict no progress.
const STATIONARY: f64 = 1e-6;

/// Solves `problem` from `start` with the given QP solver.
///
/// `observer` receives each iterate and may stop the solve with a status of its choice ([`Status::TimeLimit`],
/// [`Status::Interrupted`], [`Status::Stopped`]); the best iterate so far is then returned. A point that has converged
/// is returned as converged, whatever the observer returns.
///
/// # Panics
/// If the numbers of lower and upper limits differ, or if one is NaN.
pub fn solve<P: Problem + ?Sized, Q: QpSolver<P>>(
    problem: &P,
    qp: &mut Q,
    start: Vec<f64>,
    options: &SqpOptions,
    observer: &mut dyn FnMut(&Iteration) -> ControlFlow<Status>,
) -> Solution {
    let (lower, upper) = problem.limits();
    assert_eq!(lower.len(), upper.len(), "as many lower as upper limits");
    assert!(
        !lower.iter().chain(upper).any(|own| own.is_nan()),
        "a limit is NaN"
    );
    let current = Iterate::new(problem, start);
    Sqp {
        problem,
        qp,
        options,
        trial: current.clone(),
        current,
        step: Step::default(),
        merit: Merit::default(),
        damping: options.initial_damping,
        work: Work::default(),
        curvature: None,
        saddle: f64::INFINITY,
        still: (f64::INFINITY, 0),
        best: None,
        since: 0,
    }
    .run(observer)
}

/// State of the iteration; iterates are swapped, not copied.
pub(super) struct Sqp<'a, P: Problem + ?Sized, Q> {
    pub(super) problem: &'a P,
    pub(super) qp: &'a mut Q,
    pub(super) options: &'a SqpOptions,
    pub(super) current: Iterate,
    pub(super) trial: Iterate,
    pub(super) step: Step,
    pub(super) merit: Merit,
    pub(super) damping: f64,
    pub(super) work: Work,
    /// Smallest scaled curvature, at a KKT point.
    curvature: Option<f64>,
    /// Objective at the last saddle.
    pub(super) saddle: f64,
    /// Objective of the last iterate with another one, and number of feasible iterates since.
    still: (f64, usize),
    /// The feasible iterate with the lowest objective, with its KKT residual, and the number of iterates since.
    best: Option<(Iterate, Kkt)>,
    since: usize,
}

/// An accepted step.
pub(super) struct Accepted {
    pub(super) alpha: f64,
    pub(super) damping: f64,
    pub(super) model: StepModel,
}

impl<P: Problem + ?Sized, Q: QpSolver<P>> Sqp<'_, P, Q> {
    fn run(mut self, observer: &mut dyn FnMut(&Iteration) -> ControlFlow<Status>) -> Solution {
        if !self.current.is_finite() {
            return self.finish(Status::UndefinedStart, Kkt::UNDEFINED);
        }
        let mut last = Accepted {
            alpha: 0.0,
            damping: self.damping,
            model: StepModel::Start,
        };
        self.linearise();
        loop {
            let kkt = Kkt::at(self.problem, &self.current, self.qp.lagrangian_gradient());
            self.compare_with_best(kkt);
            let stop = observer(&self.log(&last, kkt)).break_value();
            let next = match self.verdict(kkt) {
                Verdict::Done(status) => Err(status),
                _ if let Some(status) = stop => Err(status),
                _ if self.has_stalled(kkt) => Err(Status::NoProgress),
                _ if self.work.iterations == self.options.max_iterations => {
                    Err(Status::IterationLimit)
                }
                Verdict::Saddle(curvature) => self.leave(&curvature),
                Verdict::GoOn => self.proceed(kkt),
            };
            match next {
                Ok(accepted) => last = accepted,
                Err(status) => return self.finish(status, kkt),
            }
        }
    }

    fn linearise(&mut self) {
        // Without multipliers the exact Hessian is only that of the objective.
        self.linearise_with(self.work.iterations > 0);
    }

    fn linearise_with(&mut self, exact: bool) {
        self.qp.linearise(self.problem, &self.current, exact);
        self.work.linearisations += 1;
    }

    /// Classifies the current point.
    fn verdict(&mut self, kkt: Kkt) -> Verdict {
        self.curvature = None;
        let residual = kkt.residual();
        if residual.is_nan() {
            // The values are finite, but the derivatives are not.
            return Verdict::Done(match self.work.iterations {
                0 => Status::UndefinedStart,
                _ => Status::NoProgress,
            });
        }
        if residual > self.options.tolerance {
            let is_feasible = kkt.primal <= self.options.tolerance;
            if is_feasible && self.has_diverged() {
                return Verdict::Done(Status::Unbounded);
            }
            if self.current.z.is_empty() {
                // There are no variables to change.
                return Verdict::Done(Status::Infeasible);
            }
            return Verdict::GoOn;
        }
        if self.work.iterations == 0 {
            self.linearise_with(true);
        }
        let curvature = self.qp.curvature(self.problem, &self.current);
        self.curvature = curvature.as_ref().map(|c| c.smallest);
        match curvature {
            Some(curvature) if curvature.is_negative() => Verdict::Saddle(curvature),
            _ => Verdict::Done(Status::Converged),
        }
    }

    /// One step that stays in the region in which its linearisation is valid: if the growth of the elimination rises by
    /// orders of magnitude, the step is undone and the damping raised. Beyond the stability limit of a simulation, a
    /// few such steps would lead to a point where the elimination has lost all digits and no QP makes progress.
    fn proceed(&mut self, kkt: Kkt) -> Result<Accepted, Status> {
        let limit = GROWTH_RISE * self.qp.growth().max(TAME_GROWTH);
        loop {
            let accepted = self.advance(kkt)?;
            self.linearise();
            if self.qp.growth() <= limit {
                self.merit.keep();
                return Ok(accepted);
            }
            std::mem::swap(&mut self.current, &mut self.trial);
            self.work.iterations -= 1;
            self.damping = accepted.damping;
            self.raise_damping();
            self.linearise();
        }
    }

    /// A step away from a saddle point.
    fn leave(&mut self, curvature: &Curvature) -> Result<Accepted, Status> {
        let accepted = self.leave_saddle(curvature).ok_or(Status::SaddlePoint)?;
        self.linearise();
        Ok(accepted)
    }

    /// One step: solves QPs with increasing damping until one passes the line search.
    fn advance(&mut self, kkt: Kkt) -> Result<Accepted, Status> {
        let mut raised = 0;
        while self.damping <= self.options.max_damping {
            let model = match self.solve_qp() {
                Ok(model) => model,
                Err(QpFailure::Infeasible) => return Err(Status::Infeasible),
                Err(QpFailure::NotConvex | QpFailure::NoSolution) => {
                    self.raise_damping();
                    continue;
                }
            };
            if self.is_stationary_for_violation() {
                return Err(match kkt.primal <= self.options.tolerance.sqrt() {
                    true => Status::NoProgress,
                    false => Status::Infeasible,
                });
            }
            let shortest = if raised < PATIENCE {
                self.options.short_step
            } else {
                self.options.min_step
            };
            if let Some((alpha, ratio)) = self.search(shortest) {
                let damping = self.damping;
                self.accept(alpha, ratio);
                return Ok(Accepted {
                    alpha,
                    damping,
                    model,
                });
            }
            raised += 1;
            self.raise_damping();
        }
        Err(Status::NoProgress)
    }

    /// Keeps the best feasible iterate.
    fn compare_with_best(&mut self, kkt: Kkt) {
        self.since += 1;
        let f = self.current.f;
        let best = self.best.as_ref().map(|(own, _)| own.f);
        if kkt.primal <= FEASIBLE && best.is_none_or(|best| f < best) {
            if best.is_none_or(|best| f < best - UNCHANGED * best.abs()) {
                self.since = 0;
            }
            self.best = Some((self.current.clone(), kkt));
        }
    }

    /// Whether feasible iterates have had one objective for long, or none has been better for long than one that is nearly
    /// optimal: where a variable changes nothing, steps lead anywhere.
    fn has_stalled(&mut self, kkt: Kkt) -> bool {
        let (f, (before, count)) = (self.current.f, self.still);
        let is_still = kkt.primal <= FEASIBLE && (f - before).abs() <= UNCHANGED * f.abs();
        self.still = match is_still {
            true => (before, count + 1),
            false => (f, 0),
        };
        let nearly = ACCEPTABLE * self.options.tolerance;
        let is_nearly_optimal = |(_, kkt): &(Iterate, Kkt)| kkt.residual() <= nearly;
        let wanders = self.best.as_ref().is_some_and(is_nearly_optimal);
        // A variable that grows takes several infeasible steps in a row.
        let count = if wanders { self.since / 2 } else { 0 };
        let count = count.max(self.still.1);
        self.options.stall.is_some_and(|most| count >= most)
    }

    fn has_diverged(&self) -> bool {
        self.current.z.iter().any(|z| z.abs() > DIVERGED)
    }

    /// True if the linearised constraints are inconsistent and even their relaxed QP does not lower the violation: a
    /// stationary point of its ℓ1 norm (Byrd, Curtis & Nocedal, SIAM J. Optim. 20, 2010).
    fn is_stationary_for_violation(&self) -> bool {
        let equalities: f64 = self.step.residual.iter().map(|c| c.abs()).sum();
        let left = self.step.violation + equalities;
        if left == 0.0 {
            return false;
        }
        let (lower, upper) = self.problem.limits();
        let outside = self.current.g.iter().zip(lower.iter().zip(upper));
        let inequalities: f64 = outside.map(|(g, (l, u))| violation(*g, *l, *u)).sum();
        let now = inequalities + self.current.c.iter().map(|c| c.abs()).sum::<f64>();
        now - left <= STATIONARY * now
    }

    /// Solves the QP with the exact Hessian if that is convex, otherwise with Gauss–Newton.
    fn solve_qp(&mut self) -> Result<StepModel, QpFailure> {
        if self.work.iterations > 0 {
            self.work.qps += 1;
            match self
                .qp
                .solve(self.problem, Hessian::Exact, self.damping, &mut self.step)
            {
                Err(QpFailure::NotConvex) => {}
                outcome => return outcome.map(|()| StepModel::Exact),
            }
        }
        self.work.qps += 1;
        self.qp
            .solve(
                self.problem,
                Hessian::GaussNewton,
                self.damping,
                &mut self.step,
            )
            .map(|()| StepModel::GaussNewton)
    }

    /// Makes `trial` current and adapts the damping to the accuracy of the model.
    fn accept(&mut self, alpha: f64, ratio: f64) {
        if alpha < 0.5 || ratio < 0.25 {
            self.raise_damping();
        } else if alpha == 1.0 && ratio > 0.5 {
            self.damping *= DAMPING_DOWN;
            if self.damping < DAMPING_FLOOR {
                self.damping = 0.0;
            }
        }
        self.take_trial();
    }

    /// Makes `trial` current.
    pub(super) fn take_trial(&mut self) {
        std::mem::swap(&mut self.current, &mut self.trial);
        self.work.iterations += 1;
    }

    fn raise_damping(&mut self) {
        self.damping = (self.damping * DAMPING_UP).max(1e-6);
    }

    fn log(&self, last: &Accepted, kkt: Kkt) -> Iteration {
        Iteration {
            number: self.work.iterations,
            objective: self.current.f,
            kkt,
            step: last.alpha,
            length: self.last_change(),
            damping: last.damping,
            penalty: self.merit.penalty(),
            active: self.step.active,
            model: last.model,
        }
    }

    /// Largest change of a variable by the last step; after a step, `trial` holds the previous iterate.
    fn last_change(&self) -> f64 {
        vector::largest_of([&self.current.z, &self.trial.z], |[a, b]| a - b)
    }

    /// Ends with the current iterate; without progress with the best one, if steps have led away from it.
    fn finish(mut self, status: Status, mut kkt: Kkt) -> Solution {
        let has_led_away =
            |(own, _): &(Iterate, Kkt)| kkt.primal > FEASIBLE || own.f < self.current.f;
        if status == Status::NoProgress
            && let Some((best, own)) = self.best.take_if(|best| has_led_away(best))
        {
            (self.current, kkt) = (best, own);
        }
        Solution {
            status,
            iterate: self.current,
            kkt,
            curvature: self.curvature,
            work: self.work,
        }
    }
}

/// Classification of a point by its KKT residual and its curvature.
enum Verdict {
    /// The solve ends here.
    Done(Status),
    /// First-order optimal, but with negative curvature.
    Saddle(Curvature),
    /// Neither.
    GoOn,
}
