//! Saves systems as files.

use super::super::{Failure, overwrite};
use crate::cosim::SystemDescription;
use crate::cosim::description::SaveError;
use std::path::Path;

/// Writes a system file, whole or not at all.
pub fn write(path: &Path, description: &SystemDescription) -> Result<(), Failure> {
    if !description.kept.is_empty() {
        let message = "--save-system would name FMUs that are unpacked for this run alone";
        let hint = "`pilotage convert SYSTEM.ssp SYSTEM.toml` keeps them beside the system file";
        return Err(Failure::new(message).hint(hint));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let text = description.to_toml(folder).map_err(|error| {
        let hint = match &error {
            SaveError::Name { .. } => "name the instance otherwise: NAME=FILE instead of FILE",
            SaveError::File { .. } => "TOML is UTF-8: rename the file, or leave --save-system out",
        };
        Failure::from(error).hint(hint)
    })?;
    overwrite::save(path, text)
}
