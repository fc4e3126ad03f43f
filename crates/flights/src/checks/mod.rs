//! Checks of recorded flights and of their vehicle, before any fit.
//!
//! | module | content |
//! | --- | --- |
//! | `check` | what a check may find, with message and code |
//! | `motion` | of whole flights |
//! | [`samples`](mod@samples) | of samples |
//! | `vehicle` | of the vehicle, and of flights that it cannot fly |
//! | [`implied`](mod@implied) | the stick that a motion implies |

mod check;
pub mod implied;
mod motion;
pub mod samples;
mod vehicle;

pub use check::{Check, worst};
pub use motion::of_motion;
pub use vehicle::{moving, of_vehicle};

use crate::Trial;

/// All that needs no vehicle, the most severe first. Where nothing moves, the samples are of no interest.
pub fn recorded(trials: &[Trial]) -> Vec<Check> {
    let mut checks = of_motion(trials);
    checks.extend(samples::of_samples(trials));
    if checks.contains(&Check::ConstantData) {
        checks.retain(Check::is_fatal);
    }
    checks.sort_by_key(|check| !check.is_fatal());
    checks
}
