//! Linear systems in state space: coupling of parts, cutting a loop at a connection, poles and stability margins, and
//! identification from responses.
//!
//! ```text
//! ẋ = A x + B u,   y = C x + D u,   u = K y + w      poles: det(s I - A_closed) = 0,   margins: 1 + L(jω) ≈ 0
//! ```
//!
//! It is made for loops of several linearised models with up to a few hundred states, in continuous time or sampled as
//! in a co-simulation with a communication step ([`Sampled`]). It does not design controllers.
//!
//! The example is a vehicle `1 / (s² + s)` with a gain of 2. Its characteristic polynomial is `s² + s + 2`, and its
//! crossover `ω_c` solves `ω_c⁴ + ω_c² = 4`:
//!
//! ```
//! use nalgebra::dmatrix;
//! use pilotage_linear::{StateSpace, Wire};
//!
//! let names = |names: &[&str]| names.iter().map(|name| name.to_string()).collect();
//! let vehicle = StateSpace {
//!     a: dmatrix![0.0, 1.0; 0.0, -1.0],
//!     b: dmatrix![0.0; 1.0],
//!     c: dmatrix![1.0, 0.0],
//!     d: dmatrix![0.0],
//!     states: names(&["position", "velocity"]),
//!     inputs: names(&["stick"]),
//!     outputs: names(&["position"]),
//! };
//! let wires = [Wire { output: 0, input: 0, factor: -2.0 }];
//!
//! let poles = vehicle.closed(&wires)?.poles();
//! assert!(poles.iter().all(|pole| (pole.re + 0.5).abs() < 1e-12 && (pole.im.abs() - 1.75f64.sqrt()).abs() < 1e-12));
//!
//! let (_response, margins) = vehicle.open_loop(&wires, 0)?.margins();
//! let crossing = margins.phase_margin().expect("the gain falls below 1");
//! let crossover = ((17f64.sqrt() - 1.0) / 2.0).sqrt();
//! assert!((crossing.frequency - crossover).abs() < 1e-9);
//! assert!((crossing.phase_margin - (1.0 / crossover).atan()).abs() < 1e-9);
//! # Ok::<(), pilotage_linear::AlgebraicLoop>(())
//! ```
//!
//! | module | content |
//! | --- | --- |
//! | `state_space` | systems in state space: coupled, cut open |
//! | `modes` | poles, their frequency and damping |
//! | `margins` | frequency response and stability margins |
//! | `figures` | figures of merit of a loop, and of one beside it |
//! | `discrete` | loops whose inputs are held during a step |
//! | `realization` | a system from its responses |
//! | [`svd`](mod@svd) | singular values and vectors |

mod discrete;
mod figures;
mod margins;
mod modes;
mod realization;
mod state_space;
pub mod svd;

pub use discrete::Sampled;
pub use figures::{Figure, LoopFigures, OpenLoop};
pub use margins::{GainCrossing, Margins, PhaseCrossing, Response};
pub use modes::{Mode, eigenvalues};
pub use realization::{Realization, RealizationError, realize, steps_needed};
pub use state_space::{AlgebraicLoop, NotFinite, StateSpace, Wire};
