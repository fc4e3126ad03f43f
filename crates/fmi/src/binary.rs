//! A look into a shared library before it is loaded: a broken one must give an error and not take
//! the process with it.

use super::platform::host_processor;
use object::read::macho::{FatArch, MachOFatFile32};
use object::{Architecture, BinaryFormat, FileKind, Object, ObjectKind, ObjectSegment};
use std::collections::BTreeSet;
use thiserror::Error;

/// Why a library cannot be loaded on this machine.
#[derive(Debug, Error, PartialEq)]
pub enum BinaryError {
    /// Not an object file at all, or one whose headers are damaged.
    #[error("it is not a shared library")]
    NotAnObject(#[from] object::read::Error),
    /// An object file, but no shared library.
    #[error("it is an object of kind {0:?}, not a shared library")]
    NotShared(ObjectKind),
    /// A library of another operating system.
    #[error("it is a library in {found:?} format, this machine loads {expected:?}")]
    WrongFormat {
        /// Format of the file.
        found: BinaryFormat,
        /// Format of this machine.
        expected: BinaryFormat,
    },
    /// A library for another processor.
    #[error("it is made for {found:?}, this process runs on {expected:?}")]
    WrongArchitecture {
        /// Architecture of the file.
        found: Architecture,
        /// Architecture of this process.
        expected: Architecture,
    },
    /// The file ends before its segments do; loading it would crash.
    #[error("it is cut short: {found} bytes of at least {expected}")]
    Truncated {
        /// Size of the file \[bytes\].
        found: u64,
        /// End of the last segment \[bytes\].
        expected: u64,
    },
}

/// Checks that this process can load the library with these bytes.
///
/// # Errors
/// See [`BinaryError`].
pub fn check(bytes: &[u8]) -> Result<(), BinaryError> {
    // A universal library of macOS holds one for each architecture.
    if FileKind::parse(bytes)? == FileKind::MachOFat32 {
        let fat = MachOFatFile32::parse(bytes)?;
        let ours = fat
            .arches()
            .iter()
            .find(|a| Some(a.architecture()) == host_processor());
        return match (ours, fat.arches().first()) {
            (Some(arch), _) => check_thin(arch.data(bytes)?),
            (None, other) => Err(BinaryError::WrongArchitecture {
                found: other.map_or(Architecture::Unknown, FatArch::architecture),
                expected: host_processor().unwrap_or(Architecture::Unknown),
            }),
        };
    }
    check_thin(bytes)
}

/// The part of a universal library of macOS for a wanted architecture, else its first part; any other file
/// as it is.
///
/// # Errors
/// When the headers are damaged.
pub fn thin(
    bytes: &[u8],
    is_wanted: impl Fn(Architecture) -> bool,
) -> Result<&[u8], object::read::Error> {
    if FileKind::parse(bytes)? != FileKind::MachOFat32 {
        return Ok(bytes);
    }
    let fat = MachOFatFile32::parse(bytes)?;
    let arches = fat.arches();
    let wanted = arches.iter().find(|arch| is_wanted(arch.architecture()));
    match wanted.or(arches.first()) {
        Some(arch) => arch.data(bytes),
        None => Ok(bytes),
    }
}

/// Names in C of the functions that a library exports.
///
/// # Errors
/// When the table of symbols is damaged.
pub fn exported<'b>(file: &object::File<'b>) -> Result<BTreeSet<&'b [u8]>, object::read::Error> {
    let name = |export: &object::Export<'b>| match file.format() {
        // Mach-O puts an underscore before every symbol of C.
        BinaryFormat::MachO => export.name().strip_prefix(b"_").unwrap_or(export.name()),
        _ => export.name(),
    };
    Ok(file.exports()?.iter().map(name).collect())
}

fn check_thin(bytes: &[u8]) -> Result<(), BinaryError> {
    let file = object::File::parse(bytes)?;
    let expected = BinaryFormat::native_object();
    let found = match file.format() {
        BinaryFormat::Pe => BinaryFormat::Coff,
        format => format,
    };
    if found != expected {
        return Err(BinaryError::WrongFormat {
            found: file.format(),
            expected,
        });
    }
    // Where FMI has no name for this processor, the system's loader is asked.
    if let Some(expected) = host_processor()
        && file.architecture() != expected
    {
        return Err(BinaryError::WrongArchitecture {
            found: file.architecture(),
            expected,
        });
    }
    if file.kind() != ObjectKind::Dynamic {
        return Err(BinaryError::NotShared(file.kind()));
    }
    let ends = file
        .segments()
        .map(|s| s.file_range())
        .map(|(at, size)| at.saturating_add(size));
    let expected = ends.max().unwrap_or(0);
    match bytes.len() as u64 {
        found if found < expected => Err(BinaryError::Truncated { found, expected }),
        _ => Ok(()),
    }
}
