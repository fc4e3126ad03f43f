//! Interface of problems that can be solved again, independent of their transcription.

use crate::solved::Watch;
use rand_chacha::ChaCha8Rng;

/// An unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// A shared parameter.
    Shared(usize),
    /// The initial value of a state of a run; a parameter of a single run is such a state.
    Initial {
        /// Index of the run.
        run: usize,
        /// Index of the state.
        state: usize,
    },
}

impl Coordinate {
    /// Whether it belongs to a single run.
    pub fn is_initial(self) -> bool {
        matches!(self, Self::Initial { .. })
    }
}

/// A solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Variables of the optimisation.
    pub z: Vec<f64>,
    /// The objective.
    pub objective: f64,
    /// Indices of active constraints on parameters.
    pub constraints: Vec<usize>,
    /// Indices of active bounds at the start of a run.
    pub bounds: Vec<usize>,
}

/// A problem at its solution.
pub trait Refit: Sync {
    /// The solution.
    fn solution(&self) -> Point;

    /// Value of a coordinate at the solution, in units.
    fn value(&self, at: Coordinate) -> f64;

    /// Scale of the coordinate.
    fn scale(&self, at: Coordinate) -> f64;

    /// The problem with that coordinate fixed.
    fn fixed(&self, at: Coordinate) -> Box<dyn Fixed + '_>;
}

/// A problem with one coordinate fixed, at any value.
pub trait Fixed: Send + Sync {
    /// Its variables at the solution of the full problem.
    fn begin(&self) -> Vec<f64>;

    /// Writes a value, in units, into the variables if the coordinate is among them.
    fn put(&self, z: &mut [f64], value: f64);

    /// The solution at that value, in units, starting from these variables; `None` if the solve does not converge.
    fn solved(&self, value: f64, z: Vec<f64>, watch: &Watch<'_>) -> Option<Point>;
}

/// Data of a refit.
#[derive(Debug, Clone)]
pub enum Data {
    /// The number of times that each run is drawn: a run drawn twice has twice the weight.
    Counted(Vec<usize>),
    /// The same runs with simulated noise.
    Simulated(Box<ChaCha8Rng>),
}

/// Solution of a refit to other data.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The shared parameters, in units.
    pub shared: Vec<f64>,
    /// States at the start of each run, in units; `None` for runs that were not drawn.
    pub initial: Vec<Option<Vec<f64>>>,
}

impl Found {
    /// Value of a coordinate; NaN if its run was not drawn.
    pub fn value(&self, at: Coordinate) -> f64 {
        match at {
            Coordinate::Shared(k) => self.shared[k],
            Coordinate::Initial { run, state } => self.initial[run]
                .as_ref()
                .map_or(f64::NAN, |own| own[state]),
        }
    }
}

/// A problem that can be solved again with other data.
pub trait Resample: Refit {
    /// Number of runs.
    fn runs(&self) -> usize;

    /// The solution with other data; `None` if the solve does not converge.
    fn refitted(&self, data: Data, watch: &Watch<'_>) -> Option<Found>;
}
