//! Reading, checking and calling FMUs.

mod findings;
mod round_trip;
