//! The SQP loop (Nocedal & Wright, *Numerical Optimization*, 2nd ed., algorithm 18.3) with
//! Levenberg–Marquardt damping of the QP.

use super::globalisation::{Merit, Model};
use super::iterate::violation;
use super::qp::{QpFailure, QpSolver, Step};
use super::solution::{Iteration, Solution, Work};
use super::{Hessian, Iterate, Kkt, Options, Problem, Status};
use std::ops::ControlFlow;

/// Factor by which the damping grows after a step that brought too little.
const DAMPING_UP: f64 = 8.0;
/// Factor by which it shrinks after a step that brought what the model said.
const DAMPING_DOWN: f64 = 0.1;
/// Damping below this is none: the last steps are pure Newton.
const DAMPING_FLOOR: f64 = 1e-10;
/// Longest second-order correction, relative to the step or the correction before it.
const CORRECTION_RATE: f64 = 0.5;
/// Limit on second-order corrections of one step.
const MAX_CORRECTIONS: usize = 6;
/// Raises of the damping after which the line search may go down to its limit.
const PATIENCE: usize = 8;
/// Magnitude that no variable of a problem scaled to the order of one reaches.
const DIVERGED: f64 = 1e10;
/// Relative decrease of the violation below which the linearised constraints promise none.
const STATIONARY: f64 = 1e-6;

/// Solves `problem` from `start` with the given QP solver.
///
/// `observer` sees each iterate and may stop the solve; the best iterate so far is then returned.
pub fn solve<P: Problem + ?Sized, Q: QpSolver<P>>(
    problem: &P,
    qp: &mut Q,
    start: Vec<f64>,
    options: &Options,
    observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
) -> Solution {
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
    }
    .run(observer)
}

/// Everything that an iteration works on; iterates are swapped, not copied.
struct Sqp<'a, P: Problem + ?Sized, Q> {
    problem: &'a P,
    qp: &'a mut Q,
    options: &'a Options,
    current: Iterate,
    trial: Iterate,
    step: Step,
    merit: Merit,
    damping: f64,
    work: Work,
}

/// An accepted step.
struct Accepted {
    alpha: f64,
    damping: f64,
    exact: bool,
}

