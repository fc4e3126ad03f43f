//! What is special to flights of a pilot: recordings and lists of them ([`trials`](mod@trials)), the vehicle that was flown
//! ([`vehicle`](mod@vehicle)), doubts about both ([`checks`](mod@checks)), pilot and vehicle files as models
//! ([`kind`](mod@kind)), a synthetic human ([`synthetic`](mod@synthetic)), and the problem that all of this poses
//! ([`problem`](mod@problem)). Nothing is solved here.
//!
//! ```
//! use pilotage_estimation::Posed;
//! use pilotage_flights::{FlightOptions, TrialSet, open};
//!
//! let row = |k: i32| format!("{},10,{}\n", 0.05 * f64::from(k), 10.0 - 10.0 * 0.99_f64.powi(k));
//! let rows: String = (0..100).map(row).collect();
//! let folder = tempfile::tempdir()?;
//! let run = folder.path().join("run.csv");
//! std::fs::write(&run, format!("time,target,position\n{rows}"))?;
//!
//! let flights = TrialSet::read(&[run])?;
//! let problem = FlightOptions::default().problem(&flights)?;
//! let posed = Posed::new(&problem, &open)?;
//! // θ of a pilot of third order, and the position at the start.
//! assert_eq!(posed.count(), 6 + 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | content |
//! | --- | --- |
//! | [`trials`](mod@trials) | recorded flights |
//! | [`vehicle`](mod@vehicle) | the vehicle's coefficients as a file, and its loops, linearised |
//! | [`pilot`](mod@pilot) | pilot files |
//! | [`checks`](mod@checks) | what flights and vehicle let doubt of a fit |
//! | [`kind`](mod@kind) | kinds of TOML files, and which of them stand for models |
//! | [`options`](mod@options) | what the options of a fit of flights say about its problem |
//! | [`problem`](mod@problem) | the problem of flights, as text and in memory |
//! | [`synthetic`](mod@synthetic) | a synthetic human, of another structure than the fitted model |

pub mod checks;
pub mod kind;
pub mod options;
pub mod pilot;
pub mod problem;
pub mod synthetic;
pub mod trials;
pub mod vehicle;

pub use kind::open;
pub use problem::FlightOptions;
pub use trials::{Trial, TrialError, TrialSet};
