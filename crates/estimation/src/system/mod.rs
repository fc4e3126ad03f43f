//! The instances as equations, and their connections.

pub mod delayed;
pub mod joint;
pub mod part;
