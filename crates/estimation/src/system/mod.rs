//! The instances as equations, and their connections.

pub mod joint;
pub mod part;
