//! Logger callbacks of instances.

pub(super) mod fmi2;
pub(super) mod fmi3;
