//! Platforms by name, and checks of libraries for them.

use super::ExportError;
use crate::fmi::binary;
use crate::fmi::description::FmiVersion;
pub use crate::fmi::platform::Platform;
use object::{Object, ObjectKind};
use pilotage_abi::{fmi2, fmi3};

/// Finds a platform by its name in either version of FMI.
///
/// # Errors
/// If there is none; the message lists the names.
pub fn named(name: &str) -> Result<Platform, ExportError> {
    Platform::of_folder(name).next().ok_or_else(|| {
        let names = Platform::ALL.iter().flat_map(|p| [p.tuple, p.fmi2[0]]);
        let mut known: Vec<&str> = names.collect();
        known.dedup();
        ExportError::UnknownPlatform {
            name: name.to_owned(),
            known: known.join(", "),
        }
    })
}

/// Names in FMI 2.0, or 3.0 where that has none.
pub fn names(platforms: &[Platform]) -> String {
    let names = platforms.iter().map(|platform| platform.fmi2[0]);
    names.collect::<Vec<_>>().join(", ")
}

/// A universal library of macOS (`mach-o/fat.h`): those of several processors in one file.
///
/// # Errors
/// If one of them is damaged.
pub fn universal(libraries: &[(Platform, &[u8])]) -> Result<Vec<u8>, ExportError> {
    /// Memory pages have 16 kB on Macs with ARM.
    const ALIGNMENT: u32 = 14;
    const HEADER: usize = 8;
    const ENTRY: usize = 20;
    let mut headers = [0xcafe_babe, libraries.len() as u32]
        .map(u32::to_be_bytes)
        .concat();
    let mut content = Vec::new();
    for (platform, bytes) in libraries {
        let wrong = || ExportError::WrongBinary {
            platform: platform.tuple,
            found: "it is cut short".into(),
        };
        // Another universal library may be among them.
        let bytes = binary::thin(bytes, |own| own == platform.architecture).map_err(|_| wrong())?;
        let processor: Vec<u8> = match bytes.get(4..12) {
            Some(words) => words
                .chunks(4)
                .flat_map(|word| word.iter().rev().copied())
                .collect(),
            None => return Err(wrong()),
        };
        let begin = HEADER + ENTRY * libraries.len() + content.len();
        let at = begin.next_multiple_of(1 << ALIGNMENT);
        content.resize(content.len() + at - begin, 0);
        content.extend_from_slice(bytes);
        headers.extend(processor);
        let words = [at as u32, bytes.len() as u32, ALIGNMENT];
        headers.extend(words.map(u32::to_be_bytes).concat());
    }
    headers.extend(content);
    Ok(headers)
}

/// Refuses a file that is no library for the platform with all functions of the version.
///
/// # Errors
/// If the format, the architecture or a function is wrong.
pub fn check(platform: &Platform, bytes: &[u8], version: FmiVersion) -> Result<(), ExportError> {
    let wrong = |found: String| ExportError::WrongBinary {
        platform: platform.tuple,
        found,
    };
    let bytes = binary::thin(bytes, |architecture| architecture == platform.architecture)
        .map_err(|error| wrong(error.to_string()))?;
    let file = object::File::parse(bytes).map_err(|error| wrong(error.to_string()))?;
    let made_for = (file.format(), file.architecture());
    if made_for != (platform.format, platform.architecture) {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// As another reader finds them: each part whole, at a memory page.
    #[test]
    fn a_universal_library_has_each_part() {
        use object::read::macho::{FatArch, MachOFatFile32};
        let thin = |processor: u32, length| {
            let mut bytes = vec![7; length];
            bytes[..4].copy_from_slice(&object::macho::MH_MAGIC_64.to_le_bytes());
            bytes[4..8].copy_from_slice(&processor.to_le_bytes());
            bytes
        };
        let intel = thin(object::macho::CPU_TYPE_X86_64, 20_001);
        let arm = thin(object::macho::CPU_TYPE_ARM64, 100);
        let [first, second] = ["x86_64-darwin", "aarch64-darwin"].map(|name| named(name).unwrap());
        let both = universal(&[(first, &intel), (second, &arm)]).unwrap();
        let fat = MachOFatFile32::parse(&*both).unwrap();
        for ((arch, part), platform) in fat.arches().iter().zip([&intel, &arm]).zip([first, second])
        {
            assert_eq!(arch.architecture(), platform.architecture);
            assert!(arch.data(&*both).unwrap() == part);
            assert_eq!(arch.file_range().0 % 0x4000, 0);
        }
        // It is taken apart where it is joined with others.
        assert!(universal(&[(first, &both), (second, &both)]).unwrap() == both);
        assert!(universal(&[(first, b"short")]).is_err());
    }

    /// FMI rule 18: folders of binaries.
    #[test]
    fn folders_are_those_of_the_version() {
        let paths = |name, version| named(name).unwrap().paths(version, "m");
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
        let message = named("amiga").unwrap_err().to_string();
        assert!(message.contains("win64"), "{message}");
    }
}
