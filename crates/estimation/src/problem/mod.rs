//! What a problem file says, and what is wrong with it.

pub mod error;
pub mod file;
pub(crate) mod read;
mod runs;
