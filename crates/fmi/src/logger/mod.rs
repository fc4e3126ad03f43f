//! The logger callbacks that instances get.

pub(super) mod fmi2;
pub(super) mod fmi3;
