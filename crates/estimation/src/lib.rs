//! Problem files.
mod assembly;
pub mod data;
pub mod error;
pub mod file;
pub mod fit;
mod followed;
pub mod joint;
mod names;
pub mod part;
pub mod posed;
mod read;
pub mod result;
mod stability;
pub mod starts;
pub mod unknowns;

pub use error::ProblemError;
pub use file::ProblemFile;
pub use fit::fit;
pub use posed::Posed;
pub use read::OWN_KEYS;
pub use result::Fit;
