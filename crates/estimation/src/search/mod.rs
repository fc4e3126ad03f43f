//! Beginning and end of a search: starts, the nonlinear program of a start, and its solution.

pub(crate) mod active;
pub mod begin;
mod diverged;
pub(crate) mod likelihood;
pub(crate) mod observed;
pub mod solved;
pub mod starts;
pub(crate) mod trouble;
