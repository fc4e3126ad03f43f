//! Systems as files.

use super::super::{Failure, overwrite};
use crate::cosim::SystemDescription;
use std::path::Path;

/// Writes a system file, whole or not at all.
pub fn write(path: &Path, description: &SystemDescription) -> Result<(), Failure> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let text = description.to_toml(folder).map_err(|error| {
        Failure::from(error).hint("name the instance otherwise: NAME=FILE instead of FILE")
    })?;
    overwrite::save(path, text)
}
