//! Reads system files: those of pilotage, and those of other tools.

use super::super::Failure;
use crate::cosim::SystemDescription;
use pilotage_systems::{is_foreign, is_ssp};
use std::path::{Path, PathBuf};

/// What a system file says.
pub struct Read {
    /// The system.
    pub description: SystemDescription,
    /// What was left out.
    pub notes: Vec<String>,
    /// Types of annotations of other tools.
    pub annotations: Vec<String>,
    /// The folder of an unpacked archive.
    pub unpacked: Option<PathBuf>,
}

/// Reads a system file; `variant` is one of several in an SSP.
pub fn read(path: &Path, variant: Option<&str>) -> Result<Read, Failure> {
    if variant.is_some() && !is_ssp(path) {
        return Err(no_variants().hint("--variant selects one of several .ssd in an .ssp"));
    }
    if is_foreign(path) {
        let own = pilotage_systems::read(path, variant)?;
        return Ok(Read {
            unpacked: (is_ssp(path) && !own.description.kept.is_empty()).then_some(own.folder),
            description: own.description,
            notes: own.notes,
            annotations: own.annotations,
        });
    }
    Ok(Read {
        description: SystemDescription::read(path)?,
        notes: Vec::new(),
        annotations: Vec::new(),
        unpacked: None,
    })
}

/// The failure for a variant of what has none.
pub fn no_variants() -> Failure {
    Failure::new("--variant is given, and there is no SSP")
}
