//! The height–velocity map of a helicopter after power loss, with a pilot in the loop.

mod band;
mod helicopter;
mod manoeuvre;
mod map;
mod pilot;
mod point;
mod problem;
mod starts;

pub use helicopter::{Frozen, Helicopter, INPUTS, STATES, Trim};
pub use manoeuvre::Manoeuvre;
pub use map::{Cell, Class, Column, Crossing, Grid, Map, Range, column, joined, map};
pub use pilot::{Axis, Pilot};
pub use point::{Landing, Landings, Settings};
