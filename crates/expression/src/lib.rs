//! Equations as expression graphs.
//!
//! Equations that are written once, in Rust generic over the number type of `num-dual`, are taken down as a
//! graph of operations ([`trace()`]): equal expressions stand in it once, constants are folded. Models with
//! named signals are joined to one ([`Model::join`]), parameters become numbers, derivatives are expressions of
//! the same graph with exactly the entries that are not zero ([`Graph::derivatives`], [`Graph::gradient`]). A
//! [`Tape`] computes expressions at many points at once, with what depends on parameters alone done before, or
//! at one point in any number type.
//!
//! It serves whoever needs the same equations with first and second derivatives many thousand times: a
//! solver for estimation or control. For one derivative now and then, dual numbers alone are simpler.
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

pub mod curve;
mod derivative;
pub mod graph;
pub mod model;
pub mod opaque;
pub mod operation;
pub mod system;
pub mod tape;
#[cfg(test)]
mod tests;
pub mod trace;

pub use curve::Curve;
pub use graph::{Graph, Node};
pub use model::{Model, ModelError};
pub use opaque::{Call, Opaque, Partial};
pub use operation::{Function, Operation, Operator};
pub use system::{Point, System};
pub use tape::{Registers, Tape};
pub use trace::{Obstacle, Traced, trace};
