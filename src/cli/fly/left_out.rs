//! `pilotage fly` where the feature `fly` is left out.

use super::{Failure, Outcome};
use std::ffi::OsString;

/// Arguments of `pilotage fly`: any.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Nobody reads them.
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    _all: Vec<OsString>,
}

/// Says why there is nothing to run.
pub fn run(_: Args) -> Result<Outcome, Failure> {
    let message = "this pilotage is built without the feature `fly`";
    Err(Failure::new(message).hint("build it with cargo's --features fly"))
}
