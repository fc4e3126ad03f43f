//! A single model, which a person flies.

use super::flags;
use super::isolation::Isolation;
use super::resolve::{Resolved, resolve};
use crate::cli::Failure;
use crate::cosim::Component;
use std::ffi::OsStr;

/// Opens a single model by the name or file of an argument.
pub fn open_one(argument: &OsStr, is_isolated: bool) -> Result<Box<dyn Component>, Failure> {
    let (name, file) = flags::instance(argument);
    let instance = flags::described(name, flags::model_source(file));
    match resolve(&instance, &Isolation::of_all(is_isolated))? {
        Resolved::Model(component) => Ok(component),
        Resolved::Table(file) => Err(Failure::new(format!("{} is a table", file.display()))),
    }
}
