//! Models as text: a TOML file with equations is compiled to an expression graph.
//!
//! ```
//! use pilotage_language::parse;
//!
//! let text = r#"
//!     [model]
//!     name = "pendulum"
//!     [parameters]
//!     length = { start = 2.0, unit = "m", min = 0.01 }
//!     gravity = { start = 9.81, unit = "m/s2" }
//!     [states]
//!     angle = { start = 0.1, unit = "rad", der = "rate" }
//!     rate = { unit = "rad/s", der = "-gravity / length * sin(angle)" }
//! "#;
//! let pendulum = parse(text, "pendulum.toml", &|_| unreachable!("it has no tables"))?;
//! let system = &pendulum.model.system;
//! let tape = pilotage_expression::Tape::new(&system.graph, system.variables(), |_| false, &[&system.derivatives]);
//! // Time, angle, rate, length, gravity.
//! assert_eq!(tape.evaluate(&[0.0, 0.5, 1.0, 2.0, 9.81]), [1.0, -9.81 / 2.0 * 0.5_f64.sin()]);
//!
//! let wrong = text.replace("sin(angle)", "angel");
//! let error = parse(&wrong, "pendulum.toml", &|_| unreachable!()).expect_err("no such name");
//! assert_eq!(
//!     error.to_string(),
//!     "pendulum.toml:9:57: unknown name `angel`; did you mean `angle`?; known are length, gravity, angle, rate, \
//!      time, pi"
//! );
//! # Ok::<(), pilotage_language::ModelFileError>(())
//! ```
//!
//! | module | content |
//! | --- | --- |
//! | [mod@file], `sure`, `fitted` | the declarations of a file; the results of a fit for its parameters, and how it ended |
//! | `token`, [`syntax`], [`functions`] | the parser of expressions |
//! | `scope`, `units`, `dimension` | resolution of names, detection of circles, units of the equations |
//! | [`tables`] | the files of `table("file.csv", x)` |
//! | [`typeset`] | equations in mathematical notation |
//! | [`expressions`] | expressions of other files, over the variables of a system |
//! | `build`, [`compiled`] | the expression graph, and queries of a compiled model |
//! | `error` | errors in model files |
//! | [`file`](mod@file) | the declarations of a model file |

mod build;
pub mod compiled;
mod dimension;
mod error;
pub mod expressions;
pub mod file;
mod fitted;
pub mod functions;
mod scope;
mod sure;
pub mod syntax;
pub mod tables;
mod token;
pub mod typeset;
mod units;

pub use build::{Delayed, FreeDelay};
pub use compiled::{Compiled, Trouble, parse, read};
pub use error::{Fault, ModelFileError};
pub use expressions::Expressions;
pub use file::{ModelFile, Variable, is_model, with_results, with_starts};
pub use fitted::Fitted;
pub use sure::Uncertainty;
