//! Where a search begins and ends: starts, the nonlinear program of one, and what its solution is.

pub(crate) mod active;
pub(crate) mod begin;
pub(crate) mod likelihood;
pub mod solved;
pub mod starts;
pub(crate) mod trouble;
