//! The height–velocity map of a helicopter after power loss, with a pilot in the loop.

mod helicopter;
mod map;
mod pilot;
mod point;

pub use helicopter::{Helicopter, INPUTS, STATES, Trim};
pub use map::{Cell, Class, Column, Crossing, Grid, Map, column, map};
pub use pilot::{Axis, Pilot};
pub use point::{Landing, Landings, Settings};
