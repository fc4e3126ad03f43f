//! Identification of a pilot from recorded flights: the paper's multi-run problem (its eq. 5).
//!
//! | module | content |
//! | --- | --- |
//! | [`problem`](mod@problem) | the paper's problem, of trials and options |
//! | [`joint`](mod@joint) | pilot and vehicle as one system |
//! | [`constraints`](mod@constraints) | stability of pilot and closed loop, as constraints |
//! | [`options`](mod@options) | options of a fit |
//! | [`solve`](mod@solve) | the fit: starts from the data, an SQP from each, the best |
//! | [`start`](mod@start) | starts from the data |
//! | `projection` | starts with free initial states |
//! | [`random_starts`](mod@random_starts) | starts over a wide range |
//! | `tumbles` | other initial states at a known θ |
//! | [`multi_start`](mod@multi_start) | several starts, of which losing ones stop early |
//! | `race` | when a start has lost |
//! | [`result`](mod@result) | results of a fit |
//! | [`identification`](mod@identification) | a fit with all that is derived from it |
//! | [`closed_loop`](mod@closed_loop) | the bound on the closed loop |
//! | `linearised` | a model about zero |
//! | [`frequency`](mod@frequency) | describing functions |
//! | [`derived`](mod@derived) | crossover, margins and effective delay, with intervals |
//! | [`uncertainty`](mod@uncertainty) | standard deviations and intervals of θ |
//! | [`refits`](mod@refits) | profiles and bootstraps |
//! | [`orders`](mod@orders) | choice of the order |
//! | [`diagnostics`](mod@diagnostics) | why a fit may be less reliable than it seems |
//! | [`simulate`](mod@simulate) | a run flown by the identified pilot alone |
//! | [`pilot_file`](mod@pilot_file) | the text of the result file |

pub mod closed_loop;
pub mod constraints;
pub mod derived;
pub mod diagnostics;
pub mod frequency;
pub mod identification;
pub mod joint;
mod linearised;
pub mod multi_start;
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
pub mod start;
mod tumbles;
pub mod uncertainty;

pub use diagnostics::{Diagnostic, diagnostics};
pub use identification::Identification;
pub use options::{FitOptions, InitialPosition, InitialState, Mesh, Objective};
pub use pilotage_collocation::Scheme;
pub use pilotage_flights::{Trial, TrialError, TrialSet};
pub use result::{Fit, RunFit};
pub use simulate::{simulate, simulate_from};
pub use solve::{FitError, Progress, fit};
pub use uncertainty::Uncertainty;
