//! Recorded flights.

/// One recorded flight to a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Short name, unique among the trials of a fit (the file's stem).
    pub name: String,
    /// The file it came from, as the user wrote it.
    pub origin: String,
    /// SHA-256 of the file's bytes, in hexadecimal.
    pub sha256: String,
    /// Sample times [s], strictly increasing.
    pub time: Vec<f64>,
    /// The target ŷ at each sample [m].
    pub target: Vec<f64>,
    /// The vehicle's position at each sample [m]; NaN where missing.
    pub position: Vec<f64>,
    /// The stick at each sample [-1, 1]; NaN where missing. None where it was not recorded.
    pub stick: Option<Vec<f64>>,
    /// Weight of this run's squared residuals in the objective.
    pub weight: f64,
}
