//! The pilot from recorded flights: the paper's multi-run problem (its eq. 5).

pub mod options;
pub mod result;
pub mod trials;

pub use options::{InitialState, Objective, Options, SchemeName};
pub use result::{Fit, PilotFile, RunFit};
pub use trials::{Trial, TrialError, TrialSet};
