//! Problem files: what was measured and what is sought, of any system of models, and their fit.
//!
//! ```
//! use pilotage_estimation::{Posed, ProblemFile, fit, part};
//! use std::ops::ControlFlow;
//!
//! # let folder = tempfile::tempdir()?;
//! let model = r#"
//!     [model]
//!     name = "decay"
//!     [parameters]
//!     rate = { start = 0.5, unit = "1/s" }
//!     [states]
//!     x = { start = 2, der = "-rate * x" }
//! "#;
//! std::fs::write(folder.path().join("decay.toml"), model)?;
//! std::fs::write(folder.path().join("run.csv"), "time,x\n0,2\n1,1\n2,0.5\n")?;
//! let problem = r#"
//!     [system.tank]
//!     model = "decay.toml"
//!     [[measured]]
//!     signal = "tank.x"
//!     column = "x"
//!     [parameters]
//!     "tank.rate" = {}
//!     [[run]]
//!     file = "run.csv"
//! "#;
//! let file = ProblemFile::parse(problem, &folder.path().join("problem.toml"))?;
//! let posed = Posed::new(&file, &part::open)?;
//! let found = fit(&posed, &mut |_iteration| ControlFlow::Continue(()));
//! // The half-life is a second.
//! assert!((found.parameters[0].values[0].1 - 2_f64.ln()).abs() < 1e-5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Take it where models are text and data are files; `pilotage-collocation` is beneath it, for equations in Rust.
//!
//! | module | what it holds |
//! | --- | --- |
//! | [mod@file], `read`, `runs` | what a problem file says |
//! | [`part`], [`joint`] | the instances as equations, and wired |
//! | [`unknowns`], `ranges`, `names` | parameters, what they are and between which values; the expressions of the file |
//! | [`data`] | the runs: columns, inputs, times at which something changes |
//! | `assembly`, `stability`, `interval`, [`posed`] | from all that to one system of equations |
//! | [`mod@beforehand`] | what the runs excite, and what nothing measured depends on |
//! | [`starts`], `followed`, [`mod@fit`], [`evaluate`] | where the search begins, the search, the problem without one |
//! | `innovations` | the fit of predictions from sample to sample, where noise drives the system |
//! | [`solved`], [`result`], `active`, `begun`, `likelihood`, `loops`, [`describing`], [`diagnostic`], `diagnostics`, [`events`], [`validation`], [`mod@uncertainty`], [`refits`], `trouble` | a start that is solved, what was found, on which constraints, with what the runs began, the loop cut open, the same without a model, what may speak against it and what does, runs that were not fitted, how sure it is, the fit handed over to be solved again, what is not finite |
//! | [`left_over`], `outliers` | what residuals say of the next one and of inputs; samples and runs that stand out of them |
//! | [`folds`], [`per_run`], `same_data`, [`orders`], [`comparison`] | fits to some of the runs; to each alone; whether problems have the same data; a problem with another order; several problems on the same data |

mod active;
mod assembly;
pub mod beforehand;
mod begun;
pub mod comparison;
pub mod data;
pub mod describing;
pub mod diagnostic;
mod diagnostics;
pub mod error;
pub mod evaluate;
pub mod events;
pub mod file;
pub mod fit;
pub mod folds;
mod followed;
mod innovations;
mod interval;
pub mod joint;
pub mod left_over;
mod likelihood;
mod loops;
mod names;
pub mod orders;
mod outliers;
pub mod part;
pub mod per_run;
pub mod posed;
mod ranges;
mod read;
pub mod refits;
pub mod result;
mod runs;
mod same_data;
pub mod solved;
mod stability;
pub mod starts;
mod trouble;
pub mod uncertainty;
pub mod unknowns;
pub mod validation;

pub use diagnostic::Diagnostic;
pub use error::ProblemError;
pub use file::ProblemFile;
pub use fit::fit;
pub use innovations::Ahead;
pub use posed::Posed;
pub use read::OWN_KEYS;
pub use result::Fit;
