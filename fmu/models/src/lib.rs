//! Equations and variable tables of the models that pilotage identifies, simulates and exports.
//!
//! Every equation is written once, generic over [`Scalar`]: an exported FMU runs it with `f64`, the
//! optimiser runs the same lines with dual numbers and gets exact derivatives.
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`quadcopter`] | the vehicle: pitch axis of a quadcopter, six states |
//! | [`pilot`] | the pilot: n-th order linear system in controllable canonical form |
//! | [mod@traced] | any model of the SDK's trait as expressions, to be fitted and linearised |
//! | [`coefficient`] | the vehicle's coefficients as data |
//! | [`model`] | pilot or vehicle as it is exported: table of variables, model file |
//!
//! What makes them run and makes FMUs of them is [`pilotage_kit`]'s.

pub mod coefficient;
pub mod model;
pub mod pilot;
pub mod quadcopter;
pub mod traced;

pub use coefficient::COEFFICIENTS;
pub use model::{Kind, Model};
pub use pilot::Pilot;
pub use quadcopter::Quadcopter;
pub use traced::{TraceError, traced};

pub use pilotage_kit::{Role, Scalar, Table, Unit, ValueError, Variable};
pub use pilotage_kit::{lti, simulation, structure, unit, variable};

/// A running [`Model`].
pub type Simulation = pilotage_kit::Simulation<Model>;
