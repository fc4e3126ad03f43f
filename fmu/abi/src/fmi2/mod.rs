//! FMI 2.0, co-simulation and model exchange.

pub mod functions;
pub mod states;
pub mod types;

pub use functions::Function;
pub use states::{State, States};
pub use types::*;
