//! Covariances and confidence intervals of a fit, from residuals and their Jacobian at the solution.
//!
//! Shared parameters θ and, for each run g, own unknowns λ_g are estimated by least squares,
//!
//! ```text
//! minimise ½ Σ_g |e_g|²,   e_g(θ + δ, λ_g + μ) ≈ e_g - A_g δ - B_g μ,   with residuals e_g in standard deviations
//! ```
//!
//! Other likelihoods are brought to that form ([`Row`]). A run's own unknowns are projected out of its Jacobian,
//! `J_g = (I - B_g B_g⁺) A_g`; then `H = Σ J_gᵀ J_g`, and a [`Method`] defines the covariance of the noise between two
//! factors `H⁻¹`. Active constraints are held: directions that they fix have no variance.
//!
//! ```
//! use nalgebra::{DMatrix, DVector};
//! use pilotage_inference::{Data, Inference, Method, Run};
//!
//! // A mean of four values, 1 to 4: s²/n = (5/3)/4.
//! let run = Run::of(DMatrix::from_element(4, 1, 1.0), DVector::from_vec(vec![-1.5, -0.5, 0.5, 1.5]));
//! let data = Data::of(vec![run]);
//! let inference = Inference::new(&data)?;
//! let plain = inference.covariance(Some(Method::Plain))?;
//! assert!((plain.matrix[(0, 0)] - 5.0 / 12.0).abs() < 1e-12);
//! # Ok::<(), pilotage_inference::Obstacle>(())
//! ```
//!
//! | module | contents |
//! | --- | --- |
//! | [`data`], `row` | input: rows of residuals, priors, active constraints |
//! | `elimination` | elimination of constraints and of the runs' own unknowns |
//! | [`inference`], `open` | information, undetermined directions, and what depends on them |
//! | [`covariance`], `meat`, `autoregression`, `burg`, `restricted` | the methods |
//! | [`interval`] | intervals with Student's t |
//! | `spread` | intervals of functions of the parameters |
//! | [`outliers`] | samples and runs that stand out |
//! | [`residuals`], [`crossed`] | residual tests, alone and against the inputs |
//! | [`change`], `supremum` | whether the parameters are constant along the runs |
//! | [`choice`], [`homogeneity`] | choice between models; whether groups of data have the same parameters |
//! | [`spectrum`] | frequency responses of loops driven by sums of sines, without a model |
//! | [`statistics`] | rms and range of values with gaps |
//! | `stepped` | signals that keep their values and jump |
//! | [`timing`] | runs whose recordings are late |
//! | [`sample`] | quantiles of numbers, roots of covariances for draws |
//! | [`sampling`] | gaps, and times in another unit |

mod autoregression;
mod burg;
pub mod change;
pub mod choice;
pub mod covariance;
pub mod crossed;
pub mod data;
mod elimination;
pub mod homogeneity;
pub mod inference;
pub mod interval;
mod meat;
mod open;
pub mod outliers;
pub mod residuals;
mod restricted;
mod row;
pub mod sample;
pub mod sampling;
pub mod spectrum;
mod spread;
pub mod statistics;
mod stepped;
mod supremum;
pub mod timing;

pub use autoregression::Autoregression;
pub use covariance::{Covariance, Joint, Method};
pub use data::{Data, Run};
pub use inference::{Direction, Inference, Obstacle};
pub use interval::{Class, Interval, LEVEL, quantile};
pub use open::Open;
pub use row::{Noise, Row, normal_equations};
pub use spread::Spread;
pub use stepped::{are_stepped, is_stepped};
