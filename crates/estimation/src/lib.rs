//! Problem files, which state the measured signals and the sought parameters of a system of models, and their fit.
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
//! Use this crate if models are text and data are files. An instance may also be a model in Rust, by the trait of
//! `pilotage-sdk`: pass a function that opens it with [`Part::of_equations`](part::Part::of_equations) in place of
//! [`part::open`]. The crate builds on `pilotage-collocation`, which takes equations of any form.
//!
//! | module, each used by the next | contents |
//! | --- | --- |
//! | [`problem`] | contents of a problem file |
//! | [`system`] | the instances as equations, and their connections |
//! | [`mod@posed`] | one system of equations, built from these, the runs and the unknowns |
//! | [`search`] | initial guesses and solutions |
//! | `innovations` | fit of one-step predictions, for systems driven by noise |
//! | [`result`] | estimates, their uncertainty and diagnostics |
//! | [`mod@fit`] | the search itself, and evaluation without a search |
//! | [`studies`] | repeated fits: with runs left out, other data or other models |
//! | [`fit`](mod@fit) | the SQP from several starts, and the best on finer meshes |
//! | [`posed`](mod@posed) | a problem as one system whose states, inputs and parameters are sought or recorded |

pub mod fit;
mod innovations;
pub mod posed;
pub mod problem;
pub mod result;
pub mod search;
pub mod studies;
pub mod system;

pub use fit::{evaluate, fit, fit_delays};
pub use innovations::Ahead;
pub use posed::Posed;
pub use problem::error::ProblemError;
pub use problem::file::{self, ProblemFile};
pub use problem::read::OWN_KEYS;
pub use result::diagnostic::{CODES, Diagnostic, Doubt};
pub use result::loops::OpenLoops;
pub use result::paths::PilotPaths;
pub use result::{Fit, beforehand, describing, left_over, uncertainty};
pub use search::starts;
pub use studies::{comparison, folds, orders, per_run, refits, validation};
pub use system::part;
