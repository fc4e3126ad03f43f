//! **pilotage** identifies how a human pilot acts on a vehicle, and hands that pilot on as an FMU that
//! any simulation tool can run.
//!
//! From recorded flights to a target it fits one pilot model θ for all runs, by constrained
//! optimisation in the time domain: collocation with every state implicit, solved by a sparse SQP. It
//! fits the vehicle's response, not the stick.

pub mod causes;
pub mod cosim;
pub mod date;
pub mod document;
pub mod export;
pub mod fmi;
pub mod identification;
pub mod integrate;
pub mod linear;
pub mod nearest;
pub mod output;
pub mod report;
pub mod series;
pub mod sqp;
pub mod synthetic;
pub mod transcription;
pub mod vehicle;

#[doc(hidden)]
pub mod cli;

pub use pilotage_models as models;
