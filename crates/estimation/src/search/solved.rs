//! A solved start, and the refinement of its mesh.

use crate::posed::{Posed, poles};
use nalgebra::Complex;
use pilotage_collocation::{Collocation, Scheme, Sensitivities};
use pilotage_inference::Data;
use pilotage_sqp::Solution;

/// Objectives with a smaller relative difference belong to the same optimum.
pub const SAME: f64 = 1e-3;
/// Largest violation of the scaled equations and constraints with which they count as satisfied.
pub const MET: f64 = 1e-4;

/// Largest violation of the scaled constraints with which an objective is close to its final value.
const NEARLY: f64 = 1e-3;

/// For stiff equations: L-stable, so that components that decay within an interval vanish at its end (Hairer & Wanner,
/// *Solving Ordinary Differential Equations II*, section IV.3).
pub(crate) const STIFF_SCHEME: Scheme = Scheme::Radau(3);

/// A solved start.
#[derive(Debug)]
pub struct Solved {
    /// The nonlinear program.
    pub problem: Collocation,
    /// Its solution.
    pub solution: Solution,
}

impl Solved {
    /// The shared parameters, in the coordinates of the search.
    pub fn theta(&self) -> Vec<f64> {
        let z = &self.solution.iterate.z;
        self.problem.physical_theta(z)
    }

    /// The poles of the joint equations at the end of the first run \[1/s\], with other shared parameters at the same
    /// states.
    pub fn poles_with(&self, posed: &Posed<'_>, theta: &[f64]) -> Vec<Complex<f64>> {
        let last = self
            .problem
            .states_at_samples(&self.solution.iterate.z, 0)
            .pop();
        let poles = last.map(|x| poles(posed, &x, theta));
        poles.unwrap_or_default()
    }

    /// The objective if the states satisfy the scaled equations up to this violation, else infinity.
    pub(crate) fn within(&self, violation: f64) -> f64 {
        match self.solution.kkt.primal <= violation {
            true => self.solution.iterate.f,
            false => f64::INFINITY,
        }
    }

    /// The objective if it is close to its final value, else infinity.
    pub(crate) fn nearly(&self) -> f64 {
        self.within(NEARLY)
    }

    /// Initial states of each run, in their units.
    pub(crate) fn initial(&self) -> Vec<Vec<f64>> {
        initial(&self.problem, &self.solution.iterate.z)
    }
}

/// Initial states of each run for these variables, in their units.
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

/// Refinement of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Refinement {
    /// Number of refinements.
    pub rounds: usize,
    /// Number of intervals of all runs.
    pub intervals: usize,
    /// Largest estimated relative error of a state; NaN if it was not estimated.
    pub error: f64,
    /// The error over that of the mesh before; 1 without a refinement.
    pub gain: f64,
    /// Change of each shared parameter by the last refinement, relative to its scale.
    pub changes: Vec<f64>,
    /// Iterations of all solves.
    pub iterations: usize,
    /// The final scheme.
    pub scheme: Scheme,
    /// Whether the refinement was completed: neither a time limit nor the user ended it.
    pub is_done: bool,
    /// Whether the iteration limit ended the solve on a finer mesh.
    pub is_limited: bool,
}

impl Refinement {
    /// Maximum number of refinements.
    pub(crate) const MOST: usize = 12;

    /// Change of a parameter by a refinement, relative to its scale, that is significant.
    pub(crate) const MOVES: f64 = 1e-3;

    /// For a solution whose mesh has not been refined.
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
            gain: 1.0,
            changes: Vec::new(),
            iterations: solved.solution.work.iterations,
            scheme: solved.problem.scheme,
            is_done: false,
            is_limited: false,
        }
    }

    /// By how much the next refinement would move a parameter, relative to its scale: about as much less than the last one as the error
    /// has become less.
    pub(crate) fn left(&self) -> f64 {
        let change = self.changes.iter().copied().fold(0.0, f64::max);
        change * self.gain.min(1.0)
    }

    /// Whether the scheme is the one for stiff equations.
    pub fn is_for_stiff(&self) -> bool {
        self.scheme == STIFF_SCHEME
    }
}

/// The least-squares problem of a solution.
pub(crate) struct Linearised {
    pub data: Data,
    pub sensitivities: Sensitivities,
    /// Number of terms of recordings, including their levels. Priors come after them.
    pub signals: usize,
}
