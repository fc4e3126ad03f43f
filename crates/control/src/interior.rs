//! A primal-dual interior-point method with a filter line search (Wächter & Biegler, *On the Implementation of an
//! Interior-Point Filter Line-Search Algorithm for Large-Scale Nonlinear Programming*, Math. Program. 106, 2006), whose
//! linear systems are those of `kkt`.
//!
//! All limits are of quantities `g` with slacks `s`. Where no step is acceptable, the objective is left aside until the
//! constraints are met better (the paper's restoration, by Newton steps on the constraints alone).

use crate::dense::dot;
use crate::kkt::{Aim, Factored, Linearised, Multipliers, Step};
use crate::program::{Program, Row, Values};

/// Options of a solve.
#[derive(Debug, Clone)]
pub struct Options {
    /// Largest residual of the optimality conditions of the scaled program. Default: 1e-8.
    pub tolerance: f64,
    /// Maximum number of iterations. Default: 500.
    pub most_iterations: usize,
    /// First barrier parameter. Default: 0.1; less from a point that is nearly optimal.
    pub barrier: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            tolerance: 1e-8,
            most_iterations: 500,
            barrier: 0.1,
        }
    }
}

/// Why a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The conditions of a local optimum hold.
    Converged,
    /// The constraints cannot be met better nearby.
    Infeasible,
    /// No step improves the point, or numbers are not finite.
    NoProgress,
    /// The iteration limit was reached.
    MaxIterations,
    /// The observer asked for it.
    Stopped,
}

/// A solved program.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Why the solve ended.
    pub status: Status,
    /// The variables.
    pub z: Vec<f64>,
    /// The objective, without the weighted steps of the controls.
    pub objective: f64,
    /// Multipliers of the defects: of midpoint and end of each interval.
    pub costates: Vec<f64>,
    /// Multipliers of the limited quantities, in the order of [`Program::rows`]: positive at an upper limit.
    pub multipliers: Vec<f64>,
    /// Multipliers of the equations at the ends.
    pub ends: Vec<f64>,
    /// Largest violation of a constraint, scaled.
    pub violation: f64,
    /// The most violated limit or equation at the ends, if any is.
    pub worst: Option<Row>,
    /// Residual of the optimality conditions.
    pub kkt: f64,
    /// Number of iterations.
    pub iterations: usize,
}

/// What an observer sees of an iteration.
#[derive(Debug, Clone, Copy)]
pub struct Iteration {
    /// Its number.
    pub number: usize,
    /// The objective.
    pub objective: f64,
    /// Largest violation.
    pub violation: f64,
    /// Residual of the optimality conditions.
    pub kkt: f64,
}

/// Constants of the paper, by its names.
const KAPPA_EPSILON: f64 = 10.0;
const KAPPA_MU: f64 = 0.2;
const THETA_MU: f64 = 1.5;
const TAU_MIN: f64 = 0.99;
const GAMMA_THETA: f64 = 1e-5;
const GAMMA_PHI: f64 = 1e-8;
const DELTA: f64 = 1.0;
const S_THETA: f64 = 1.1;
const S_PHI: f64 = 2.3;
const ETA_PHI: f64 = 1e-4;
const KAPPA_SIGMA: f64 = 1e10;
const S_MAX: f64 = 100.0;
const KAPPA_1: f64 = 1e-2;
/// Damping of the first attempt, its growth, its fall and its largest value.
const DAMPING: f64 = 1e-4;
const MOST_DAMPING: f64 = 1e12;
const MOST_FLOOR: f64 = 1e8;
/// Multiple of the tolerance at which a point counts as converged where no step improves it (IPOPT's `acceptable_tol`).
const ACCEPTABLE: f64 = 100.0;
/// Shortest step before the constraints are met alone.
const SHORTEST: f64 = 1e-7;
/// Largest gradient of the objective before it is scaled down.
const STEEPEST: f64 = 100.0;
/// Number of second-order corrections of a step.
const CORRECTIONS: usize = 4;
/// Number of attempts to meet the constraints alone.
const RESTORATIONS: usize = 20;

/// Solves the program from `z`. The observer sees each iteration and stops the solve with `false`.
pub fn solve(
    program: &Program,
    z: Vec<f64>,
    options: &Options,
    observer: &mut dyn FnMut(&Iteration) -> bool,
) -> Solution {
    let rows = program.rows();
    Solver::new(program, &rows, z, options).run(observer)
}

