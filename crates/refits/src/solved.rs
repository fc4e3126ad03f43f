//! Solution of a collocation problem, and its refits.

use crate::fixed::Held;
use crate::refit::{Coordinate, Data, Fixed, Found, Point, Refit, Resample};
use pilotage_collocation::{BoundAt, Collocation, Run};
use pilotage_sqp::{Iterate, SqpOptions, Status};
use rand_chacha::ChaCha8Rng;
use std::ops::ControlFlow;

/// A problem with its solution.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The problem.
    pub problem: Collocation,
    /// Its solution.
    pub at: Iterate,
    /// Options of the refits.
    pub options: SqpOptions,
}

/// Simulates the runs of a replicate: the same runs with other recorded values.
pub type Simulate<'a> = dyn Fn(&mut ChaCha8Rng) -> Vec<Run> + Send + Sync + 'a;

/// A solution with what bootstraps need.
pub struct Collocated<'a> {
    /// The solution.
    pub solved: Solved,
    /// Number of recorded outputs among the measured ones; the outputs after them are priors.
    pub signals: usize,
    /// Simulates runs with other residuals.
    pub simulate: Box<Simulate<'a>>,
}

impl Refit for Solved {
    fn solution(&self) -> Point {
        point(&self.problem, self.at.clone())
    }

    fn value(&self, at: Coordinate) -> f64 {
        let z = &self.at.z;
        let own = match at {
            Coordinate::Shared(k) => self.problem.theta(z)[k],
            Coordinate::Initial { run, state } => self.problem.coefficients(z, run)[state],
        };
        own * self.scale(at)
    }

    fn scale(&self, at: Coordinate) -> f64 {
        let scales = &self.problem.model.scales;
        match at {
            Coordinate::Shared(k) => scales.parameters[k],
            Coordinate::Initial { state, .. } => scales.states[state],
        }
    }

    fn fixed(&self, at: Coordinate) -> Box<dyn Fixed + '_> {
        Box::new(Held::new(self, at))
    }
}

impl Refit for Collocated<'_> {
    fn solution(&self) -> Point {
        self.solved.solution()
    }

    fn value(&self, at: Coordinate) -> f64 {
        self.solved.value(at)
    }

    fn scale(&self, at: Coordinate) -> f64 {
        self.solved.scale(at)
    }

    fn fixed(&self, at: Coordinate) -> Box<dyn Fixed + '_> {
        self.solved.fixed(at)
    }
}

impl Resample for Collocated<'_> {
    fn runs(&self) -> usize {
        self.solved.problem.runs.len()
    }

    fn refitted(&self, data: Data, watch: &Watch<'_>) -> Option<Found> {
        let (runs, from) = match data {
            Data::Counted(counts) => self.counted(&counts),
            Data::Simulated(mut random) => {
                ((self.simulate)(&mut random), (0..self.runs()).collect())
            }
        };
        let (problem, z) = self.solved.posed(runs, &from);
        let found = solve_from_afar(&problem, z, &self.solved.options, watch)?;
        let initial = |run: usize| {
            let place = from.iter().position(|from| *from == run)?;
            let own = problem.coefficients(&found.z, place).iter();
            let scales = &problem.model.scales.states;
            Some(own.zip(scales).map(|(own, scale)| own * scale).collect())
        };
        Some(Found {
            shared: problem.physical_theta(&found.z),
            initial: (0..self.runs()).map(initial).collect(),
        })
    }
}

