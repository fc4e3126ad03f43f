//! Platforms: their names, the format of their libraries, and the folders under `binaries/` for this machine.

use crate::description::FmiVersion;
use object::{Architecture, BinaryFormat};
use std::collections::BTreeSet;
use std::env::consts::{ARCH, DLL_EXTENSION, OS};

/// A system and a processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Platform {
    /// Name in FMI 3.0 (section 2.5.1.4.1).
    pub tuple: &'static str,
    /// Folders of its library in FMI 2.0 (2.0.4, section 2.3): the tuple if there is no other name. Universal libraries
    /// for Macs are in `darwin64`, so Macs with ARM search there too.
    pub fmi2: &'static [&'static str],
    /// Format of its library.
    pub format: BinaryFormat,
    /// Processor of its library.
    pub architecture: Architecture,
    extension: &'static str,
}

macro_rules! platform {
    ($tuple:literal, $fmi2:expr, $format:ident, $architecture:ident, $extension:literal) => {
        Platform {
            tuple: $tuple,
            fmi2: &$fmi2,
            format: BinaryFormat::$format,
            architecture: Architecture::$architecture,
            extension: $extension,
        }
    };
}

impl Platform {
    /// Platforms for which libraries are built.
    #[rustfmt::skip]
    pub const ALL: [Self; 9] = [
        platform!("x86_64-linux", ["linux64"], Elf, X86_64, "so"),
        platform!("x86-linux", ["linux32"], Elf, I386, "so"),
        platform!("aarch64-linux", ["aarch64-linux"], Elf, Aarch64, "so"),
        platform!("x86_64-windows", ["win64"], Pe, X86_64, "dll"),
        platform!("x86-windows", ["win32"], Pe, I386, "dll"),
        platform!("aarch64-windows", ["aarch64-windows"], Pe, Aarch64, "dll"),
        platform!("x86_64-darwin", ["darwin64"], MachO, X86_64, "dylib"),
        platform!("x86-darwin", ["darwin32"], MachO, I386, "dylib"),
        platform!("aarch64-darwin", ["aarch64-darwin", "darwin64"], MachO, Aarch64, "dylib"),
    ];

    /// The platforms whose libraries may be in a folder of that name, a tuple or a name of FMI 2.0.
    pub fn of_folder(name: &str) -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(move |p| p.has_name(name))
    }

    /// Whether that is its name in a version of FMI.
    pub fn has_name(&self, name: &str) -> bool {
        self.tuple == name || self.fmi2.contains(&name)
    }

    /// Paths of its library in an archive.
    pub fn paths(&self, version: FmiVersion, model_identifier: &str) -> Vec<String> {
        let folders = match version {
            FmiVersion::V2 => self.fmi2,
            FmiVersion::V3 => std::slice::from_ref(&self.tuple),
        };
        let path = |folder| format!("binaries/{folder}/{model_identifier}.{}", self.extension);
        folders.iter().map(path).collect()
    }

    /// The platform that this program was built for, if known.
    pub fn host() -> Option<Self> {
        let tuple = tuple(ARCH, OS);
        Self::ALL.into_iter().find(|p| p.tuple == tuple)
    }
}

/// Names of processors: in a platform tuple (FMI 3.0, section 2.5.1.4.1), in Rust, and in the header of a library.
const PROCESSORS: [(&str, &str, Architecture); 8] = [
    ("aarch32", "arm", Architecture::Arm),
    ("aarch64", "aarch64", Architecture::Aarch64),
    ("riscv32", "riscv32", Architecture::Riscv32),
    ("riscv64", "riscv64", Architecture::Riscv64),
    ("x86", "x86", Architecture::I386),
    ("x86_64", "x86_64", Architecture::X86_64),
    ("ppc32", "powerpc", Architecture::PowerPc),
    ("ppc64", "powerpc64", Architecture::PowerPc64),
];

/// The processor with that name in a tuple.
pub fn processor(name: &str) -> Option<Architecture> {
    let (.., architecture) = PROCESSORS.iter().find(|(own, ..)| *own == name)?;
    Some(*architecture)
}

/// This machine's processor; `None` if FMI has no name for it.
pub(crate) fn host_processor() -> Option<Architecture> {
    let (.., architecture) = PROCESSORS.iter().find(|(_, rust, _)| *rust == ARCH)?;
    Some(*architecture)
}

/// The tuple of a processor and a system, from their names in Rust.
fn tuple(processor: &str, system: &str) -> String {
    let known = PROCESSORS.iter().find(|(_, rust, _)| *rust == processor);
    let processor = known.map_or(processor, |(name, ..)| name);
    let system = match system {
        "macos" => "darwin",
        other => other,
    };
    format!("{processor}-{system}")
}

/// Folders to search on this machine, in order: the platform tuple of FMI 3.0 (FMI 2.0.4 allows it), then the names of
/// FMI 2.0 (section 2.3).
pub fn folders() -> Vec<String> {
    let mut folders = vec![tuple(ARCH, OS)];
    let fmi2 = Platform::host().map_or(&[][..], |platform| platform.fmi2);
    folders.extend(fmi2.iter().map(|name| (*name).to_owned()));
    folders.dedup();
    folders
}

/// File name of a shared library on this machine.
pub fn library_name(model_identifier: &str) -> String {
    format!("{model_identifier}.{DLL_EXTENSION}")
}

/// The platforms for which an archive with these files contains binaries.
pub fn present<'a>(files: impl Iterator<Item = &'a str>) -> BTreeSet<&'a str> {
    files
        .filter_map(|name| name.strip_prefix("binaries/")?.split_once('/'))
        .map(|(platform, _)| platform)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rust and FMI use different names for processors and systems.
    #[test]
    fn tuples_have_the_names_of_the_standard() {
        assert_eq!(tuple("x86_64", "linux"), "x86_64-linux");
        assert_eq!(tuple("aarch64", "macos"), "aarch64-darwin");
        assert_eq!(tuple("arm", "linux"), "aarch32-linux");
        assert_eq!(tuple("powerpc64", "freebsd"), "ppc64-freebsd");
        assert_eq!(tuple("s390x", "linux"), "s390x-linux");
    }

    #[test]
    fn a_folder_of_fmi_2_may_hold_libraries_of_several_platforms() {
        let tuples = |name| {
            Platform::of_folder(name)
                .map(|p| p.tuple)
                .collect::<Vec<_>>()
        };
        assert_eq!(tuples("win32"), ["x86-windows"]);
        assert_eq!(tuples("aarch64-linux"), ["aarch64-linux"]);
        assert_eq!(tuples("darwin64"), ["x86_64-darwin", "aarch64-darwin"]);
        assert_eq!(tuples("amiga"), [""; 0]);
    }

    /// Each platform of the table has the processor of its tuple.
    #[test]
    fn platforms_have_the_processor_of_their_tuple() {
        for platform in Platform::ALL {
            let (name, _) = platform.tuple.split_once('-').unwrap();
            assert_eq!(processor(name), Some(platform.architecture), "{name}");
        }
    }
}
