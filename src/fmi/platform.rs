//! Which folder under `binaries/` holds this machine's binary.

use std::collections::BTreeSet;
use std::env::consts::{ARCH, DLL_EXTENSION, OS};

/// Folders to look in on this machine, in this order: the platform tuple of FMI 3.0 (FMI 2.0.4
/// allows it), then the name of FMI 2.0 (section 2.3).
///
/// On Macs with ARM, `darwin64` is among them: exporters put universal libraries there.
pub fn folders() -> Vec<String> {
    let bits64 = cfg!(target_pointer_width = "64");
    let (system, fmi2) = match (OS, bits64) {
        ("macos", true) => ("darwin", Some("darwin64")),
        ("windows", true) => ("windows", Some("win64")),
        ("windows", false) => ("windows", Some("win32")),
        ("linux", true) => ("linux", Some("linux64")),
        ("linux", false) => ("linux", Some("linux32")),
        (other, _) => (other, None),
    };
    // `linux64` and `win64` mean x86.
    let is_x86 = matches!(ARCH, "x86" | "x86_64");
    let fmi2 = fmi2.filter(|_| is_x86 || OS == "macos");
    let tuple = format!("{ARCH}-{system}");
    std::iter::once(tuple)
        .chain(fmi2.map(str::to_owned))
        .collect()
}

/// File name of a shared library on this machine.
pub fn library_name(model_identifier: &str) -> String {
    format!("{model_identifier}.{DLL_EXTENSION}")
}

/// The platforms for which an archive with these files holds binaries.
pub fn present<'a>(files: impl Iterator<Item = &'a str>) -> BTreeSet<&'a str> {
    files
        .filter_map(|name| name.strip_prefix("binaries/")?.split_once('/'))
        .map(|(platform, _)| platform)
        .collect()
}
