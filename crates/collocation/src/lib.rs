//! From an ODE and a mesh to a nonlinear program, by collocation.

pub mod collocation;
pub mod condensed;
pub mod constraints;
pub mod grid;
pub mod lanes;
pub mod layout;
pub mod mesh;
pub mod node;
mod parallel;
mod sparse;
pub mod tableau;

pub use collocation::Collocation;
pub use condensed::Condensed;
pub use constraints::ParameterConstraints;
pub use mesh::{Recording, Run};
pub use node::{Differentiated, Scales};
pub use tableau::Scheme;
