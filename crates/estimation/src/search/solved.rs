//! A start that is solved, on a mesh that is refined.

use crate::posed::{Posed, poles};
use nalgebra::Complex;
use pilotage_collocation::{Collocation, Scheme, Sensitivities};
use pilotage_inference::Data;
use pilotage_sqp::Solution;

/// Objectives that differ by less than this part are of one optimum.
pub const SAME: f64 = 1e-3;
/// Largest violation of the scaled equations and constraints with which they are met.
pub const MET: f64 = 1e-4;

/// Largest violation of the scaled constraints with which an objective is nearly what it will be.
const NEARLY: f64 = 1e-3;

/// Where equations are stiff: L-stable, so that what decays within an interval is gone at its end (Hairer & Wanner,
/// *Solving Ordinary Differential Equations II*, section IV.3).
pub(crate) const STIFF_SCHEME: Scheme = Scheme::Radau(3);

/// A start, solved.
#[derive(Debug)]
pub struct Solved {
    /// The nonlinear program.
    pub problem: Collocation,
    /// Its solution.
    pub solution: Solution,
}

impl Solved {
    /// The shared parameters, as the search sees them.
    pub fn theta(&self) -> Vec<f64> {
        let z = &self.solution.iterate.z;
        self.problem.physical_theta(z)
    }

    /// The poles of the joint equations where the first run ends \[1/s\], with other shared parameters at the same states.
    pub fn poles_with(&self, posed: &Posed<'_>, theta: &[f64]) -> Vec<Complex<f64>> {
        let last = self
            .problem
            .states_at_samples(&self.solution.iterate.z, 0)
            .pop();
        let poles = last.map(|x| poles(posed, &x, theta));
        poles.unwrap_or_default()
    }

    /// The objective where the states fulfil the scaled equations up to this violation; else infinite.
    pub(crate) fn within(&self, violation: f64) -> f64 {
        match self.solution.kkt.primal <= violation {
            true => self.solution.iterate.f,
            false => f64::INFINITY,
        }
    }

    /// The objective where it is nearly what it will be; else infinite.
    pub(crate) fn nearly(&self) -> f64 {
        self.within(NEARLY)
    }

    /// Where the states of each run begin, in their units.
    pub(crate) fn initial(&self) -> Vec<Vec<f64>> {
        initial(&self.problem, &self.solution.iterate.z)
    }
}

/// Where the states of each run begin by these variables, in their units.
pub(crate) fn initial(problem: &Collocation, z: &[f64]) -> Vec<Vec<f64>> {
    let first = |j: usize| {
        let scaled = problem.coefficients(z, j).iter();
        scaled
            .zip(&problem.model.scales.states)
            .map(|(x, s)| x * s)
            .collect()
    };
    (0..problem.runs.len()).map(first).collect()
}

/// How a mesh was refined.
#[derive(Debug, Clone, PartialEq)]
pub struct Refinement {
    /// How often.
    pub rounds: usize,
    /// Intervals of all runs.
    pub intervals: usize,
    /// Largest estimated relative error of a state; not a number where it was not estimated.
    pub error: f64,
    /// Largest change of each shared parameter by the last refinement, relative to its scale.
    pub changes: Vec<f64>,
    /// Iterations of all solves.
    pub iterations: usize,
    /// The scheme at the end.
    pub scheme: Scheme,
    /// Whether it came to its end: neither a limit of time nor the user ended it.
    pub is_done: bool,
    /// Whether the iteration limit ended the solve on a finer mesh.
    pub is_limited: bool,
}

impl Refinement {
    /// Of a solution whose mesh has not been refined.
    pub(crate) fn new(solved: &Solved) -> Self {
        Self {
            rounds: 0,
            intervals: solved
                .problem
                .runs
                .iter()
                .map(|run| run.mesh.len() - 1)
                .sum(),
            error: f64::NAN,
            changes: Vec::new(),
            iterations: solved.solution.work.iterations,
            scheme: solved.problem.scheme,
            is_done: false,
            is_limited: false,
        }
    }

    /// Whether the scheme is that for stiff equations.
    pub fn is_for_stiff(&self) -> bool {
        self.scheme == STIFF_SCHEME
    }
}

/// The least-squares problem of a solution.
pub(crate) struct Linearised {
    pub data: Data,
    pub sensitivities: Sensitivities,
    /// The number of terms that are recorded, with their levels; those behind are what is known beforehand.
    pub signals: usize,
}
