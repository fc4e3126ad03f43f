//! The instances as equations, and wired.

pub mod joint;
pub mod part;
