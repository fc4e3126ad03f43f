//! Equations as expression graphs.
//!
//! Equations written once, in Rust generic over the number type of `num-dual`, are recorded as a graph of operations
//! ([`trace()`]): equal expressions are stored once, and constants are folded. Models with named signals are joined
//! into one ([`Model::join`]), and parameters are replaced by numbers. Derivatives are expressions of the same graph,
//! and only structurally nonzero entries are kept ([`Graph::derivatives`], [`Graph::gradient`]). A [`Tape`] evaluates
//! expressions at many points at once, with the parts that depend only on parameters evaluated beforehand, or at one
//! point in any number type.
//!
//! It is made for solvers for estimation or control, which need the same equations with first and second derivatives
//! many thousand times. For occasional derivatives, dual numbers alone are simpler.
//!
//! ```
//! use pilotage_expression::{System, Tape};
//! use num_dual::DualNum;
//!
//! // A pendulum with the torque u: states angle and rate, parameter damping; the height is an output.
//! let pendulum = System::trace([2, 1, 1], |at| {
//!     let rate = at.u[0] - at.x[0].sin() * 9.81 - at.p[0] * at.x[1];
//!     [vec![at.x[1], rate], vec![-at.x[0].cos()]]
//! })?;
//! let mut graph = pendulum.graph.clone();
//! let by_angle = graph.derivatives(&pendulum.derivatives, pendulum.state(0));
//! let tape = Tape::new(&graph, pendulum.variables(), |_| false, &[&by_angle]);
//! // Time, states, input, parameter.
//! let found = tape.evaluate(&[0.0, 0.5, 0.0, 1.0, 0.1]);
//! assert_eq!(found, [0.0, -9.81 * 0.5_f64.cos()]);
//! # Ok::<(), pilotage_expression::Obstacle>(())
//! ```
//!
//! | module | content |
//! | --- | --- |
//! | [`graph`](mod@graph) | expressions as a graph of operations, each stored once |
//! | [`operation`](mod@operation) | the operations |
//! | `derivative` | derivatives, as expressions of the same graph |
//! | `influence` | on what expressions depend, and how |
//! | `switches` | conditions on time, and the times at which they change |
//! | [`tape`](mod@tape) | a list of instructions, run at many points at once |
//! | [`trace`](mod@trace) | equations in generic Rust, recorded as a graph |
//! | [`system`](mod@system) | a model as expressions |
//! | [`model`](mod@model) | models with named signals, and how they are joined |
//! | [`curve`](mod@curve) | curves through points |
//! | [`opaque`](mod@opaque) | functions that are no expressions, as those of an FMU |

pub mod curve;
mod derivative;
pub mod graph;
mod influence;
pub mod model;
pub mod opaque;
pub mod operation;
mod switches;
pub mod system;
pub mod tape;
pub mod trace;

pub use curve::Curve;
pub use graph::{Graph, Node};
pub use model::{Model, ModelError};
pub use opaque::{Call, Opaque, Partial};
pub use operation::{Function, Operation, Operator};
pub use switches::Switches;
pub use system::{Point, System};
pub use tape::{Registers, Tape};
pub use trace::{Obstacle, Traced, trace};
