//! FMI 3.0: co-simulation, model exchange and scheduled execution.

pub mod functions;
pub mod states;
pub mod types;

pub use functions::Function;
pub use states::{State, States};
pub use types::*;
