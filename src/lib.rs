//! **pilotage** identifies how a human pilot acts on a vehicle, and hands that pilot on as an FMU that
//! any simulation tool can run.
//!
//! From recorded flights to a target it fits one pilot model θ for all runs, by constrained
//! optimisation in the time domain: collocation with every state implicit, solved by a sparse SQP. It
//! fits the vehicle's response, not the stick.

pub mod date;
pub mod export;
pub mod output;
pub mod report;

#[doc(hidden)]
pub mod cli;

pub use pilotage_collocation as transcription;
pub use pilotage_cosim as cosim;
pub use pilotage_fmi as fmi;
pub use pilotage_fmi_check as fmi_check;
pub use pilotage_identification as identification;
pub use pilotage_identification::{synthetic, vehicle};
pub use pilotage_linear as linear;
pub use pilotage_models as models;
pub use pilotage_ode as integrate;
pub use pilotage_series as series;
pub use pilotage_sqp as sqp;
pub use pilotage_text::{causes, document, nearest};
