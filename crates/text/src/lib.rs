//! What users write and what they are told: TOML with places, names that were probably meant, errors
//! with their causes.

pub mod causes;
pub mod document;
pub mod nearest;