/// A slack with its multipliers.
#[derive(Debug, Clone, Copy)]
struct Slack {
    s: f64,
    /// Of the lower and the upper limit, zero where there is none.
    low: f64,
    high: f64,
}

struct Solver<'p> {
    program: &'p Program,
    rows: &'p (Vec<Row>, Vec<Row>),
    options: &'p Options,
    z: Vec<f64>,
    values: Values,
    slacks: Vec<Slack>,
    multipliers: Multipliers,
    mu: f64,
    /// Factor of the objective.
    factor: f64,
    damping: f64,
    filter: Vec<(f64, f64)>,
    most_violation: f64,
    least_violation: f64,
    /// Where the constraints are met alone: the point from which, and the violation there.
    apart: Option<(Vec<f64>, f64)>,
    restorations: usize,
    /// Damping to try at least, after a step that failed.
    floor: f64,
}

/// A direction: of the variables, slacks and multipliers.
struct Direction {
    step: Step,
    slacks: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
}

fn inside(value: f64, row: &Row) -> f64 {
    let range = row.upper - row.lower;
    let room = |limit: f64| {
        let least = KAPPA_1 * limit.abs().max(1.0);
        if range.is_finite() {
            least.min(KAPPA_1 * range)
        } else {
            least
        }
    };
    let (low, high) = (row.lower + room(row.lower), row.upper - room(row.upper));
    match (row.lower.is_finite(), row.upper.is_finite()) {
        (true, true) => value.clamp(low, high),
        (true, false) => value.max(low),
        _ => value.min(high),
    }
}

impl<'p> Solver<'p> {
    fn new(
        program: &'p Program,
        rows: &'p (Vec<Row>, Vec<Row>),
        z: Vec<f64>,
        options: &'p Options,
    ) -> Self {
        let mut values = Values::default();
        program.evaluate(&z, rows, &mut values);
        let mu = options.barrier;
        let slack = |(row, g): (&Row, &f64)| {
            let s = if g.is_finite() {
                inside(*g, row)
            } else {
                inside(0.0, row)
            };
            let of = |room: f64| if room.is_finite() { mu / room } else { 0.0 };
            Slack {
                s,
                low: of(s - row.lower),
                high: of(row.upper - s),
            }
        };
        let slacks: Vec<Slack> = rows.0.iter().zip(&values.g).map(slack).collect();
        let multipliers = Multipliers {
            c: vec![0.0; values.c.len()],
            e: vec![0.0; rows.1.len()],
            g: slacks.iter().map(|own| own.high - own.low).collect(),
        };
        let mut own = Self {
            program,
            rows,
            options,
            z,
            values,
            slacks,
            multipliers,
            mu,
            factor: 1.0,
            damping: 0.0,
            filter: Vec::new(),
            most_violation: f64::INFINITY,
            least_violation: 0.0,
            apart: None,
            restorations: 0,
            floor: 0.0,
        };
        let first = own.linearised();
        let gradient = first.aim_gradient(Aim::Objective(1.0));
        let steepest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        if steepest > STEEPEST {
            own.factor = STEEPEST / steepest;
        }
        let violation = own.violation(&own.values, &own.slacks);
        own.most_violation = 1e4 * violation.max(1.0);
        own.least_violation = 1e-4 * violation.max(1.0);
        own
    }

