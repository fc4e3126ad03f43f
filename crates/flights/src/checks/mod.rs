//! Checks of recorded flights and of their vehicle, before any fit.
//!
//! | module | content |
//! | --- | --- |
//! | `check` | what a check may find, with message and code |
//! | `motion` | of whole flights |
//! | `samples` | of samples |
//! | `vehicle` | of the vehicle, and of flights that it cannot fly |
//! | `fitted` | of fitted flights |
//! | [`implied`](mod@implied) | the stick that a motion implies |

mod check;
mod fitted;
pub mod implied;
mod motion;
mod samples;
mod vehicle;

pub use check::Check;
pub use fitted::doubts;
pub use vehicle::of_vehicle;

use motion::of_motion;

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
