//! The pilot's describing function and that of the open loop, straight from flights after a target that is a sum of sines,
//! beside what was fitted ([`pilotage_inference::spectrum`]).

use super::closed_loop::LinearVehicle;
use super::{Fit, FitOptions, Trial};
use nalgebra::Complex;
use pilotage_inference::spectrum::{Checked, Point, Record, Unfit, response};
use pilotage_models::Pilot;

/// What flights say of pilot and loop without a model, and what was fitted there.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Describing {
    /// From the error \[m\] to the stick; no lines where no stick was recorded.
    pub pilot: Checked,
    /// From the error to the position; no fitted values where nobody said what was flown.
    pub open_loop: Vec<Point>,
    /// The same beside the fitted loop; no lines without a vehicle.
    pub fitted_loop: Checked,
    /// Runs that tell nothing of it, and why.
    pub left_out: Vec<(String, Unfit)>,
}
