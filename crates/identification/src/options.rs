//! Options of a fit.

use pilotage_collocation::Scheme;
pub use pilotage_flights::options::{InitialPosition, InitialState, Objective};
use pilotage_inference::Method;
use pilotage_models::{Pilot, Quadcopter};

/// The mesh of the states; residuals are always at the samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mesh {
    /// The samples (the paper's).
    Samples,
    /// Equal intervals of about this length \[s\], finer or coarser than the samples.
    Step(f64),
}

/// Options of a fit, with their defaults.
#[derive(Debug, Clone)]
pub struct FitOptions {
    /// Collocation scheme. Default: Hermite–Simpson, whose bias at 20 Hz is the smallest for its
    /// cost (docs/schemes.md); the paper's is forward Euler.
    pub scheme: Scheme,
    /// Mesh. Default: the samples.
    pub mesh: Mesh,
    /// Initial states. Default: at rest, as an exported pilot starts; the paper's are free.
    pub initial_state: InitialState,
    /// Position at the start. Default: estimated.
    pub initial_position: InitialPosition,
    /// Whether a fit of the response keeps the closed loop with [`Self::vehicle`] stable
    /// ([`super::closed_loop::LOOP_MARGIN`]). Default: true.
    pub stable_loop: bool,
    /// Objective. Default: the vehicle's response.
    pub objective: Objective,
    /// The pilot's structure. Default: third order.
    pub pilot: Pilot,
    /// The vehicle. Default: the project's own quadcopter.
    pub vehicle: Quadcopter,
    /// Whether the vehicle was not specified and [`Self::vehicle`] is the default one: a fit of the stick then has no
    /// closed loop. Default: false.
    pub vehicle_assumed: bool,
    /// A start for θ; `None`: estimated from the data.
    pub start: Option<Vec<f64>>,
    /// Number of random starts in addition to the others ([`super::random_starts`]). `None`, the default, depends on
    /// the initial states. At rest: up to [`super::solve::SPARE_STARTS`] for at most [`super::solve::MANY_TRIALS`]
    /// trials, one after another while only one start leads to the best objective. All free: the same number, until one
    /// has converged. Only the vehicle at rest, or with a start of the user: no random starts.
    pub random_starts: Option<usize>,
    /// Limit on |y_p|, dimensionless. Default: 1.
    pub stick_limit: f64,
    /// Scaled KKT residual at which a solve counts as converged. Default: 1e-8.
    pub tolerance: f64,
    /// Iteration limit of one solve. Default: 200.
    pub max_iterations: usize,
    /// Method for the covariance. Default: chosen by the number of runs
    /// ([`pilotage_inference::Inference::covariance`]).
    pub covariance: Option<Method>,
}

impl FitOptions {
    /// The vehicle of the closed loop: `None` in a fit of the stick if the vehicle was not specified.
    pub fn loop_vehicle(&self) -> Option<&Quadcopter> {
        let known = self.objective == Objective::Response || !self.vehicle_assumed;
        known.then_some(&self.vehicle)
    }

    /// The vehicle with which a fit keeps the closed loop stable: `None` in a fit of the stick.
    pub fn kept_vehicle(&self) -> Option<&Quadcopter> {
        let kept = self.stable_loop && self.objective == Objective::Response;
        kept.then_some(&self.vehicle)
    }
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            scheme: Scheme::HermiteSimpson,
            mesh: Mesh::Samples,
            initial_state: InitialState::AtRest,
            initial_position: InitialPosition::Estimated,
            stable_loop: true,
            objective: Objective::Response,
            pilot: Pilot::default(),
            vehicle: Quadcopter::default(),
            vehicle_assumed: false,
            start: None,
            random_starts: None,
            stick_limit: 1.0,
            tolerance: 1e-8,
            max_iterations: 200,
            covariance: None,
        }
    }
}
