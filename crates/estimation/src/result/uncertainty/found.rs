//! Uncertainty of a fit, as reported.

use nalgebra::DMatrix;
use pilotage_inference::{Covariance, Interval, Method, Obstacle, Open};

/// Why the uncertainty of a fit is not available.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Unsure {
    /// It did not converge.
    #[error("the fit did not converge")]
    NotConverged,
    /// Derivatives are not available: too many unknowns, or singular equations.
    #[error(
        "the derivatives are not known: a run has more than 126 unknowns, or its linearised equations are singular"
    )]
    NoDerivatives,
    /// No covariance.
    #[error(transparent)]
    Obstacle(#[from] Obstacle),
}

/// Uncertainty of a fit.
#[derive(Debug, Clone)]
pub struct Uncertainty {
    /// Method by which the covariance was computed.
    pub method: Method,
    /// Method of the correlations, which differs if there are few runs.
    pub correlated_by: Method,
    /// For each of [`Fit::parameters`](crate::Fit::parameters), the intervals of its values.
    pub intervals: Vec<Vec<Interval>>,
    /// For each of [`Fit::derived`](crate::Fit::derived), the same.
    pub derived: Vec<Vec<Interval>>,
    /// For each state of [`Fit::initial`](crate::Fit::initial), the interval of its initial value in each run. None in
    /// runs where it is known.
    pub initial: Vec<Vec<Option<Interval>>>,
    /// The shared parameters, with their subjects, in the coordinates of the search: `ln name` for a logarithmic scale.
    pub names: Vec<String>,
    /// Correlations of these.
    pub correlations: DMatrix<f64>,
    /// Covariance of these.
    pub covariance: Covariance,
    /// Directions of these that the data leave open.
    pub open: Open,
    /// Their Cramér–Rao bounds `2√(H⁻¹)ᵢᵢ`, relative to their values \[%\]; absolute for a logarithm.
    pub cramer_rao: Vec<f64>,
    /// Their insensitivities `√(1/Hᵢᵢ)`, likewise \[%\].
    pub insensitivity: Vec<f64>,
    /// Notes, in words: what the data leave undetermined, where the error of the mesh exceeds a standard deviation,
    /// what the intervals do not account for.
    pub notes: Vec<String>,
    /// Change of these parameters if a simulation replaced the mesh, in their units. None without a simulation.
    pub mesh_errors: Option<Vec<f64>>,
    /// Priors are included: intervals are penalised.
    pub is_penalised: bool,
    /// Standard deviation of the residuals, relative to the stated noise.
    pub noise: f64,
    /// Whether the samples of each signal are evenly spaced, with the same step in all runs.
    pub is_even: bool,
}
