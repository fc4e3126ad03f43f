//! Reading, checking and calling FMUs.

mod archives;
mod cycles;
mod faults;
mod faults2;
mod faults3;
mod faults_files;
mod findings;
mod fuzz;
mod hostile;
mod instance;
mod instance3;
mod model_exchange;
mod others;
mod round_trip;
mod rules;
