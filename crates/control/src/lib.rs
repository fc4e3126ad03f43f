//! Optimal control of any system of models by collocation.
//!
//! ```text
//! minimise    φ(x(T), θ)                 over controls u(t), states x(t), parameters θ, and the duration T
//! subject to  ẋ = f(t, x, u; θ),  lb ≤ g(x, u; θ) ≤ ub along the path, at its start and at its end
//! ```
//!
//! A problem file states it ([`pilotage_estimation::problem::control`]); integrals are states, and maxima and magnitudes at the
//! end become limits of a parameter, so that they are exact. The program is solved by an interior-point method whose linear
//! systems cost time in proportion to the number of intervals. Its controls are then integrated with error control: a
//! converged program is no optimum until that flight agrees and a finer mesh changes nothing.
//!
//! ```
//! use pilotage_control::{Effort, Posed, Verdict, optimise};
//! use pilotage_estimation::{ProblemFile, part};
//! use std::ops::ControlFlow;
//!
//! # let folder = tempfile::tempdir()?;
//! let model = r#"
//!     [model]
//!     name = "cart"
//!     [inputs]
//!     push = { unit = "m/s2" }
//!     [states]
//!     x = { unit = "m", der = "v" }
//!     v = { unit = "m/s", der = "push" }
//! "#;
//! std::fs::write(folder.path().join("cart.toml"), model)?;
//! let problem = r#"
//!     [system.cart]
//!     model = "cart.toml"
//!     [[control]]
//!     signal = "cart.push"
//!     min = -1
//!     max = 1
//!     [objective]
//!     minimise = "duration"
//!     [horizon]
//!     duration = { start = 1, min = 0.1, max = 10 }
//!     [final]
//!     "cart.x" = 1
//!     "cart.v" = 0
//! "#;
//! let file = ProblemFile::parse(problem, &folder.path().join("problem.toml"))?;
//! let posed = Posed::new(&file, &part::open)?;
//! let answer = optimise(&posed, &Effort::default(), &mut |_iteration| ControlFlow::Continue(()));
//! // A second of full push, a second of braking.
//! assert_eq!(answer.verdict, Verdict::Optimal);
//! assert!((answer.duration - 2.0).abs() < 1e-4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module, each used by the next | contents |
//! | --- | --- |
//! | [`program`] | the nonlinear program |
//! | `evaluation`, `rows` | its functions at several points at once; the Jacobian of what is limited |
//! | `kkt` | its linear systems, by elimination and a Riccati recursion |
//! | [`interior`] | the interior-point method |
//! | [`pose`] | a problem file as a program |
//! | [`optimise`](mod@optimise) | starts, finer meshes, the replay |
//! | `dense` | small dense systems, of the helicopter |
//! | [`hv`] | a helicopter's landings after power loss, and the map of them |

mod dense;
mod evaluation;
pub mod hv;
pub mod interior;
mod kkt;
pub mod optimise;
pub mod pose;
pub mod program;
mod rows;

pub use optimise::{Answer, Effort, Verdict, optimise};
pub use pose::Posed;
