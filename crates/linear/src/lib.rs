//! Linear systems in state space: coupled from parts, cut open at a connection, their poles and the
//! margins of their loops; or found from responses.
//!
//! ```text
//! parts -> StateSpace::side_by_side -> close(wires) -> poles
//!                                   -> open loop at a wire -> margins
//! ```

mod discrete;
mod margins;
mod modes;
mod realization;
mod state_space;
#[cfg(test)]
mod tests;

pub use discrete::Sampled;
pub use margins::{GainCrossing, Margins, PhaseCrossing, Response};
pub use modes::{Mode, eigenvalues};
pub use realization::{Realization, RealizationError, realize, steps_needed};
pub use state_space::{AlgebraicLoop, NotFinite, StateSpace, Wire};
