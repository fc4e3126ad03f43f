//! Studies of many runs: which values are tried, what is measured of a run, and what the measures depend on.
//!
//! ```
//! use pilotage_sweep::{Design, Method, Vary, statistics};
//!
//! let vary = vec![Vary::parse("x~uniform(0, 1)")?, Vary::parse("y~normal(0, 2)")?];
//! let design = Design::new(vary, Method::Saltelli, 1 << 10, 1)?;
//! // The variance of x + y is 1/12 + 4, of which y makes nearly all.
//! let measured: Vec<f64> = (0..design.count()).map(|k| design.values(k).iter().sum()).collect();
//! let indices = statistics::sobol_indices(&measured, 2, 1);
//! assert!((indices[1].first.value - 4.0 / (4.0 + 1.0 / 12.0)).abs() < 0.02);
//! # Ok::<(), pilotage_sweep::SweepError>(())
//! ```
//!
//! | module | contents |
//! | --- | --- |
//! | `vary` | what is varied: lists of values, distributions, parameters of a fit with their covariance |
//! | `design` | the values of each sample, by its number alone |
//! | `measure` | numbers of a run: `rms(vehicle.z - 10)` |
//! | [`statistics`] | moments, rank correlations, Sobol' indices |

mod design;
mod measure;
pub mod statistics;
mod vary;

pub use design::{Design, Method};
pub use measure::{Measure, REDUCERS};
pub use vary::{Joint, Law, Vary};

/// Why a study cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// What is varied cannot be read.
    #[error("--vary {given}: {words}")]
    Vary {
        /// What was given.
        given: String,
        /// Why.
        words: String,
    },
    /// The samples do not suit what is varied.
    #[error("{0}")]
    Design(String),
    /// A measure cannot be read.
    #[error("--measure {given}: {words}")]
    Measure {
        /// What was given.
        given: String,
        /// Why.
        words: String,
    },
}