impl Collocated<'_> {
    /// Runs with the weights of these counts, and the index of the original run of each. Priors on shared parameters
    /// are stored in one run and are kept.
    fn counted(&self, counts: &[usize]) -> (Vec<Run>, Vec<usize>) {
        let whole = &self.solved.problem.runs;
        let from: Vec<usize> = (0..whole.len()).filter(|j| counts[*j] > 0).collect();
        let mut runs: Vec<Run> = from.iter().map(|j| whole[*j].clone()).collect();
        for (run, j) in runs.iter_mut().zip(&from) {
            let recorded = run.measured[..self.signals].iter_mut();
            recorded.for_each(|own| own.weight *= counts[*j] as f64);
        }
        for prior in self.signals..self.solved.problem.measured {
            let is_there = |run: &Run| run.measured[prior].values.iter().any(|y| y.is_finite());
            let first = whole.iter().find(|run| is_there(run));
            if let (false, Some(first)) = (runs.iter().any(is_there), first) {
                runs[0].measured[prior].values[0] = first.measured[prior].values[0];
            }
        }
        (runs, from)
    }
}

impl Solved {
    /// The problem with other data, and its variables at the known solution.
    fn posed(&self, runs: Vec<Run>, from: &[usize]) -> (Collocation, Vec<f64>) {
        let whole = &self.problem;
        let problem = Collocation::new(
            whole.model.tapes.clone(),
            whole.constraints.clone(),
            whole.scheme,
            runs,
            whole.model.scales.clone(),
            &whole.bounds,
        );
        let own = from.iter();
        let own = own.flat_map(|run| whole.coefficients(&self.at.z, *run));
        let z = own.chain(whole.theta(&self.at.z)).copied().collect();
        (problem, z)
    }
}

/// A solution, with the constraints and bounds that have a nonzero multiplier.
pub(crate) fn point(problem: &Collocation, at: Iterate) -> Point {
    let own = &at.eta[problem.layout.parameter_constraints..];
    let constraints = (0..own.len()).filter(|k| own[*k] != 0.0).collect();
    let is_held = |k: &usize| {
        let mut runs = problem.layout.runs.iter();
        runs.any(|run| at.eta[run.g + k * run.samples] != 0.0)
    };
    let starts = (0..problem.bounds.len()).filter(|k| problem.bounds[*k].at == BoundAt::Start);
    Point {
        constraints,
        bounds: starts.filter(is_held).collect(),
        objective: at.f,
        z: at.z,
    }
}

/// Callbacks of the caller. Both are called from several threads.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// Whether to stop.
    pub stops: &'a (dyn Fn() -> bool + Sync),
    /// Called whenever a part of the work is done.
    pub done: &'a (dyn Fn() + Sync),
}

impl Default for Watch<'_> {
    /// Never stops and ignores progress.
    fn default() -> Self {
        Self {
            stops: &|| false,
            done: &|| (),
        }
    }
}

/// As [`solve`], but from the solution for other data: first on a coarser mesh if that is much smaller.
fn solve_from_afar(
    problem: &Collocation,
    z: Vec<f64>,
    options: &SqpOptions,
    watch: &Watch<'_>,
) -> Option<Iterate> {
    let mut see = |_: &pilotage_sqp::Iteration| match (watch.stops)() {
        true => ControlFlow::Break(Status::Stopped),
        false => ControlFlow::Continue(()),
    };
    let (z, _) = pilotage_collocation::nearer(problem, z, options, &mut see);
    solve(problem, z, options, watch)
}

/// Violation of the scaled equations with which a solve that stalls at kinks is one.
const FEASIBLE: f64 = 1e-6;

/// Solves from these variables; `None` if the solve does not converge. From a solution for other data, where it stalls at kinks
/// ([`SqpOptions::stall`]) is as near to an optimum as that one is.
pub(crate) fn solve(
    problem: &Collocation,
    z: Vec<f64>,
    options: &SqpOptions,
    watch: &Watch<'_>,
) -> Option<Iterate> {
    let mut see = |_: &pilotage_sqp::Iteration| match (watch.stops)() {
        true => ControlFlow::Break(Status::Stopped),
        false => ControlFlow::Continue(()),
    };
    let solution = pilotage_collocation::solve(problem, z, options, &mut see);
    let has_stalled = options.stall.is_some()
        && solution.status == Status::NoProgress
        && solution.kkt.primal <= FEASIBLE;
    (solution.status == Status::Converged || has_stalled).then_some(solution.iterate)
}
