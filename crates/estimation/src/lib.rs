//! Problem files.
mod assembly;
mod data;
pub mod error;
pub mod file;
pub mod joint;
mod names;
pub mod part;
pub mod posed;
mod read;
mod stability;
mod unknowns;
