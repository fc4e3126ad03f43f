//! Equations and variable tables of the models that pilotage identifies, simulates and exports.
//!
//! Each equation is written once, generic over [`Scalar`]: an exported FMU evaluates it with `f64`, the optimiser
//! evaluates the same code with dual numbers and gets exact derivatives.
//!
//! | module | content |
//! | --- | --- |
//! | [`quadcopter`] | the vehicle: pitch axis of a quadcopter, six states |
//! | [`pilot`] | the pilot: n-th order linear system in controllable canonical form |
//! | [mod@traced] | any model of the SDK's trait as expressions, for fitting and linearisation |
//! | [`coefficient`] | the vehicle's coefficients as data |
//! | [`model`] | exported form of pilot and vehicle: table of variables, model file |
//! | [`text`] | models from model files |
//! | [`any`] | the model that the shared library of exported FMUs runs |
//! | [`expressions`] | all equations as expressions, for what writes them in another language |
//! | [`library`] | the built-in model files as texts |
//! | [`traced`](mod@traced) | equations of the SDK as an expression graph |
//!
//! [`pilotage_sdk`] simulates them and makes FMUs of them.

pub mod any;
pub mod coefficient;
pub mod expressions;
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
