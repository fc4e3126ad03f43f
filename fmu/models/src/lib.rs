//! Equations and variable tables of the models that pilotage identifies, simulates and exports.
//!
//! Every equation is written once, generic over [`Scalar`]: an exported FMU runs it with `f64`, the
//! optimiser runs the same lines with dual numbers and gets exact derivatives.
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`quadcopter`] | the vehicle: pitch axis of a quadcopter, six states |
//! | [`pilot`] | the pilot: n-th order linear system in controllable canonical form |
//! | [`joint`] | pilot and vehicle in closed loop, one ODE |
//! | [`dynamics`] | the trait through which the transcription sees any of them |
//! | [`coefficient`] | the vehicle's coefficients as data |
//! | [`model`] | pilot or vehicle as it is exported: table of variables, model file |
//!
//! What makes them run and makes FMUs of them is [`pilotage_kit`]'s.

pub mod coefficient;
pub mod dynamics;
pub mod joint;
pub mod model;
pub mod pilot;
pub mod quadcopter;

pub use coefficient::COEFFICIENTS;
pub use dynamics::Dynamics;
pub use joint::{Joint, OpenLoopPilot};
pub use model::{Kind, Model};
pub use pilot::Pilot;
pub use quadcopter::Quadcopter;

pub use pilotage_kit::{Role, Scalar, Table, Unit, ValueError, Variable};
pub use pilotage_kit::{lti, simulation, structure, unit, variable};

/// A running [`Model`].
pub type Simulation = pilotage_kit::Simulation<Model>;
