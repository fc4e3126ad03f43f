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
//! | [mod@unit], [`variable`], [`coefficient`] | units, variables, and the vehicle's coefficients as data |
//! | [`model`] | pilot or vehicle as it is exported: table of variables, GUID, model file |
//! | [`simulation`] | a model that runs |
//! | [`lti`], [`integrate`](mod@integrate) | exact steps of linear systems; Dormand–Prince with error control |

pub mod coefficient;
pub mod dynamics;
pub mod integrate;
pub mod joint;
pub mod lti;
pub mod model;
pub mod pilot;
pub mod quadcopter;
pub mod simulation;
pub mod unit;
pub mod variable;

pub use coefficient::COEFFICIENTS;
pub use dynamics::Dynamics;
pub use joint::{Joint, OpenLoopPilot};
pub use model::{Kind, Model};
pub use pilot::Pilot;
pub use quadcopter::Quadcopter;
pub use simulation::Simulation;
pub use unit::Unit;
pub use variable::{ValueError, Variable};

/// The number type of the models' equations: `f64`, or a dual number that carries derivatives.
///
/// Implemented for everything that satisfies the bounds; never implemented by hand.
pub trait Scalar: num_dual::DualNum<Primitive = f64> + Copy {}

impl<T: num_dual::DualNum<Primitive = f64> + Copy> Scalar for T {}
