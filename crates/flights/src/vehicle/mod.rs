//! The vehicle's coefficients as user data: a TOML file in which every field has a unit and a range, and a check of its
//! pitch loop before any flight.

mod file;
mod pitch_loop;

pub use file::{VehicleError, of_table, parse, read, to_toml};
pub use pilotage_linear::Mode;
pub use pitch_loop::PitchLoop;
