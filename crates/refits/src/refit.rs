//! What is solved again: a problem at its solution, whatever its unknowns follow from.

use crate::solved::Watch;
use rand_chacha::ChaCha8Rng;

/// What is sought.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// A shared parameter.
    Shared(usize),
    /// The initial value of a state of a run, which is what a run's own parameter is.
    Initial {
        /// The run.
        run: usize,
        /// The state.
        state: usize,
    },
}

impl Coordinate {
    /// Whether it is that of one run.
    pub fn is_initial(self) -> bool {
        matches!(self, Self::Initial { .. })
    }
}

/// A solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// The variables of the search.
    pub z: Vec<f64>,
    /// The objective.
    pub objective: f64,
    /// Constraints on parameters that hold with equality.
    pub constraints: Vec<usize>,
    /// Bounds at the begin of a run that do.
    pub bounds: Vec<usize>,
}

/// A problem at its solution.
pub trait Refit: Sync {
    /// The solution.
    fn solution(&self) -> Point;

    /// The value there of what is sought, in units.
    fn value(&self, at: Coordinate) -> f64;

    /// Its magnitude.
    fn scale(&self, at: Coordinate) -> f64;

    /// The problem with that fixed.
    fn fixed(&self, at: Coordinate) -> Box<dyn Fixed + '_>;
}

/// A problem with one coordinate fixed, to any value.
pub trait Fixed: Send + Sync {
    /// Its variables at the solution of the whole problem.
    fn begin(&self) -> Vec<f64>;

    /// Puts a value, in units, where it stands among the variables, if it does.
    fn put(&self, z: &mut [f64], value: f64);

    /// The solution with that value, in units, from these variables; none where the search does not converge.
    fn solved(&self, value: f64, z: Vec<f64>, watch: &Watch<'_>) -> Option<Point>;
}

/// Other data.
#[derive(Debug, Clone)]
pub enum Data {
    /// Each run so often: one that is drawn twice has twice the weight.
    Counted(Vec<usize>),
    /// The same runs with noise that is drawn.
    Simulated(Box<ChaCha8Rng>),
}

/// A solution with other data.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The shared parameters, in units.
    pub shared: Vec<f64>,
    /// The states at the begin of each run, in units; none of runs that were not drawn.
    pub initial: Vec<Option<Vec<f64>>>,
}

impl Found {
    /// What is sought; not a number where its run was not drawn.
    pub fn value(&self, at: Coordinate) -> f64 {
        match at {
            Coordinate::Shared(k) => self.shared[k],
            Coordinate::Initial { run, state } => self.initial[run]
                .as_ref()
                .map_or(f64::NAN, |own| own[state]),
        }
    }
}

/// A problem that can be solved with other data.
pub trait Resample: Refit {
    /// Number of its runs.
    fn runs(&self) -> usize;

    /// The solution with other data; none where the search does not converge.
    fn refitted(&self, data: Data, watch: &Watch<'_>) -> Option<Found>;
}
