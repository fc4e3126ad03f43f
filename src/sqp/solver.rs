//! The SQP loop (Nocedal & Wright, *Numerical Optimization*, 2nd ed., algorithm 18.3) with
//! Levenberg–Marquardt damping of the QP.

use super::globalisation::{Merit, infeasibility};
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
/// Shortest step length tried before the damping is raised instead.
const SHORT_STEP: f64 = 0.2;
/// Raises of the damping after which the line search may go down to its limit.
const PATIENCE: usize = 8;

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
            let shortest = if raised < PATIENCE {
                SHORT_STEP
            } else {
                self.options.min_step
            };
            if let Some(alpha) = self.search(shortest) {
                let damping = self.damping;
                self.accept(alpha);
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

    /// Backtracking on the merit, with one second-order correction at full length. Leaves the
    /// accepted point in `trial`.
    fn search(&mut self, shortest: f64) -> Option<f64> {
        let outside = infeasibility(self.problem, &self.current);
        let slope: f64 = self
            .qp
            .gradient()
            .iter()
            .zip(&self.step.d)
            .map(|(g, d)| g * d)
            .sum();
        let decrease = (outside - self.step.violation).max(0.0);
        let descent = self.merit.prepare(slope, self.step.curvature, decrease);
        let merit = self.merit.value(self.problem, &self.current);
        // Differences below rounding cannot be told from a decrease.
        let rounding = 10.0 * f64::EPSILON * merit.abs();
        let armijo = self.options.armijo;
        let enough =
            |value: f64, alpha: f64| value <= merit + armijo * alpha * descent.min(0.0) + rounding;
        let mut alpha = 1.0;
        while alpha >= shortest {
            self.try_step(alpha);
            if enough(self.merit.value(self.problem, &self.trial), alpha) {
                return Some(alpha);
            }
            if alpha == 1.0
                && self.corrected()
                && enough(self.merit.value(self.problem, &self.trial), 1.0)
            {
                return Some(alpha);
            }
            alpha *= 0.5;
        }
        None
    }

    /// Second-order correction of the full step into `trial`.
    fn corrected(&mut self) -> bool {
        if !self.trial.is_finite() {
            return false;
        }
        let uncorrected = self.step.clone();
        self.work.qps += 1;
        if self
            .qp
            .correct(self.problem, &self.trial, &mut self.step)
            .is_err()
        {
            self.step = uncorrected;
            return false;
        }
        self.try_step(1.0);
        // The multipliers and, for shorter steps, the direction are those of the QP.
        self.step = uncorrected;
        true
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
        self.work.evaluations += 1;
    }

    /// Makes `trial` current, moves the multipliers by the same fraction, adapts the damping.
    fn accept(&mut self, alpha: f64) {
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
        let before = self.merit.value(self.problem, &self.current);
        let after = self.merit.value(self.problem, &self.trial);
        let slope: f64 = self
            .qp
            .gradient()
            .iter()
            .zip(&self.step.d)
            .map(|(g, d)| g * d)
            .sum();
        let outside = infeasibility(self.problem, &self.current) - self.step.violation;
        let predicted = alpha * (self.merit.penalty() * outside - slope)
            - 0.5 * alpha * alpha * self.step.curvature;
        let ratio = (before - after) / predicted;
        if alpha < 0.5 || ratio < 0.25 {
            self.raise_damping();
        } else if alpha == 1.0 && (ratio > 0.5 || predicted < 1e-10 * before.abs()) {
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

/// `out = from + alpha (to - from)`.
fn blend(out: &mut [f64], from: &[f64], to: &[f64], alpha: f64) {
    for ((o, f), t) in out.iter_mut().zip(from).zip(to) {
        *o = f + alpha * (t - f);
    }
}
