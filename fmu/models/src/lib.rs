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
//! | [`text`] | models of model files |
//! | [`any`] | whatever the shared library of exported FMUs runs |
//! | [`library`] | the built-in model files as texts |
//!
//! What makes them run and makes FMUs of them is [`pilotage_sdk`]'s.

pub mod any;
pub mod coefficient;
pub mod library;
pub mod model;
pub mod pilot;
pub mod quadcopter;
pub mod text;
pub mod traced;

pub use any::AnyModel;
pub use coefficient::COEFFICIENTS;
pub use model::{Model, ModelKind};
pub use pilot::Pilot;
pub use quadcopter::Quadcopter;
pub use text::TextModel;
pub use traced::{TraceError, traced};

pub use pilotage_sdk::{Role, Scalar, Table, Unit, ValueError, Variable};
pub use pilotage_sdk::{lti, simulation, structure, unit, variable};

/// A running [`Model`].
pub type Simulation = pilotage_sdk::Simulation<Model>;