    fn linearised(&self) -> Linearised<'p> {
        Linearised::new(
            self.program,
            self.rows,
            &self.z,
            &self.multipliers,
            self.factor,
        )
    }

    fn is_finite(values: &Values) -> bool {
        let all = values.c.iter().chain(&values.g).chain(&values.e);
        values.f.is_finite() && all.copied().all(f64::is_finite)
    }

    /// ℓ1 norm of the constraints.
    fn violation(&self, values: &Values, slacks: &[Slack]) -> f64 {
        let pairs = values.g.iter().zip(slacks);
        let limited: f64 = pairs.map(|(g, own)| (g - own.s).abs()).sum();
        let equal = values.c.iter().chain(&values.e);
        limited + equal.map(|c| c.abs()).sum::<f64>()
    }

    /// The barrier objective.
    fn barrier(&self, values: &Values, slacks: &[Slack]) -> f64 {
        let mut sum = 0.0;
        for (row, own) in self.rows.0.iter().zip(slacks) {
            if row.lower.is_finite() {
                sum += (own.s - row.lower).ln();
            }
            if row.upper.is_finite() {
                sum += (row.upper - own.s).ln();
            }
        }
        self.factor * values.f - self.mu * sum
    }

    /// Residual of the optimality conditions with a barrier parameter.
    fn error(&self, linearised: &Linearised<'_>, mu: f64) -> f64 {
        let gradient =
            linearised.lagrangian_gradient(&self.multipliers, Aim::Objective(self.factor));
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let bounds: f64 = self.slacks.iter().map(|own| own.low + own.high).sum();
        let count = 2 * self.slacks.len();
        let equal: f64 = self
            .multipliers
            .c
            .iter()
            .chain(&self.multipliers.e)
            .map(|l| l.abs())
            .sum();
        let of = |sum: f64, count: usize| (sum / count.max(1) as f64).max(S_MAX) / S_MAX;
        let s_c = of(bounds, count);
        let s_d = of(
            bounds + equal,
            count + self.multipliers.c.len() + self.multipliers.e.len(),
        );
        let mut gap = 0.0_f64;
        for (row, own) in self.rows.0.iter().zip(&self.slacks) {
            if row.lower.is_finite() {
                gap = gap.max(((own.s - row.lower) * own.low - mu).abs());
            }
            if row.upper.is_finite() {
                gap = gap.max(((row.upper - own.s) * own.high - mu).abs());
            }
        }
        (largest(&gradient) / s_d)
            .max(gap / s_c)
            .max(self.infeasibility())
    }

    /// Largest violation of the equations, with the slacks.
    fn infeasibility(&self) -> f64 {
        let pairs = self.values.g.iter().zip(&self.slacks);
        let limited = pairs.map(|(g, own)| (g - own.s).abs());
        let equal = self.values.c.iter().chain(&self.values.e).map(|c| c.abs());
        limited.chain(equal).fold(0.0, f64::max)
    }

    fn run(mut self, observer: &mut dyn FnMut(&Iteration) -> bool) -> Solution {
        if !Self::is_finite(&self.values) {
            return self.finished(Status::NoProgress, f64::INFINITY, 0);
        }
        let mut number = 0;
        loop {
            let linearised = self.linearised();
            let kkt = self.error(&linearised, 0.0);
            let seen = Iteration {
                number,
                objective: self.values.f,
                violation: self.infeasibility(),
                kkt,
            };
            if kkt <= self.options.tolerance {
                return self.finished(Status::Converged, kkt, number);
            }
            if !observer(&seen) {
                return self.finished(Status::Stopped, kkt, number);
            }
            if number >= self.options.most_iterations {
                return self.finished(Status::MaxIterations, kkt, number);
            }
            if self.apart.is_none() {
                self.lower_barrier(&linearised);
            }
            if let Err(status) = self.step(&linearised) {
                let good = kkt <= ACCEPTABLE * self.options.tolerance;
                let status = if good { Status::Converged } else { status };
                return self.finished(status, kkt, number);
            }
            number += 1;
        }
    }

    fn lower_barrier(&mut self, linearised: &Linearised<'_>) {
        let least = self.options.tolerance / 10.0;
        while self.mu > least && self.error(linearised, self.mu) <= KAPPA_EPSILON * self.mu {
            self.mu = least.max((KAPPA_MU * self.mu).min(self.mu.powf(THETA_MU)));
            self.filter.clear();
        }
    }

    /// Factors the system, with as much damping as it needs.
    fn factored<'l>(
        &mut self,
        linearised: &'l Linearised<'p>,
        sigma: &[f64],
        aim: Aim<'_>,
    ) -> Option<Factored<'l, 'p>> {
        let mut damping = self.floor;
        loop {
            if let Some(factored) = Factored::new(linearised, sigma, damping, aim) {
                if damping > 0.0 {
                    self.damping = damping;
                }
                return Some(factored);
            }
            damping = match (damping > 0.0, self.damping > 0.0) {
                (false, false) => DAMPING,
                (false, true) => (self.damping / 3.0).max(1e-20),
                (true, false) => 100.0 * damping,
                (true, true) => 8.0 * damping,
            };
            if damping > MOST_DAMPING {
                return None;
            }
        }
    }

    fn step(&mut self, linearised: &Linearised<'p>) -> Result<(), Status> {
        let sigma: Vec<f64> =
            self.each(|row, own| own.low / (own.s - row.lower) + own.high / (row.upper - own.s));
        let apart = self.apart.clone();
        let aim = match &apart {
            Some((from, _)) => Aim::Near(from, self.mu.sqrt()),
            None => Aim::Objective(self.factor),
        };
        let factored = self
            .factored(linearised, &sigma, aim)
            .ok_or(Status::NoProgress)?;
        let gradient = linearised.aim_gradient(aim);
        let residual: Vec<f64> = self
            .values
            .g
            .iter()
            .zip(&self.slacks)
            .map(|(g, own)| g - own.s)
            .collect();
        let (c, e) = (self.values.c.clone(), self.values.e.clone());
        let make = |own: &Self, c: &[f64], e: &[f64], residual: &[f64]| {
            own.direction((linearised, &factored), (c, e, residual), &sigma, &gradient)
        };
        let direction = make(self, &c, &e, &residual).ok_or(Status::NoProgress)?;
        let tau = TAU_MIN.max(1.0 - self.mu);
        let longest = self.longest(&direction, tau);
        let accepted = match &apart {
            Some(_) => self.search_apart(&direction, longest),
            None => {
                let slope = self.slope(&gradient, &direction);
                let again = &|own: &Self, c: &[f64], e: &[f64], r: &[f64]| make(own, c, e, r);
                self.search(direction, (slope, longest), (&c, &e, &residual), tau, again)
            }
        };
        if accepted {
            self.floor = 0.0;
            return Ok(());
        }
        self.fall_back()
    }

    /// After a step of no use: more damping, or the constraints alone.
    fn fall_back(&mut self) -> Result<(), Status> {
        let violation = self.violation(&self.values, &self.slacks);
        let is_feasible = self.infeasibility() <= self.options.tolerance;
        if self.apart.is_some() {
            return Err(if is_feasible {
                Status::NoProgress
            } else {
                Status::Infeasible
            });
        }
        if is_feasible {
            self.floor = (100.0 * self.floor).max(10.0 * self.damping).max(DAMPING);
            return if self.floor > MOST_FLOOR {
                Err(Status::NoProgress)
            } else {
                Ok(())
            };
        }
        self.restorations += 1;
        if self.restorations > RESTORATIONS {
            return Err(Status::NoProgress);
        }
        self.floor = 0.0;
        let barrier = self.barrier(&self.values, &self.slacks);
        self.filter.push((
            (1.0 - GAMMA_THETA) * violation,
            barrier - GAMMA_PHI * violation,
        ));
        self.apart = Some((self.z.clone(), violation));
        Ok(())
    }

    fn each(&self, of: impl Fn(&Row, &Slack) -> f64) -> Vec<f64> {
        self.rows
            .0
            .iter()
            .zip(&self.slacks)
            .map(|(row, own)| of(row, own))
            .collect()
    }

    fn direction(
        &self,
        (linearised, factored): (&Linearised<'p>, &Factored<'_, 'p>),
        (c, e, residual): (&[f64], &[f64], &[f64]),
        sigma: &[f64],
        gradient: &[f64],
    ) -> Option<Direction> {
        let mu = self.mu;
        let pull = self.each(|row, own| mu / (row.upper - own.s) - mu / (own.s - row.lower));
        let pairs = pull.iter().zip(sigma).zip(residual);
        let weights: Vec<f64> = pairs.map(|((pull, sigma), r)| pull + sigma * r).collect();
        let step = factored.solve(c, e, &weights, gradient)?;
        let moved = linearised.times(&step.z);
        let slacks: Vec<f64> = moved.iter().zip(residual).map(|(d, r)| d + r).collect();
        let pairs = || self.rows.0.iter().zip(&self.slacks).zip(&slacks);
        let low = |((row, own), d): ((&Row, &Slack), &f64)| {
            (mu - own.low * d) / (own.s - row.lower) - own.low
        };
        let high = |((row, own), d): ((&Row, &Slack), &f64)| {
            (mu + own.high * d) / (row.upper - own.s) - own.high
        };
        Some(Direction {
            low: pairs().map(low).collect(),
            high: pairs().map(high).collect(),
            slacks,
            step,
        })
    }

    /// Longest steps of slacks and of multipliers within their limits.
    fn longest(&self, direction: &Direction, tau: f64) -> (f64, f64) {
        let (mut primal, mut dual) = (1.0_f64, 1.0_f64);
        for (r, (row, own)) in self.rows.0.iter().zip(&self.slacks).enumerate() {
            let d = direction.slacks[r];
            if d < 0.0 && row.lower.is_finite() {
                primal = primal.min(-tau * (own.s - row.lower) / d);
            }
            if d > 0.0 && row.upper.is_finite() {
                primal = primal.min(tau * (row.upper - own.s) / d);
            }
            for (value, d) in [(own.low, direction.low[r]), (own.high, direction.high[r])] {
                if d < 0.0 {
                    dual = dual.min(-tau * value / d);
                }
            }
        }
        (primal, dual)
    }

    /// Derivative of the barrier objective along a direction.
    fn slope(&self, gradient: &[f64], direction: &Direction) -> f64 {
        let mu = self.mu;
        let pull = self.each(|row, own| mu / (row.upper - own.s) - mu / (own.s - row.lower));
        dot(gradient, &direction.step.z) + dot(&pull, &direction.slacks)
    }

    fn trial(&self, direction: &Direction, alpha: f64) -> (Vec<f64>, Values, Vec<Slack>) {
        let z: Vec<f64> = self
            .z
            .iter()
            .zip(&direction.step.z)
            .map(|(z, d)| z + alpha * d)
            .collect();
        let mut values = Values::default();
        self.program.evaluate(&z, self.rows, &mut values);
        let moved = |(own, d): (&Slack, &f64)| Slack {
            s: own.s + alpha * d,
            ..*own
        };
        let slacks = self
            .slacks
            .iter()
            .zip(&direction.slacks)
            .map(moved)
            .collect();
        (z, values, slacks)
    }

    fn is_acceptable(&self, violation: f64, barrier: f64) -> bool {
        let beyond = |(other, lowest): &(f64, f64)| violation < *other || barrier < *lowest;
        violation <= self.most_violation && self.filter.iter().all(beyond)
    }

    #[allow(clippy::type_complexity)]
    fn search(
        &mut self,
        direction: Direction,
        (slope, longest): (f64, (f64, f64)),
        (c, e, residual): (&[f64], &[f64], &[f64]),
        tau: f64,
        again: &dyn Fn(&Self, &[f64], &[f64], &[f64]) -> Option<Direction>,
    ) -> bool {
        let violation = self.violation(&self.values, &self.slacks);
        let barrier = self.barrier(&self.values, &self.slacks);
        let rounding = 10.0 * f64::EPSILON * barrier.abs();
        let mut alpha = longest.0;
        let mut is_first = true;
        while alpha > SHORTEST {
            let switching = slope < 0.0
                && alpha * (-slope).powf(S_PHI) > DELTA * violation.powf(S_THETA)
                && violation <= self.least_violation;
            let judge = |own: &Self, values: &Values, slacks: &[Slack]| {
                if !Self::is_finite(values) {
                    return false;
                }
                let (t, b) = (own.violation(values, slacks), own.barrier(values, slacks));
                if !b.is_finite() || !own.is_acceptable(t, b - rounding) {
                    return false;
                }
                match switching {
                    true => b - barrier - rounding <= ETA_PHI * alpha * slope,
                    false => {
                        t <= (1.0 - GAMMA_THETA) * violation
                            || b - rounding <= barrier - GAMMA_PHI * violation
                    }
                }
            };
            let trial = self.trial(&direction, alpha);
            if judge(self, &trial.1, &trial.2) {
                self.note(switching, violation, barrier);
                self.accept(trial, &direction, (alpha, longest.1));
                return true;
            }
            if is_first
                && Self::is_finite(&trial.1)
                && self.violation(&trial.1, &trial.2) >= violation
            {
                let mut sums = (c.to_vec(), e.to_vec(), residual.to_vec());
                let mut last = (trial, alpha);
                let mut before = violation;
                for _ in 0..CORRECTIONS {
                    let (_, values, slacks) = &last.0;
                    let size = self.violation(values, slacks);
                    if size > 0.99 * before && before != violation {
                        break;
                    }
                    before = size;
                    let mix = |sum: &mut Vec<f64>, more: &mut dyn Iterator<Item = f64>| {
                        sum.iter_mut()
                            .zip(more)
                            .for_each(|(own, more)| *own = last.1 * *own + more);
                    };
                    mix(&mut sums.0, &mut values.c.iter().copied());
                    mix(&mut sums.1, &mut values.e.iter().copied());
                    mix(
                        &mut sums.2,
                        &mut values.g.iter().zip(slacks).map(|(g, own)| g - own.s),
                    );
                    let Some(corrected) = again(self, &sums.0, &sums.1, &sums.2) else {
                        break;
                    };
                    let own = self.longest(&corrected, tau);
                    let trial = self.trial(&corrected, own.0);
                    if judge(self, &trial.1, &trial.2) {
                        self.note(switching, violation, barrier);
                        self.accept(trial, &corrected, own);
                        return true;
                    }
                    if !Self::is_finite(&trial.1) {
                        break;
                    }
                    last = (trial, own.0);
                }
            }
            is_first = false;
            alpha *= 0.5;
        }
        false
    }

    /// Augments the filter after a step that is none of descent.
    fn note(&mut self, switching: bool, violation: f64, barrier: f64) {
        if !switching {
            self.filter.push((
                (1.0 - GAMMA_THETA) * violation,
                barrier - GAMMA_PHI * violation,
            ));
        }
    }

    /// A step that meets the constraints better.
    fn search_apart(&mut self, direction: &Direction, longest: (f64, f64)) -> bool {
        let violation = self.violation(&self.values, &self.slacks);
        let mut alpha = longest.0;
        while alpha > SHORTEST {
            let trial = self.trial(direction, alpha);
            let reached = self.violation(&trial.1, &trial.2);
            if Self::is_finite(&trial.1) && reached <= (1.0 - 1e-4 * alpha) * violation {
                let barrier = self.barrier(&trial.1, &trial.2);
                self.accept(trial, direction, (alpha, longest.1));
                let before = self.apart.as_ref().map_or(0.0, |(_, before)| *before);
                if reached <= 0.9 * before && self.is_acceptable(reached, barrier) {
                    self.apart = None;
                    // Those of the constraints alone say nothing of the objective.
                    self.multipliers.c.fill(0.0);
                    self.multipliers.e.fill(0.0);
                }
                return true;
            }
            alpha *= 0.5;
        }
        false
    }

    fn accept(
        &mut self,
        (z, values, slacks): (Vec<f64>, Values, Vec<Slack>),
        direction: &Direction,
        (alpha, dual): (f64, f64),
    ) {
        (self.z, self.values, self.slacks) = (z, values, slacks);
        let mu = self.mu;
        for (r, (row, own)) in self.rows.0.iter().zip(&mut self.slacks).enumerate() {
            own.low += dual * direction.low[r];
            own.high += dual * direction.high[r];
            let held = |value: f64, room: f64| match room.is_finite() {
                true => value.clamp(mu / (KAPPA_SIGMA * room), KAPPA_SIGMA * mu / room),
                false => 0.0,
            };
            own.low = held(own.low, own.s - row.lower);
            own.high = held(own.high, row.upper - own.s);
            self.multipliers.g[r] = own.high - own.low;
        }
        let blend = |own: &mut Vec<f64>, new: &[f64]| {
            own.iter_mut()
                .zip(new)
                .for_each(|(own, new)| *own += alpha * (new - *own));
        };
        let new = &direction.step;
        blend(&mut self.multipliers.c, &new.c);
        blend(&mut self.multipliers.e, &new.e);
    }

    fn finished(self, status: Status, kkt: f64, iterations: usize) -> Solution {
        let outside = |(row, g): (&Row, &f64)| ((row.lower - g).max(g - row.upper), Some(*row));
        let limited = self.rows.0.iter().zip(&self.values.g).map(outside);
        let equal = self
            .rows
            .1
            .iter()
            .zip(&self.values.e)
            .map(|(row, e)| (e.abs(), Some(*row)));
        let defects = self.values.c.iter().map(|c| (c.abs(), None));
        let all = limited.chain(equal).chain(defects);
        let (violation, worst) = all.fold(
            (0.0, None),
            |most, own| if own.0 > most.0 { own } else { most },
        );
        let back = |values: Vec<f64>| values.into_iter().map(|l| l / self.factor).collect();
        Solution {
            status,
            objective: self.values.f - self.values.steps,
            z: self.z,
            costates: back(self.multipliers.c),
            multipliers: back(self.multipliers.g),
            ends: back(self.multipliers.e),
            violation,
            worst,
            kkt,
            iterations,
        }
    }
}
