//! Solves a solution again: with a fixed unknown, or with other data.

use super::likelihood::Likelihood;
use super::limits::Limits;
use super::program::Program;
use super::{Predicted, SCORED, linearised};
use crate::posed::Posed;
use crate::search::solved::Linearised;
use pilotage_refits::refit::Point;
use pilotage_refits::{Coordinate, Data, Fixed, Found, Refit, Resample, Watch};
use pilotage_sqp::{Iterate, Iteration, Solution, SparseQp, SqpOptions, Status, solve};
use rand_distr::{Distribution, StandardNormal};
use std::ops::ControlFlow;

/// Maximum number of iterations from a nearby start.
const NEAR: usize = 100;

/// The stored result of a search.
#[derive(Debug, Clone)]
pub struct Optimum {
    solution: Solution,
    scales: Vec<f64>,
    parts: usize,
}

impl Optimum {
    /// Stores the result of a search.
    pub(crate) fn of(found: &Predicted<'_>) -> Self {
        Self {
            solution: found.solution.clone(),
            scales: found.program.scales.clone(),
            parts: found.program.likelihood.parts,
        }
    }
}

/// A problem at its optimum.
pub(crate) struct Again<'p> {
    posed: &'p Posed<'p>,
    optimum: &'p Optimum,
    likelihood: Likelihood<'p>,
}

impl<'p> Again<'p> {
    /// None if no noise drives the system.
    pub fn new(posed: &'p Posed<'p>, optimum: &'p Optimum) -> Option<Self> {
        let mut likelihood = Likelihood::of(posed)?;
        likelihood.parts = optimum.parts;
        Some(Self {
            posed,
            optimum,
            likelihood,
        })
    }

    /// The optimum as a least-squares problem.
    pub fn linearised(&self) -> Linearised {
        let found = Predicted {
            program: self.program(self.likelihood),
            solution: self.optimum.solution.clone(),
            iterations: 0,
        };
        linearised(self.posed, &found)
    }

    /// Scale factor of the objective.
    pub fn factor(&self) -> f64 {
        self.program(self.likelihood).factor
    }

    fn unknowns(&self) -> Vec<f64> {
        let z = &self.optimum.solution.iterate.z;
        let scaled = z.iter().zip(&self.optimum.scales);
        scaled.map(|(z, scale)| z * scale).collect()
    }

    /// The program of a likelihood, scaled as in the fit.
    fn program<'a>(&self, likelihood: Likelihood<'a>) -> Program<'a>
    where
        'p: 'a,
    {
        let scales = self.optimum.scales.clone();
        Program::new(self.posed, likelihood, scales, &self.unknowns())
    }

    /// Index of a coordinate among the unknowns.
    fn place(&self, at: Coordinate) -> usize {
        match at {
            Coordinate::Shared(k) => k,
            Coordinate::Initial { run, state } => {
                let before = self.likelihood.free(run);
                let before = before.iter().take_while(|own| **own < state).count();
                self.likelihood.own()[run].start + before
            }
        }
    }

    /// Searches from these scaled unknowns: with Fisher information first, then with the Hessian if that is slow.
    fn searched(
        &self,
        program: &mut Program<'_>,
        mut z: Vec<f64>,
        watch: &Watch<'_>,
    ) -> Option<Iterate> {
        let options = &self.posed.file.options;
        let mut see = |_: &Iteration| match (watch.stops)() {
            true => ControlFlow::Break(Status::Stopped),
            false => ControlFlow::Continue(()),
        };
        let most = options.max_iterations.min(NEAR);
        for (is_exact, most) in [(false, SCORED), (true, most)] {
            program.is_exact = is_exact;
            let options = SqpOptions {
                tolerance: options.tolerance,
                max_iterations: most,
                ..SqpOptions::default()
            };
            let qp = &mut SparseQp::default();
            let found = solve(program, qp, z, &options, &mut see);
            if found.status == Status::Converged {
                return Some(found.iterate);
            }
            if !matches!(found.status, Status::IterationLimit | Status::NoProgress) {
                return None;
            }
            z = found.iterate.z;
        }
        None
    }

    fn point(&self, limits: &Limits<'_>, at: Iterate) -> Point {
        let count = self.posed.constraints.count();
        let is_held = |k: &usize| at.eta[*k] != 0.0;
        let bounds = limits.bounds();
        let begins = (count..at.eta.len()).filter(is_held);
        let mut bounds: Vec<usize> = begins.map(|k| bounds[(k - count) % bounds.len()]).collect();
        bounds.sort_unstable();
        bounds.dedup();
        Point {
            constraints: (0..count).filter(is_held).collect(),
            bounds,
            objective: at.f,
            z: at.z,
        }
    }

    /// For each unknown, the change of its prior's residual when the prior's mean is drawn around the optimum.
    fn shifts(&self, gauss: &mut dyn FnMut() -> f64) -> Vec<f64> {
        let unknowns = self.unknowns();
        let mut all = vec![0.0; unknowns.len()];
        for term in self.likelihood.priors(&unknowns) {
            all[term.place] = gauss() - term.residual;
        }
        all
    }

    /// Simulated recordings of all runs, assuming that the optimum is true: for each signal and run.
    fn simulated(&self, gauss: &mut dyn FnMut() -> f64) -> Vec<Vec<Vec<f64>>> {
        let unknowns = self.unknowns();
        let theta = &unknowns[..self.posed.shared];
        let mut all = vec![Vec::new(); self.posed.quantities.recorded.len()];
        for j in 0..self.posed.runs.len() {
            let initial = self.likelihood.initial(j, &unknowns);
            let drawn = self.likelihood.simulated(j, &initial, theta, gauss);
            all.iter_mut()
                .zip(drawn)
                .for_each(|(own, values)| own.push(values));
        }
        all
    }
}

