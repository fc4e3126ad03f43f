//! Contents of a problem file, and errors in it.

pub mod control;
pub mod error;
pub mod file;
pub(crate) mod order;
pub(crate) mod read;
mod runs;
