//! What is fitted or judged again: with other data, other parts of the data, another model.

pub mod comparison;
pub mod folds;
pub mod orders;
pub mod per_run;
pub mod refits;
mod same_data;
pub mod validation;
