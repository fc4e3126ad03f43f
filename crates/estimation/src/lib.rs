//! Problem files.
pub mod error;
pub mod file;
pub mod joint;
pub mod part;
mod read;
