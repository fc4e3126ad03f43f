//! The library that goes into the FMUs of our own models.

use super::Platform;
use crate::fmi::description::FmiVersion;

/// The library for the platform that this crate was built for; `build.rs` made it from `fmu/`.
pub const LIBRARY: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/fmu-binary"));

/// Paths in the archive under which it goes, for that `modelIdentifier`: none where FMI has no name for
/// this platform.
pub fn paths(version: FmiVersion, model_identifier: &str) -> Vec<String> {
    Platform::host().map_or(Vec::new(), |p| p.paths(version, model_identifier))
}
