//! Systems of other tools: System Structure and Parameterization (Modelica Association, SSP 1.0, 1.0.1 and 2.0), read as a
//! [`SystemDescription`] and written from one; those of the Open Simulation Platform and of maestro, read.
//!
//! Sections are those of SSP 2.0: 3 (packages), 4 (common content), 5 (SSD), 6 (SSV), 7 (SSM), 8 (SSB). Nested systems are
//! flattened: the instance of component `c` in system `s` is `s.c`. Connectors of systems and signal dictionaries become
//! wires between components, and what bindings say becomes start values.
//!
//! Mistakes have their place:
//!
//! ```
//! let folder = tempfile::tempdir()?;
//! let file = folder.path().join("loop.ssd");
//! let system = "<System name='loop'><Elements>\n<Component name='pilot' source='pilot.fmu'/></Elements></System>";
//! let text = format!("<SystemStructureDescription version='1.0' name='loop'>{system}</SystemStructureDescription>");
//! std::fs::write(&file, text)?;
//! let error = pilotage_systems::read(&file, None).unwrap_err().to_string();
//! assert!(error.ends_with("loop.ssd:2:1: <Component>: there is no file `pilot.fmu`"));
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! | module | what it does |
//! | --- | --- |
//! | `error` | errors, and places of elements |
//! | `package` | archives and folders: variants, files by their URI |
//! | `xml` | elements with their places |
//! | `units` | units of a file |
//! | `variables` | the variables of an FMU by name |
//! | `tree` | a system as its files say it |
//! | `parameters` | values and mappings of a binding |
//! | `read` | reads a tree |
//! | `flatten` | makes a description of a tree |
//! | `apply` | applies values to variables |
//! | `wiring` | traces connections through systems and dictionaries |
//! | `vocabulary` | the words of the standard |
//! | `osp` | systems of the Open Simulation Platform |
//! | `maestro` | systems of maestro |
//! | `plain` | what these two have in common |
//! | `write` | writes a description as an archive |
//! | `ssd` | the `.ssd` of a description |

mod apply;
mod error;
mod flatten;
mod maestro;
mod osp;
mod package;
mod parameters;
mod plain;
mod read;
mod ssd;
mod tree;
mod units;
mod variables;
mod vocabulary;
mod wiring;
mod write;
mod xml;

pub use error::SspError;
pub use package::{is_ssp, variants};
pub use ssd::to_ssd;
pub use write::{WriteError, fmu, to_ssp};

use pilotage_cosim::SystemDescription;
use std::path::{Path, PathBuf};

/// A system of another tool.
#[derive(Debug, Clone, PartialEq)]
pub struct Foreign {
    /// What is simulated. Unpacked files last as long as it does.
    pub description: SystemDescription,
    /// What was left out or taken in a way that a user should know.
    pub notes: Vec<String>,
    /// Types of annotations; but for a communication step, what they say has no effect.
    pub annotations: Vec<String>,
    /// The folder with the files: that of an unpacked archive, or the user's.
    pub folder: PathBuf,
}

/// Whether a path is a system of another tool, by its name or by what it contains.
pub fn is_foreign(path: &Path) -> bool {
    is_ssp(path) || osp::is_osp(path) || maestro::is_maestro(path)
}

/// Reads an `OspSystemStructure.xml`, a multi-model (`mm.json`) of maestro, or an SSP: an archive (`.ssp`), a folder with a `SystemStructure.ssd`, or an `.ssd`; of several variants that of this name
/// (its own, or that of its file), otherwise `SystemStructure.ssd` (section 3).
///
/// # Errors
/// If something cannot be read, or says what a system cannot be; the error names file, line, column and element.
pub fn read(path: &Path, variant: Option<&str>) -> Result<Foreign, SspError> {
    if osp::is_osp(path) {
        return osp::read(path);
    }
    if maestro::is_maestro(path) {
        return maestro::read(path);
    }
    let (package, file, kept) = package::Package::open(path, variant)?;
    let mut reader = read::Reader::new(kept);
    let root = reader.root(&package, &file)?;
    Ok(Foreign {
        folder: package.path(""),
        ..flatten::flatten(root, reader)?
    })
}
