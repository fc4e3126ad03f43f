//! How sure is a fit? Covariances and confidence intervals from residuals and their Jacobian at the solution.
//!
//! Shared parameters θ and, for each run, unknowns of its own are estimated by least squares,
//!
//! ```text
//! minimise ½ Σ_g |e_g|²,   e_g(θ + δ, λ_g + μ) ≈ e_g - A_g δ - B_g μ,   with residuals e_g in standard deviations
//! ```
//!
//! and other likelihoods are brought to that form ([`Row`]). The run's own unknowns are projected out of its Jacobian,
//! `J_g = (I - B_g B_g⁺) A_g`; then `H = Σ J_gᵀ J_g`, and a [`Method`] says what stands for the noise between two
//! factors `H⁻¹`. Active constraints are held: directions that they close have no variance.
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
//! | module | what it holds |
//! | --- | --- |
//! | [`data`], `row` | what is given: rows of residuals, what is known beforehand, active constraints |
//! | `elimination` | constraints and the runs' own unknowns, taken out |
//! | [`inference`] | information, what the data leave open |
//! | [`covariance`], `meat`, `autoregression`, `burg`, `restricted` | the methods |
//! | [`interval`] | intervals with Student's t |
//! | [`outliers`] | samples and runs that stand out |
//! | [`residuals`], [`crossed`] | what residuals say of a model, alone and beside what drove it |
//! | [`choice`], [`homogeneity`] | which of several models; whether groups of data have the same parameters |
//! | [`spectrum`] | frequency responses of loops that sines drive, without a model |

mod autoregression;
mod burg;
pub mod choice;
pub mod covariance;
pub mod crossed;
pub mod data;
mod elimination;
pub mod homogeneity;
pub mod inference;
pub mod interval;
mod meat;
pub mod outliers;
pub mod residuals;
mod restricted;
mod row;
pub mod spectrum;

pub use autoregression::Autoregression;
pub use covariance::{Covariance, Joint, Method};
pub use data::{Data, Run};
pub use inference::{Direction, Inference, Obstacle};
pub use interval::{Class, Interval, LEVEL, quantile};
pub use row::{Noise, Row};
