//! The vehicle's coefficients as user data: a TOML file in which every field has a unit and a range, and a check of its
//! pitch loop before any flight; and its linear analysis about hover, alone and with a pilot.

mod closed_loop;
mod file;
mod linear;
mod pitch_loop;
mod simulation;

pub use closed_loop::ClosedLoop;
pub use file::{VehicleError, of_table, parse, read, to_toml};
pub use linear::{LinearVehicle, pilot_response};
pub use pilotage_linear::Mode;
pub use pitch_loop::PitchLoop;
pub use simulation::{MAX_STEP, at_full_stick, fly};
