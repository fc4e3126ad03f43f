//! Platforms: what they are called in the two versions, and whether a library is made for one.

use super::ExportError;
use crate::fmi::binary;
use crate::fmi::description::FmiVersion;
use object::{Architecture, BinaryFormat, Object, ObjectKind};
use pilotage_abi::{fmi2, fmi3};

/// A system and a processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Platform {
    /// FMI 3.0's name (section 2.5.1.4.1), used in FMI 2.0 too where it has none (2.0.4, section 2.3).
    pub tuple: &'static str,
    /// FMI 2.0's name.
    fmi2: Option<&'static str>,
    format: BinaryFormat,
    architecture: Architecture,
    extension: &'static str,
}

macro_rules! platform {
    ($tuple:literal, $fmi2:expr, $format:ident, $architecture:ident, $extension:literal) => {
        Platform {
            tuple: $tuple,
            fmi2: $fmi2,
            format: BinaryFormat::$format,
            architecture: Architecture::$architecture,
            extension: $extension,
        }
    };
}

impl Platform {
    /// All that are known.
    pub const ALL: [Self; 8] = [
        platform!("x86_64-linux", Some("linux64"), Elf, X86_64, "so"),
        platform!("x86-linux", Some("linux32"), Elf, I386, "so"),
        platform!("aarch64-linux", None, Elf, Aarch64, "so"),
        platform!("x86_64-windows", Some("win64"), Pe, X86_64, "dll"),
        platform!("x86-windows", Some("win32"), Pe, I386, "dll"),
        platform!("aarch64-windows", None, Pe, Aarch64, "dll"),
        platform!("x86_64-darwin", Some("darwin64"), MachO, X86_64, "dylib"),
        platform!("aarch64-darwin", None, MachO, Aarch64, "dylib"),
    ];

    /// The platform of that name, in either version's spelling.
    ///
    /// # Errors
    /// When there is none; the message lists the names.
    pub fn named(name: &str) -> Result<Self, ExportError> {
        let is = |p: &Self| p.tuple == name || p.fmi2 == Some(name);
        Self::ALL.into_iter().find(is).ok_or_else(|| {
            let tuples = Self::ALL.iter().map(|p| p.tuple);
            let names = Self::ALL.iter().filter_map(|p| p.fmi2);
            ExportError::UnknownPlatform {
                name: name.to_owned(),
                known: tuples.chain(names).collect::<Vec<_>>().join(", "),
            }
        })
    }

    /// The platform that this program was built for, if it is known.
    pub fn host() -> Option<Self> {
        let system = match std::env::consts::OS {
            "macos" => "darwin",
            other => other,
        };
        let tuple = format!("{}-{system}", std::env::consts::ARCH);
        Self::ALL.into_iter().find(|p| p.tuple == tuple)
    }

    /// Paths in the archive under which its library goes.
    ///
    /// FMI 2.0 has no folder for Macs with ARM; importers look in `darwin64` too.
    pub fn paths(&self, version: FmiVersion, model_identifier: &str) -> Vec<String> {
        let folders = match (version, self.fmi2) {
            (FmiVersion::V3, _) => vec![self.tuple],
            (FmiVersion::V2, Some(name)) => vec![name],
            (FmiVersion::V2, None) if self.tuple == "aarch64-darwin" => {
                vec![self.tuple, "darwin64"]
            }
            (FmiVersion::V2, None) => vec![self.tuple],
        };
        let path = |folder| format!("binaries/{folder}/{model_identifier}.{}", self.extension);
        folders.into_iter().map(path).collect()
    }

    /// Refuses what is no library for this platform with all functions of the version.
    ///
    /// # Errors
    /// When the format, the architecture or a function is not as it must be.
    pub fn check(&self, bytes: &[u8], version: FmiVersion) -> Result<(), ExportError> {
        let wrong = |found: String| ExportError::WrongBinary {
            platform: self.tuple,
            found,
        };
        let bytes = binary::thin(bytes, |architecture| architecture == self.architecture)
            .map_err(|error| wrong(error.to_string()))?;
        let file = object::File::parse(bytes).map_err(|error| wrong(error.to_string()))?;
        let made_for = (file.format(), file.architecture());
        if made_for != (self.format, self.architecture) {
            return Err(wrong(format!("it is made for {made_for:?}")));
        }
        if file.kind() != ObjectKind::Dynamic {
            return Err(wrong(format!("it is of kind {:?}", file.kind())));
        }
        let exported = binary::exported(&file).map_err(|error| wrong(error.to_string()))?;
        let names: Vec<&str> = match version {
            FmiVersion::V2 => fmi2::Function::ALL.iter().map(|f| f.name()).collect(),
            FmiVersion::V3 => fmi3::Function::ALL.iter().map(|f| f.name()).collect(),
        };
        match names.iter().find(|n| !exported.contains(n.as_bytes())) {
            Some(missing) => Err(wrong(format!("it lacks the function {missing}"))),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// FMI rule 18: folders of binaries.
    #[test]
    fn folders_are_those_of_the_version() {
        let paths = |name, version| Platform::named(name).unwrap().paths(version, "m");
        let v2 = |name| paths(name, FmiVersion::V2);
        assert_eq!(v2("x86_64-linux"), ["binaries/linux64/m.so"]);
        assert_eq!(v2("win32"), ["binaries/win32/m.dll"]);
        assert_eq!(v2("darwin64"), ["binaries/darwin64/m.dylib"]);
        assert_eq!(v2("aarch64-linux"), ["binaries/aarch64-linux/m.so"]);
        assert_eq!(
            v2("aarch64-darwin"),
            [
                "binaries/aarch64-darwin/m.dylib",
                "binaries/darwin64/m.dylib"
            ]
        );
        let v3 = |name| paths(name, FmiVersion::V3);
        assert_eq!(v3("linux64"), ["binaries/x86_64-linux/m.so"]);
        assert_eq!(v3("aarch64-darwin"), ["binaries/aarch64-darwin/m.dylib"]);
        let message = Platform::named("amiga").unwrap_err().to_string();
        assert!(message.contains("win64"), "{message}");
    }
}
