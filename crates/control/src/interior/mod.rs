//! A primal-dual interior-point method with a filter line search (Wächter & Biegler, *On the Implementation of an
//! Interior-Point Filter Line-Search Algorithm for Large-Scale Nonlinear Programming*, Math. Program. 106, 2006), whose
//! linear systems are those of `kkt`.
//!
//! All limits are of quantities `g` with slacks `s`. Where no step is acceptable, the objective is left aside until the
//! constraints are met better (the paper's restoration, by Newton steps on the constraints alone).

mod direction;
mod linearise;
mod point;
mod search;

use crate::evaluation::Derivatives;
use crate::evaluation::Evaluator;
use crate::evaluation::Weights;
use crate::kkt::Kkt;
use crate::kkt::Linearised;
use crate::program::Program;
use crate::program::Row;
use crate::rows::Jacobian;
use direction::Direction;
use pilotage_collocation::simd::Lanes;
pub use pilotage_sqp::Status;
use point::Point;

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
const KAPPA_SIGMA: f64 = 1e10;
const S_MAX: f64 = 100.0;
/// Damping of the first attempt, and its largest value.
const DAMPING: f64 = 1e-4;
const MOST_DAMPING: f64 = 1e12;
const MOST_FLOOR: f64 = 1e8;
/// Multiple of the tolerance at which a point counts as converged where no step improves it (IPOPT's `acceptable_tol`).
const ACCEPTABLE: f64 = 100.0;
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

/// Multipliers: of the defects, of the equations at the ends, and of lower and upper limits, 0 where there is none.
#[derive(Debug, Clone, Default)]
struct Multipliers {
    c: Vec<Lanes>,
    e: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
}

impl Multipliers {
    /// Of the limited quantities: positive at an upper limit.
    fn of_limits(&self) -> impl Iterator<Item = f64> {
        self.low
            .iter()
            .zip(&self.high)
            .map(|(low, high)| high - low)
    }
}

struct Solver<'p> {
    program: &'p Program,
    rows: &'p (Vec<Row>, Vec<Row>),
    options: &'p Options,
    evaluator: Evaluator<'p>,
    kkt: Kkt<'p>,
    linearised: Linearised,
    here: Point,
    trial: Point,
    multipliers: Multipliers,
    weights: Weights,
    direction: Direction,
    corrected: Direction,
    /// Gradients of the objective (or the distance that stands for it), and of the Lagrangian.
    aim: Vec<f64>,
    lagrangian: Vec<f64>,
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

impl<'p> Solver<'p> {
    fn new(
        program: &'p Program,
        rows: &'p (Vec<Row>, Vec<Row>),
        z: Vec<f64>,
        options: &'p Options,
    ) -> Self {
        let evaluator = Evaluator::new(program);
        let [limited, equations] =
            [&rows.0, &rows.1].map(|rows| Jacobian::new(&evaluator, program, rows));
        let linearised = Linearised {
            derivatives: Derivatives::default(),
            sigma: Vec::new(),
            of_outputs: Vec::new(),
            limited,
            equations,
            damping: 0.0,
            is_exact: true,
            smooth: 0.0,
        };
        let mut own = Self {
            kkt: Kkt::new(program, rows),
            aim: vec![0.0; z.len()],
            lagrangian: vec![0.0; z.len()],
            here: Point {
                z,
                ..Point::default()
            },
            trial: Point::default(),
            multipliers: Multipliers::default(),
            weights: Weights::default(),
            direction: Direction::default(),
            corrected: Direction::default(),
            mu: options.barrier,
            factor: 1.0,
            damping: 0.0,
            filter: Vec::new(),
            most_violation: f64::INFINITY,
            least_violation: 0.0,
            apart: None,
            restorations: 0,
            floor: 0.0,
            program,
            rows,
            options,
            evaluator,
            linearised,
        };
        own.begin();
        own
    }

    /// Residual of the optimality conditions with a barrier parameter, from that of the dual and the primal ones.
    fn error(&self, mu: f64) -> f64 {
        let Multipliers { c, e, low, high } = &self.multipliers;
        let bounds: f64 = low.iter().chain(high).sum();
        let count = 2 * low.len();
        let equal = c
            .as_flattened()
            .iter()
            .chain(e)
            .map(|l| l.abs())
            .sum::<f64>();
        let of = |sum: f64, count: usize| (sum / count.max(1) as f64).max(S_MAX) / S_MAX;
        let defects = 2 * self.program.n() * self.program.intervals();
        let s_d = of(bounds + equal, count + defects + e.len());
        let mut gap = 0.0_f64;
        for (r, (row, s)) in self.rows.0.iter().zip(&self.here.s).enumerate() {
            if row.lower.is_finite() {
                gap = gap.max(((s - row.lower) * low[r] - mu).abs());
            }
            if row.upper.is_finite() {
                gap = gap.max(((row.upper - s) * high[r] - mu).abs());
            }
        }
        let dual = self.lagrangian.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        (dual / s_d)
            .max(gap / of(bounds, count))
            .max(self.here.infeasibility())
    }

