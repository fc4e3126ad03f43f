//! A synthetic human who flies the vehicle, so that examples and tests need no recordings of people.
//!
//! It is *not* the model that pilotage fits: data from the fitted model itself would make every fit
//! look good (the inverse crime). It flies as people fly K/s²-like plants (McRuer's crossover model):
//! gain and lead on the error seen a delay ago, through the second-order lag of the arm, with noise of
//! its own, and the stick ends at its stops:
//!
//! ```text
//! c(t)  = -k (e(t-τ) + T_L ė(t-τ)) + n(t)            n: remnant, coloured noise
//! s̈     = ω_n² (c - s) - 2 ζ ω_n ṡ                    s: arm and hand
//! stick = clip(s, -1, 1)
//! ```
//!
//! With a vehicle that follows the stick at once people lag: then `c` is what comes out of `1 / (T_I s + 1)`. The hand may
//! have a greatest speed, `|ṡ| <= r`. In two axes each hand has such a loop of its own, and a part of what one is told
//! leaks into the other.
//!
//! | module | what it holds |
//! | --- | --- |
//! | `human` | the human's parameters |
//! | `flights` | what is flown, and the recordings |
//! | `target` | targets that move |
//! | `vehicle` | what is flown: the quadcopter |
//! | `model_vehicle` | or any model file |
//! | `tuning` | gain, lead and lag that suit a vehicle |
//! | `stability` | whether a human holds a vehicle |
//! | `recording` | a flight as a recorder writes it |
//! | `closed_loop` | human and vehicle, step by step |

mod closed_loop;
mod error;
mod flights;
mod human;
mod model_vehicle;
mod recording;
mod stability;
mod target;
mod tuning;
mod vehicle;

pub use error::SyntheticError;
pub use flights::{Flight, Flights};
pub use human::{Hands, Human};
pub use model_vehicle::ModelVehicle;
pub use target::{Moving, Shape, Signal};
pub use tuning::Given;
pub use vehicle::Vehicle;

/// The first of `(name, value, min, max)` that is out of range.
fn check_ranges(
    ranges: impl IntoIterator<Item = (&'static str, f64, f64, f64)>,
) -> Result<(), SyntheticError> {
    let mut ranges = ranges.into_iter();
    match ranges.find(|(_, value, min, max)| !(min..=max).contains(&value)) {
        Some((name, value, min, max)) => Err(SyntheticError::Range {
            name,
            value,
            min,
            max,
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
