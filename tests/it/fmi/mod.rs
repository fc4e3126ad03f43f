//! Reading, checking and calling FMUs.

mod faults;
mod faults2;
mod faults3;
mod findings;
mod instance;
mod instance3;
mod model_exchange;
mod round_trip;
