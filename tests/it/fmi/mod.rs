//! Reading, checking and calling FMUs.

mod faults2;
mod faults3;
mod faults;
mod findings;
mod hostile;
mod instance;
mod instance3;
mod model_exchange;
mod round_trip;
