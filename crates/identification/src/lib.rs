//! Identification of a pilot from recorded flights: the paper's multi-run problem (its eq. 5), with the vehicle that
//! was flown ([`vehicle`]) and a synthetic human that differs from the fitted model ([`synthetic`]).

pub mod closed_loop;
pub mod constraints;
pub mod derived;
pub mod diagnostics;
pub mod frequency;
pub mod identification;
pub mod joint;
mod linearised;
pub mod multi_start;
mod names;
pub mod options;
pub mod orders;
pub mod pilot_file;
pub mod problem;
mod projection;
mod race;
pub mod random_starts;
pub mod refits;
pub mod result;
pub mod simulate;
pub mod solve;
mod spread;
pub mod start;
pub mod statistics;
pub mod synthetic;
pub mod trials;
mod tumbles;
pub mod uncertainty;
pub mod vehicle;

pub use closed_loop::ClosedLoop;
pub use diagnostics::{Diagnostic, diagnostics};
pub use identification::Identification;
pub use options::{FitOptions, InitialPosition, InitialState, Mesh, Objective};
pub use pilot_file::PilotFileError;
pub use pilotage_collocation::Scheme;
pub use result::{Fit, PilotDiagnostic, PilotFile, RunFit};
pub use simulate::{simulate, simulate_from};
pub use solve::{FitError, Progress, fit};
pub use spread::Spread;
pub use trials::{Trial, TrialError, TrialSet};
pub use uncertainty::Uncertainty;
