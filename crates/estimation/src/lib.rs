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
//! | module, each beneath the next | what it holds |
//! | --- | --- |
//! | [`problem`] | what a problem file says |
//! | [`system`] | the instances as equations, and wired |
//! | [`mod@posed`] | from these, the runs and the unknowns to one system of equations |
//! | [`search`] | where the search begins, and what a solution is |
//! | `innovations` | the fit of predictions from sample to sample, where noise drives the system |
//! | [`result`] | what was found, how sure it is, what speaks against it |
//! | [`mod@fit`] | the search itself, and the problem without one |
//! | [`studies`] | what is fitted again: runs left out, other data, other models |

pub mod fit;
mod innovations;
pub mod posed;
pub mod problem;
pub mod result;
pub mod search;
pub mod studies;
pub mod system;

pub use fit::{evaluate, fit};
pub use innovations::Ahead;
pub use posed::Posed;
pub use problem::error::ProblemError;
pub use problem::file::{self, ProblemFile};
pub use problem::read::OWN_KEYS;
pub use result::diagnostic::Diagnostic;
pub use result::loops::OpenLoops;
pub use result::paths::PilotPaths;
pub use result::{Fit, beforehand, describing, left_over, uncertainty};
pub use search::starts;
pub use studies::{comparison, folds, orders, per_run, refits, validation};
pub use system::part;
