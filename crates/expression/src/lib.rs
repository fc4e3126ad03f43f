//! Equations as expression graphs.
mod derivative;
pub mod graph;
pub mod model;
pub mod operation;
pub mod system;
pub mod tape;
pub mod trace;
pub use graph::{Graph, Node};
pub use model::{Model, ModelError};
pub use operation::{Function, Operation, Operator};
pub use system::{Point, System};
pub use tape::{Registers, Tape};
pub use trace::{Obstacle, Traced, trace};
