//! Repeated fits and validation: with other data, parts of the data, or another model.

pub mod comparison;
pub mod folds;
pub mod orders;
pub mod per_run;
pub mod refits;
mod same_data;
pub mod validation;