impl<P: Problem + ?Sized, Q: QpSolver<P>> Sqp<'_, P, Q> {
    fn run(mut self, observer: &mut dyn FnMut(&Iteration) -> ControlFlow<()>) -> Solution {
        if !self.current.is_finite() {
            return self.finish(Status::UndefinedStart, Kkt::default());
        }
        let mut last = Accepted {
            alpha: 0.0,
            damping: self.damping,
            exact: false,
        };
        loop {
            // Without multipliers the exact Hessian is that of the objective alone.
            self.qp
                .linearise(self.problem, &self.current, self.work.iterations > 0);
            self.work.linearisations += 1;
            let kkt = Kkt::at(self.problem, &self.current, self.qp.lagrangian_gradient());
            let stop = observer(&self.log(&last, kkt)).is_break();
            if kkt.residual() <= self.options.tolerance {
                return self.finish(Status::Converged, kkt);
            }
            if stop {
                return self.finish(Status::Stopped, kkt);
            }
            if kkt.primal <= self.options.tolerance && self.has_diverged() {
                return self.finish(Status::Unbounded, kkt);
            }
            if self.work.iterations == self.options.max_iterations {
                return self.finish(Status::IterationLimit, kkt);
            }
            match self.advance() {
                Some(accepted) => last = accepted,
                None => {
                    let feasible = kkt.primal <= self.options.tolerance.sqrt();
                    let status = if feasible {
                        Status::NoProgress
                    } else {
                        Status::Infeasible
                    };
                    return self.finish(status, kkt);
                }
            }
        }
    }

    /// One step: QPs of growing damping until one passes the line search. None when none does.
    fn advance(&mut self) -> Option<Accepted> {
        let mut raised = 0;
        while self.damping <= self.options.max_damping {
            let exact = match self.solve_qp() {
                Ok(exact) => exact,
                Err(QpFailure::Infeasible) => return None,
                Err(QpFailure::NotConvex | QpFailure::NoSolution) => {
                    self.raise_damping();
                    continue;
                }
            };
            if self.is_stationary_for_violation() {
                return None;
            }
            let shortest = if raised < PATIENCE {
                self.options.short_step
            } else {
                self.options.min_step
            };
            if let Some((alpha, ratio)) = self.search(shortest) {
                let damping = self.damping;
                self.accept(alpha, ratio);
                return Some(Accepted {
                    alpha,
                    damping,
                    exact,
                });
            }
            raised += 1;
            self.raise_damping();
        }
        None
    }

    fn has_diverged(&self) -> bool {
        self.current.z.iter().any(|z| z.abs() > DIVERGED)
    }

    /// True when the linearised constraints are inconsistent and even their relaxed QP does not lower
    /// the violation: a stationary point of its ℓ1 norm (Byrd, Curtis & Nocedal, SIAM J. Optim. 20,
    /// 2010).
    fn is_stationary_for_violation(&self) -> bool {
        let (lower, upper) = self.problem.limits();
        let outside = self.current.g.iter().zip(lower.iter().zip(upper));
        let inequalities: f64 = outside.map(|(g, (l, u))| violation(*g, *l, *u)).sum();
        let now = inequalities + self.current.c.iter().map(|c| c.abs()).sum::<f64>();
        let equalities: f64 = self.step.residual.iter().map(|c| c.abs()).sum();
        let left = self.step.violation + equalities;
        left > 0.0 && now - left <= STATIONARY * now
    }

    /// The QP with the exact Hessian where that is convex, else with Gauss–Newton.
    fn solve_qp(&mut self) -> Result<bool, QpFailure> {
        if self.work.iterations > 0 {
            self.work.qps += 1;
            match self
                .qp
                .solve(self.problem, Hessian::Exact, self.damping, &mut self.step)
            {
                Err(QpFailure::NotConvex) => {}
                outcome => return outcome.map(|()| true),
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
            .map(|()| false)
    }

    /// The step length at which the merit falls enough, and how the fall compares with the model's.
    /// Leaves the accepted point in `trial`.
    fn search(&mut self, shortest: f64) -> Option<(f64, f64)> {
        let slope: f64 = self
            .qp
            .gradient()
            .iter()
            .zip(&self.step.d)
            .map(|(g, d)| g * d)
            .sum();
        let model = self
            .merit
            .prepare(self.problem, &self.current, &self.step, slope);
        let start = self.merit.value(self.problem, &self.current);
        let test = Descent {
            start,
            model,
            armijo: self.options.armijo,
        };
        if let Some(ratio) = self.full_step(&test) {
            return Some((1.0, ratio));
        }
        let mut alpha = 0.5;
        while alpha >= shortest {
            self.try_step(alpha);
            let value = self.merit.value(self.problem, &self.trial);
            if test.passes(value, alpha) {
                return Some((alpha, test.ratio(value)));
            }
            alpha *= 0.5;
        }
        None
    }

    /// The full step, as it is or with a second-order correction, if either passes and the correction
    /// is short.
    fn full_step(&mut self, test: &Descent) -> Option<f64> {
        self.try_step(1.0);
        let value = self.merit.value(self.problem, &self.trial);
        if test.is_rounding() && test.passes(value, 1.0) {
            // The merit says nothing any more; a Newton step still improves the residual.
            return Some(1.0);
        }
        if !value.is_finite() {
            return None;
        }
        let uncorrected = self.trial.z.clone();
        let mut step = self.step.clone();
        let mut length = largest(&step.d);
        for round in 0..MAX_CORRECTIONS {
            let moved = self.correct(&mut step)?;
            if moved > CORRECTION_RATE * length {
                return None;
            }
            if round == 0 && test.passes(value, 1.0) {
                self.trial.z = uncorrected;
                self.trial.evaluate(self.problem);
                return Some(test.ratio(value));
            }
            let corrected = self.merit.value(self.problem, &self.trial);
            if test.passes(corrected, 1.0) {
                return Some(test.ratio(corrected));
            }
            length = moved;
        }
        None
    }

    /// Second-order correction of `step`, which led to `trial`. Returns how far it moves the trial: a
    /// simplified Newton step, short beside the one before where the linearisation holds (Deuflhard,
    /// *Newton Methods for Nonlinear Problems*, 2004, section 3.3).
    fn correct(&mut self, step: &mut Step) -> Option<f64> {
        self.work.qps += 1;
        self.qp.correct(self.problem, &self.trial, step).ok()?;
        let mut moved: f64 = 0.0;
        let points = self.trial.z.iter_mut().zip(&self.current.z).zip(&step.d);
        for ((trial, z), d) in points {
            moved = moved.max((z + d - *trial).abs());
            *trial = z + d;
        }
        self.trial.evaluate(self.problem);
        self.work.evaluations += 1;
        self.trial.is_finite().then_some(moved)
    }

    fn try_step(&mut self, alpha: f64) {
        for ((t, z), d) in self
            .trial
            .z
            .iter_mut()
            .zip(&self.current.z)
            .zip(&self.step.d)
        {
            *t = z + alpha * d;
        }
        self.trial.evaluate(self.problem);
        blend(
            &mut self.trial.lambda,
            &self.current.lambda,
            &self.step.lambda,
            alpha,
        );
        blend(
            &mut self.trial.eta,
            &self.current.eta,
            &self.step.eta,
            alpha,
        );
        self.work.evaluations += 1;
    }

    /// Makes `trial` current and adapts the damping to how well the model held.
    fn accept(&mut self, alpha: f64, ratio: f64) {
        if alpha < 0.5 || ratio < 0.25 {
            self.raise_damping();
        } else if alpha == 1.0 && ratio > 0.5 {
            self.damping *= DAMPING_DOWN;
            if self.damping < DAMPING_FLOOR {
                self.damping = 0.0;
            }
        }
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
            damping: last.damping,
            penalty: self.merit.penalty(),
            active: self.step.active,
            exact: last.exact,
        }
    }

    fn finish(self, status: Status, kkt: Kkt) -> Solution {
        Solution {
            status,
            iterate: self.current,
            kkt,
            work: self.work,
        }
    }
}

/// Largest magnitude.
fn largest(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |m, x| x.abs().max(m))
}

/// Test of a trial point's merit (Armijo; Nocedal & Wright, eq. 3.6a), blind to rounding.
struct Descent {
    start: f64,
    model: Model,
    armijo: f64,
}

impl Descent {
    /// Differences below this cannot be told from a decrease.
    fn rounding(&self) -> f64 {
        100.0 * f64::EPSILON * self.start.abs()
    }

    fn is_rounding(&self) -> bool {
        self.model.decrease.abs() <= 10.0 * self.rounding()
    }

    fn passes(&self, value: f64, alpha: f64) -> bool {
        value <= self.start + self.armijo * alpha * self.model.derivative.min(0.0) + self.rounding()
    }

    /// Decrease over the decrease that the model predicts for the full step.
    fn ratio(&self, value: f64) -> f64 {
        (self.start - value + self.rounding()) / (self.model.decrease + self.rounding())
    }
}

/// `out = from + alpha (to - from)`.
fn blend(out: &mut [f64], from: &[f64], to: &[f64], alpha: f64) {
    for ((o, f), t) in out.iter_mut().zip(from).zip(to) {
        *o = f + alpha * (t - f);
    }
}
