//! Makes an FMU from a model: one trait, one macro.
//!
//! A model is a table of variables and equations ([`Equations`]). From it, [`export!`] makes the C functions of FMI 2.0
//! and FMI 3.0, for co-simulation and model exchange, in one library:
//!
//! ```
//! use pilotage_sdk::{At, Equations, Scalar, Table};
//!
//! #[derive(Default)]
//! struct Ball;
//!
//! impl Equations for Ball {
//!     fn table(&self) -> Table {
//!         Table::new("ball", "A ball that bounces")
//!             .parameter("g", "m/s2", 9.80665, "Gravitational acceleration")
//!             .parameter("e", "1", 0.7, "Restitution")
//!             .output_state("h", "m", 1.0, "Height")
//!             .output_state("v", "m/s", 0.0, "Velocity")
//!             .indicator("gap", "m", "Distance to the ground")
//!     }
//!
//!     fn derivative<T: Scalar>(&self, at: At<T>, dx: &mut [T]) {
//!         dx[0] = at.x[1];
//!         dx[1] = -at.p[0];
//!     }
//!
//!     fn indicators<T: Scalar>(&self, at: At<T>, z: &mut [T]) {
//!         z[0] = at.x[0];
//!     }
//!
//!     fn event(&self, at: At<f64>, x: &mut [f64]) {
//!         if at.x[0] <= 0.0 && at.x[1] < 0.0 {
//!             // Not slightly below: the next event is where the gap falls to 0 again.
//!             x[0] = 0.0;
//!             x[1] = -at.p[1] * at.x[1];
//!         }
//!     }
//! }
//!
//! // In a crate of type `cdylib`: pilotage_sdk::export!(Ball);
//! let mut ball = pilotage_sdk::Simulation::new(Ball);
//! ball.step(2.5).expect("it bounces several times");
//! # assert!((0.0..0.01).contains(&ball.get(0)), "{}", ball.get(0));
//! ```
//!
//! | module | content |
//! | --- | --- |
//! | [`equations`], [`table`], [`variable`], [mod@unit] | declaration of a model |
//! | [`structure`], [`interface`] | dependencies between variables; interface for exporters |
//! | [`simulation`], [`lti`] | a running model: steps, events, exact derivatives |
//! | [`instance`], [`clock`], [`checkpoint`], [`resources`] | one instance of an FMU: safe code of the C functions |
//! | [`simulation_unit`] | what the C functions call; a model's instance is one |
//! | [`fmi2`], [`fmi3`], [`guard`] | the C functions: thin wrappers that check pointers and catch panics |
//! | [`log`], [`problem`] | messages to the importer; all problems of a call |
//! | `export` | the macro that makes C functions of the generic ones |
//! | [`shared`](mod@shared) | C functions that differ in their names alone |
//! | [`unit`](mod@unit) | units of the variables |
//! | `guid` | the fingerprint that links description, binary and resources |
//! | `json` | what a library tells `pilotage pack` |
//!
//! There is no global state: instances share nothing.

pub mod checkpoint;
pub mod clock;
pub mod equations;
mod export;
pub mod fmi2;
pub mod fmi3;
pub mod guard;
pub mod guid;
pub mod instance;
pub mod interface;
mod json;
pub mod log;
pub mod lti;
pub mod problem;
pub mod resources;
pub mod shared;
pub mod simulation;
pub mod simulation_unit;
pub mod structure;
pub mod table;
pub mod unit;
pub mod variable;

/// How a library makes an instance of a kind: from the resource location, or without it.
pub type Load<U> = fn(instance::InterfaceType, Option<&str>) -> Result<U, resources::LoadError>;

pub use equations::{At, Equations, Scalar};
pub use interface::Interface;
pub use pilotage_abi as abi;
pub use simulation::Simulation;
pub use simulation_unit::SimulationUnit;
pub use table::Table;
pub use unit::Unit;
pub use variable::{Role, ValueError, Variable};
