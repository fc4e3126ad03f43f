//! A synthetic human who flies the vehicle, so that examples and tests need no recordings of people.
//!
//! It is *not* the model that pilotage fits: data from the fitted model itself would make every fit look good (the
//! inverse crime). It behaves as humans do with K/s²-like plants (McRuer's crossover model): gain and lead act on the
//! delayed error, through the second-order lag of the arm, with added noise, and the stick is limited by its stops:
//!
//! ```text
//! c(t)  = -k (e(t-τ) + T_L ė(t-τ)) + n(t)            n: remnant, coloured noise
//! s̈     = ω_n² (c - s) - 2 ζ ω_n ṡ                    s: arm and hand
//! stick = clip(s, -1, 1)
//! ```
//!
//! With a vehicle that follows the stick instantly, humans use a lag: `c` is then filtered by `1 / (T_I s + 1)`. The
//! hand may have a maximum speed, `|ṡ| <= r`. With two axes each hand has such a loop, and a part of each hand's
//! command is added to the other.
//!
//! | module | contents |
//! | --- | --- |
//! | `human` | the human's parameters |
//! | `flights` | flights and their recordings |
//! | `target` | moving targets |
//! | `vehicle` | the vehicle: the quadcopter |
//! | `model_vehicle` | any model file as the vehicle |
//! | `tuning` | gain, lead and lag suited to a vehicle |
//! | `stability` | whether a human stabilises a vehicle |
//! | `recording` | a flight as a recorder writes it |
//! | `closed_loop` | step-by-step simulation of human and vehicle |

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

/// Returns an error for the first of `(name, value, min, max)` that is out of range.
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
