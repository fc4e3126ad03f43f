//! Problem files.
mod assembly;
mod checks;
pub mod data;
pub mod error;
pub mod file;
pub mod fit;
mod interval;
pub mod joint;
mod names;
pub mod part;
pub mod posed;
mod read;
pub mod result;
mod stability;
mod starts;
mod trouble;
pub mod unknowns;

pub use error::ProblemError;
pub use file::ProblemFile;
pub use fit::fit;
pub use posed::Posed;
pub use read::OWN_KEYS;
pub use result::Fit;