    fn run(mut self, observer: &mut dyn FnMut(&Iteration) -> bool) -> Solution {
        if !self.here.is_finite() {
            return self.finished(Status::UndefinedStart, f64::INFINITY, 0);
        }
        let mut number = 0;
        loop {
            let kkt = self.error(0.0);
            let seen = Iteration {
                number,
                objective: self.here.values.f,
                violation: self.here.infeasibility(),
                kkt,
            };
            if kkt <= self.options.tolerance {
                return self.finished(Status::Converged, kkt, number);
            }
            if !observer(&seen) {
                return self.finished(Status::Stopped, kkt, number);
            }
            if number >= self.options.most_iterations {
                return self.finished(Status::IterationLimit, kkt, number);
            }
            if self.apart.is_none() {
                self.lower_barrier();
            }
            if let Err(status) = self.step() {
                let good = kkt <= ACCEPTABLE * self.options.tolerance;
                let status = if good { Status::Converged } else { status };
                return self.finished(status, kkt, number);
            }
            self.linearise();
            number += 1;
        }
    }

    fn lower_barrier(&mut self) {
        let least = self.options.tolerance / 10.0;
        while self.mu > least && self.error(self.mu) <= KAPPA_EPSILON * self.mu {
            self.mu = least.max((KAPPA_MU * self.mu).min(self.mu.powf(THETA_MU)));
            self.filter.clear();
        }
    }

    fn step(&mut self) -> Result<(), Status> {
        if !self.factored() {
            return Err(Status::NoProgress);
        }
        let mut direction = std::mem::take(&mut self.direction);
        direction.take_residuals(&self.here);
        let is_solved = self.solved(&mut direction);
        let accepted = is_solved
            && match &self.apart {
                Some(_) => self.search_apart(&direction),
                None => self.search(&direction),
            };
        self.direction = direction;
        match (is_solved, accepted) {
            (false, _) => Err(Status::NoProgress),
            (true, true) => {
                self.floor = 0.0;
                Ok(())
            }
            (true, false) => self.fall_back(),
        }
    }

    /// After a step of no use: more damping, or the constraints alone.
    fn fall_back(&mut self) -> Result<(), Status> {
        let violation = self.here.violation();
        let is_feasible = self.here.infeasibility() <= self.options.tolerance;
        if self.apart.is_some() {
            return Err(match is_feasible {
                true => Status::NoProgress,
                false => Status::Infeasible,
            });
        }
        if is_feasible {
            self.floor = (100.0 * self.floor).max(10.0 * self.damping).max(DAMPING);
            return match self.floor > MOST_FLOOR {
                true => Err(Status::NoProgress),
                false => Ok(()),
            };
        }
        self.restorations += 1;
        if self.restorations > RESTORATIONS {
            return Err(Status::NoProgress);
        }
        self.floor = 0.0;
        self.add_to_filter(violation, self.barrier(&self.here));
        self.apart = Some((self.here.z.clone(), violation));
        Ok(())
    }

    fn finished(self, status: Status, kkt: f64, iterations: usize) -> Solution {
        let here = self.here;
        let outside = |(row, g): (&Row, &f64)| ((row.lower - g).max(g - row.upper), Some(*row));
        let limited = self.rows.0.iter().zip(&here.g).map(outside);
        let equal = self.rows.1.iter().zip(&here.e);
        let equal = equal.map(|(row, e)| (e.abs(), Some(*row)));
        let defects = here.values.c.as_flattened().iter().map(|c| (c.abs(), None));
        let (violation, worst) =
            limited
                .chain(equal)
                .chain(defects)
                .fold(
                    (0.0, None),
                    |most, own| if own.0 > most.0 { own } else { most },
                );
        let back = |l: f64| l / self.factor;
        let own = self.multipliers;
        Solution {
            status,
            objective: here.values.f - here.values.steps,
            z: here.z,
            costates: self
                .program
                .in_order(&own.c)
                .into_iter()
                .map(back)
                .collect(),
            multipliers: own.of_limits().map(back).collect(),
            ends: own.e.into_iter().map(back).collect(),
            violation,
            worst,
            kkt,
            iterations,
        }
    }
}
