//! Reading, checking and calling FMUs.

mod faults;
mod findings;
mod instance;
mod round_trip;
