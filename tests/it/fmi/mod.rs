//! Reading, checking and calling FMUs.

mod findings;
mod instance;
mod round_trip;
