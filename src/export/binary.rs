//! The library that goes into every FMU, and where it goes.

use crate::fmi::platform;

/// The library for the platform that this crate was built for; `build.rs` made it from `fmu/`.
pub const LIBRARY: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/fmu-binary"));

/// Paths in the archive under which the library goes, for that `modelIdentifier`.
///
/// On x86 that is FMI 2.0's own folder alone. Other processors have none; there it is the platform
/// tuple of FMI 3.0 (allowed since 2.0.4), on Macs with ARM beside `darwin64`, where importers look
/// too.
pub fn paths(model_identifier: &str) -> Vec<String> {
    let file = platform::library_name(model_identifier);
    let folders = platform::folders();
    let first = match cfg!(any(target_arch = "x86", target_arch = "x86_64")) {
        true => folders.len() - 1,
        false => 0,
    };
    let in_folder = |folder: &String| format!("binaries/{folder}/{file}");
    folders[first..].iter().map(in_folder).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    #[cfg(all(target_os = "linux", target_arch = "x86_64"))]
    fn linux_on_x86_has_one_folder() {
        assert_eq!(super::paths("pilot"), ["binaries/linux64/pilot.so"]);
    }
}
