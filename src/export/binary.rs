//! The shared library in FMUs of pilotage's own models.

use super::Platform;
use crate::fmi::description::FmiVersion;

/// The library for this crate's target platform, built from `fmu/` by `build.rs`.
pub const LIBRARY: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/fmu-binary"));

/// The library of a system in one FMU, from `fmu/container/`.
pub const CONTAINER: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/container-binary"));

/// Paths of the library in the archive for a `modelIdentifier`; none if FMI has no name for this platform.
pub fn paths(version: FmiVersion, model_identifier: &str) -> Vec<String> {
    Platform::host().map_or(Vec::new(), |p| p.paths(version, model_identifier))
}
