//! From an ODE and a mesh to a nonlinear program, by collocation.

pub mod collocation;
pub mod condensed;
pub mod constraints;
pub mod layout;
pub mod mesh;
pub mod node;
pub mod scheme;
mod sparse;

pub use collocation::Collocation;
pub use condensed::Condensed;
pub use constraints::ParameterConstraints;
pub use mesh::Run;
pub use node::Scales;
pub use scheme::Scheme;
