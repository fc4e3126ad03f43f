//! The pilot from recorded flights: the paper's multi-run problem (its eq. 5).

pub mod constraints;
pub mod options;
pub mod problem;
pub mod result;
pub mod start;
pub mod trials;

pub use options::{InitialState, Objective, Options, SchemeName};
pub use result::{Fit, PilotFile, RunFit};
pub use trials::Trial;
