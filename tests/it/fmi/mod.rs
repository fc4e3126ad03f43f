//! Reading, checking and calling FMUs.

mod faults2;
mod faults3;
mod findings;
mod hostile;
mod instance;
mod round_trip;
