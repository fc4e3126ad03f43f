//! How sure a fit is, as it is told.

use nalgebra::DMatrix;
use pilotage_inference::{Covariance, Interval, Method, Obstacle};

/// Why a fit does not say how sure it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Unsure {
    /// It did not converge.
    #[error("the fit did not converge")]
    NotConverged,
    /// Derivatives are not known: too many unknowns, or singular equations.
    #[error(
        "the derivatives are not known: a run has more than 126 unknowns, or its linearised equations are singular"
    )]
    NoDerivatives,
    /// No covariance.
    #[error(transparent)]
    Obstacle(#[from] Obstacle),
}

/// How sure a fit is.
#[derive(Debug, Clone)]
pub struct Uncertainty {
    /// How the covariance was computed.
    pub method: Method,
    /// Whose correlations these are: where runs are few, of another method.
    pub correlated_by: Method,
    /// For each of [`Fit::parameters`](crate::Fit::parameters) the intervals of its values.
    pub intervals: Vec<Vec<Interval>>,
    /// For each of [`Fit::derived`](crate::Fit::derived) the same.
    pub derived: Vec<Vec<Interval>>,
    /// For each state of [`Fit::initial`](crate::Fit::initial) the interval of its initial value in each run; none in runs
    /// where it is known.
    pub initial: Vec<Vec<Option<Interval>>>,
    /// The shared parameters, with their subjects, as the search sees them: `ln name` where it goes along the logarithm.
    pub names: Vec<String>,
    /// Correlations of these.
    pub correlations: DMatrix<f64>,
    /// Covariance of these.
    pub covariance: Covariance,
    /// Their Cramér–Rao bounds `2√(H⁻¹)ᵢᵢ`, relative to their values \[%\]; of a logarithm as it is.
    pub cramer_rao: Vec<f64>,
    /// Their insensitivities `√(1/Hᵢᵢ)`, likewise \[%\].
    pub insensitivity: Vec<f64>,
    /// What one must know of it, in words: what the data leave open, where an error of the mesh is larger than a standard
    /// deviation, what intervals do not mean.
    pub notes: Vec<String>,
    /// What a simulation instead of the mesh would change in them, in their units; none where there is none.
    pub mesh_errors: Option<Vec<f64>>,
    /// Priors are part of it: intervals are penalised.
    pub is_penalised: bool,
    /// Standard deviation of the residuals, per what was said of the noise.
    pub noise: f64,
    /// Whether the samples of each signal are evenly apart, by the same distance in all runs.
    pub is_even: bool,
}