impl Refit for Again<'_> {
    fn solution(&self) -> Point {
        let limits = Limits::of(self.posed, &self.likelihood);
        self.point(&limits, self.optimum.solution.iterate.clone())
    }

    fn value(&self, at: Coordinate) -> f64 {
        self.unknowns()[self.place(at)]
    }

    fn scale(&self, at: Coordinate) -> f64 {
        self.optimum.scales[self.place(at)]
    }

    fn fixed(&self, at: Coordinate) -> Box<dyn Fixed + '_> {
        Box::new(Held {
            again: self,
            place: self.place(at),
        })
    }
}

/// A problem with an unknown fixed.
struct Held<'a> {
    again: &'a Again<'a>,
    place: usize,
}

impl Fixed for Held<'_> {
    fn begin(&self) -> Vec<f64> {
        self.again.optimum.solution.iterate.z.clone()
    }

    fn put(&self, z: &mut [f64], value: f64) {
        z[self.place] = value / self.again.optimum.scales[self.place];
    }

    fn solved(&self, value: f64, z: Vec<f64>, watch: &Watch<'_>) -> Option<Point> {
        let again = self.again;
        let mut program = again.program(again.likelihood);
        program.fixed = Some((self.place, value / again.optimum.scales[self.place]));
        let found = again.searched(&mut program, z, watch)?;
        Some(again.point(&program.limits, found))
    }
}

impl Resample for Again<'_> {
    fn runs(&self) -> usize {
        self.posed.runs.len()
    }

    fn refitted(&self, data: Data, watch: &Watch<'_>) -> Option<Found> {
        let (recorded, shifts);
        let mut likelihood = self.likelihood;
        let counts = match data {
            Data::Counted(counts) => counts,
            Data::Simulated(mut random) => {
                let mut gauss = || StandardNormal.sample(&mut random);
                recorded = self.simulated(&mut gauss);
                shifts = self.shifts(&mut gauss);
                likelihood.recorded = Some(&recorded[..]);
                likelihood.shifts = Some(&shifts[..]);
                vec![1; self.runs()]
            }
        };
        likelihood.counts = Some(&counts[..]);
        let mut program = self.program(likelihood);
        let found = self.searched(&mut program, self.optimum.solution.iterate.z.clone(), watch)?;
        let unknowns = program.unknowns(&found.z);
        let initial = |j: usize| (counts[j] > 0).then(|| likelihood.initial(j, &unknowns));
        Some(Found {
            shared: unknowns[..self.posed.shared].to_vec(),
            initial: (0..self.runs()).map(initial).collect(),
        })
    }
}
