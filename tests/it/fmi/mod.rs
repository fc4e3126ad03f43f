//! Reading, checking and calling FMUs.

mod archives;
mod cycles;
mod faults;
pub mod faults2;
pub mod faults3;
mod faults_files;
mod findings;
mod fuzz;
mod hostile;
mod instance;
mod instance3;
mod model_exchange;
mod others;
pub mod peer_rules;
mod round_trip;
mod rules;
