//! Reading, checking and calling FMUs.

mod findings;
mod instance;
mod model_exchange;
mod round_trip;
