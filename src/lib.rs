//! **pilotage** identifies how a human pilot controls a vehicle and exports the identified pilot as an FMU that any
//! simulation tool can run.
//!
//! It fits one pilot model θ to all recorded flights to a target by constrained optimisation in the time domain:
//! collocation with all states implicit, solved by a sparse SQP. It fits the vehicle's response, not the stick.
//!
//! This example fits a pilot to the six shipped flights, exports FMUs of pilot and vehicle, and co-simulates both:
//!
//! ```
//! use pilotage::{Algorithm, Clock, Export, FlightOptions, FmuComponent, Model, Posed};
//! use pilotage::{Provenance, SeriesRecorder, System, TrialSet};
//! use std::ops::ControlFlow;
//!
//! let flights = TrialSet::read(&["examples/trials/trials.toml".into()])?;
//! let options = FlightOptions::default();
//! let problem = options.problem(&flights)?;
//! let posed = Posed::new(&problem, &pilotage::open)?;
//! let fit = pilotage::fit(&posed, &mut |_iteration| ControlFlow::Continue(()));
//! assert!(fit.is_answer(), "{}", fit.verdict());
//!
//! let folder = tempfile::tempdir()?;
//! let [pilot, quadcopter] = ["pilot.fmu", "quadcopter.fmu"].map(|file| folder.path().join(file));
//! let theta: Vec<f64> = (1..=6).filter_map(|k| fit.value(&format!("pilot.theta{k}"))).collect();
//! let (model, vehicle) = (Model::pilot(&theta, options.stick_limit), Model::quadcopter(&options.vehicle));
//! Export::new(&model, &Provenance::default()).write(&pilot)?;
//! Export::new(&vehicle, &Provenance::vehicle(None)).write(&quadcopter)?;
//!
//! let mut system = System::new();
//! system.add("pilot", Box::new(FmuComponent::open(&pilot, "pilot")?))?;
//! system.add("quadcopter", Box::new(FmuComponent::open(&quadcopter, "quadcopter")?))?;
//! system.connect("pilot.stick", "quadcopter.stick")?;
//! system.connect("quadcopter.z", "pilot.position")?;
//! system.set("pilot.target", "10")?;
//! let (clock, mut recorder) = (Clock::new(0.0, 15.0, 0.01)?, SeriesRecorder::default());
//! pilotage::co_simulate(system, &clock, None, Algorithm::GaussSeidel, &mut recorder)?;
//!
//! let height = recorder.series.column("quadcopter.z").expect("an output");
//! assert!((height.values[1500] - 10.0).abs() < 0.3, "{} m", height.values[1500]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! These names cover what most programs need. Everything else is in the crates from which they are re-exported:
//! `pilotage-estimation` (any problem), `pilotage-flights` (trials, vehicle and pilot files), `pilotage-cosim` (the master), `pilotage-fmi`
//! (FMUs of other tools), `pilotage-linear` (poles and margins), `pilotage-sdk` (FMUs of user-written models), and the
//! crates they build on: `pilotage-collocation`, `pilotage-sqp` and `pilotage-ode`.
//!
//! Two parts are features, on by default, since few programs need them: `fly`, the page on which a person flies, with its
//! server, and `png`, figures as PNG, with fonts.

#[doc(inline)]
pub use export::{Export, Provenance};
#[doc(inline)]
pub use pilotage_cosim::{
    Algorithm, Clock, FmuComponent, SeriesRecorder, System, run as co_simulate,
};
#[doc(inline)]
pub use pilotage_estimation::{Fit, Posed, ProblemFile, fit};
#[doc(inline)]
pub use pilotage_flights::{FlightOptions, Trial, TrialSet, open};
#[doc(inline)]
pub use pilotage_models::Model;

pub mod export;

// Short names of the crates, for the command, the tests and the benches.
#[doc(hidden)]
pub mod atomic_file;
#[doc(hidden)]
pub mod cli;
#[doc(hidden)]
pub mod date;
#[doc(hidden)]
pub mod report;
#[doc(hidden)]
pub use {
    pilotage_collocation as collocation, pilotage_control as control, pilotage_cosim as cosim,
    pilotage_estimation as estimation, pilotage_expression as expression,
    pilotage_filter as filter, pilotage_flights as flights,
    pilotage_flights::{synthetic, vehicle},
    pilotage_fmi as fmi, pilotage_fmi_check as fmi_check, pilotage_inference as inference,
    pilotage_linear as linear, pilotage_models as models, pilotage_ode as ode,
    pilotage_refits as refits, pilotage_series as series, pilotage_sqp as sqp,
    pilotage_text::{document, error_chain, file, suggestion},
};

/// Compiles the examples of the guide as doctests.
#[cfg(doctest)]
#[doc = include_str!("../docs/fmu-models.md")]
struct Guide;
