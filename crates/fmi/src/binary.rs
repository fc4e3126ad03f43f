//! Checks a shared library before it is loaded: a damaged one must give an error and not crash the process.

use super::platform::host_processor;
use object::elf::{
    DT_FINI, DT_FINI_ARRAY, DT_FINI_ARRAYSZ, DT_GNU_HASH, DT_HASH, DT_INIT, DT_INIT_ARRAY,
    DT_INIT_ARRAYSZ, DT_JMPREL, DT_NEEDED, DT_NULL, DT_PLTRELSZ, DT_RELA, DT_RELACOUNT, DT_RELASZ,
    DT_RPATH, DT_RUNPATH, DT_SONAME, DT_STRSZ, DT_STRTAB, DT_SYMTAB, DT_VERDEF, DT_VERNEED,
    DT_VERSYM, PF_X, PT_LOAD,
};
use object::read::elf::{Dyn, ElfFile64, FileHeader, ProgramHeader};
use object::read::macho::{FatArch, MachOFatFile32};
use object::{Architecture, BinaryFormat, Endian, FileKind, Object, ObjectKind, ObjectSegment};
use std::collections::BTreeSet;
use thiserror::Error;

/// Why a library cannot be loaded on this machine.
#[derive(Debug, Error, PartialEq)]
pub enum BinaryError {
    /// Not an object file, or one with damaged headers.
    #[error("it is not a shared library")]
    NotAnObject(#[from] object::read::Error),
    /// An object file that is not a shared library.
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
    /// An entry of its dynamic section lies outside of the loaded segments; the loader would crash.
    #[error("its dynamic section is damaged: {what} lies outside of what is loaded")]
    Dynamic {
        /// An entry, by its name in the System V ABI, or the relocations.
        what: &'static str,
    },
}

/// Checks that this process can load the library with these bytes.
///
/// # Errors
/// See [`BinaryError`].
pub fn check(bytes: &[u8]) -> Result<(), BinaryError> {
    // A universal library of macOS contains one library per architecture.
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

/// The part of a universal library of macOS for the wanted architecture, else its first part; any other file unchanged.
///
/// # Errors
/// If the headers are damaged.
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

/// C names of the functions that a library exports.
///
/// # Errors
/// If the symbol table is damaged.
pub fn exported<'b>(file: &object::File<'b>) -> Result<BTreeSet<&'b [u8]>, object::read::Error> {
    let name = |export: &object::Export<'b>| match file.format() {
        // Mach-O prefixes every C symbol with an underscore.
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
    // If FMI has no name for this processor, the check is left to the system's loader.
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
        _ => match &file {
            object::File::Elf64(elf) => check_dynamic(elf, bytes),
            _ => Ok(()),
        },
    }
}

/// Length of the header of a 64-bit ELF file \[bytes\].
const FILE_HEADER: u64 = 64;

/// Checks what the Linux loader follows without validation: the tables that the dynamic section refers to (System V
/// ABI, chapter 5, "Dynamic Section"), and the targets of relocations.
fn check_dynamic(elf: &ElfFile64<'_>, bytes: &[u8]) -> Result<(), BinaryError> {
    let endian = elf.endian();
    let headers = elf.elf_header().program_headers(endian, bytes)?;
    let loaded: Vec<[u64; 2]> = (headers.iter())
        .filter(|header| header.p_type(endian) == PT_LOAD)
        .map(|header| {
            let begin = header.p_vaddr(endian);
            [begin, begin.saturating_add(header.p_memsz(endian))]
        })
        .collect();
    let is_loaded = |begin: u64, size: u64| {
        let end = begin.checked_add(size);
        end.is_some_and(|end| loaded.iter().any(|own| own[0] <= begin && end <= own[1]))
    };
    let mut dynamic = None;
    for header in headers {
        dynamic = dynamic.or(header.dynamic(endian, bytes)?);
    }
    let entries: Vec<(i64, u64)> = (dynamic.unwrap_or_default().iter())
        .map(|entry| (entry.d_tag(endian), entry.d_val(endian)))
        .take_while(|(tag, _)| *tag != DT_NULL)
        .collect();
    let value = |tag: i64| {
        let found = entries.iter().find(|(own, _)| *own == tag);
        found.map(|(_, value)| *value)
    };
    // Address, required alignment, and minimum size of a table: the value of another entry, or a number of bytes.
    type Size = Result<i64, u64>;
    let tables: [(&'static str, i64, u64, Size); 11] = [
        ("DT_STRTAB", DT_STRTAB, 1, Ok(DT_STRSZ)),
        ("DT_SYMTAB", DT_SYMTAB, 8, Err(24)),
        ("DT_RELA", DT_RELA, 8, Ok(DT_RELASZ)),
        ("DT_JMPREL", DT_JMPREL, 8, Ok(DT_PLTRELSZ)),
        ("DT_INIT_ARRAY", DT_INIT_ARRAY, 8, Ok(DT_INIT_ARRAYSZ)),
        ("DT_FINI_ARRAY", DT_FINI_ARRAY, 8, Ok(DT_FINI_ARRAYSZ)),
        ("DT_GNU_HASH", DT_GNU_HASH, 8, Err(16)),
        ("DT_HASH", DT_HASH, 4, Err(8)),
        ("DT_VERSYM", DT_VERSYM, 2, Err(2)),
        ("DT_VERNEED", DT_VERNEED, 4, Err(16)),
        ("DT_VERDEF", DT_VERDEF, 4, Err(20)),
    ];
    // The file header precedes all tables.
    let is_table = |at: u64, multiple: u64, size: u64| {
        at >= FILE_HEADER && at.is_multiple_of(multiple) && is_loaded(at, size)
    };
    for (what, tag, multiple, size) in tables {
        let size = size.map_or_else(|bytes| bytes, |size| value(size).unwrap_or(0));
        if value(tag).is_some_and(|at| !is_table(at, multiple, size)) {
            return Err(BinaryError::Dynamic { what });
        }
    }
    let is_code = |at: u64| {
        headers.iter().any(|header| {
            let offset = at.checked_sub(header.p_vaddr(endian));
            header.p_type(endian) == PT_LOAD
                && header.p_flags(endian) & PF_X != 0
                && offset.is_some_and(|offset| offset < header.p_memsz(endian))
        })
    };
    for (what, tag) in [("DT_INIT", DT_INIT), ("DT_FINI", DT_FINI)] {
        if value(tag).is_some_and(|at| at < FILE_HEADER || !is_code(at)) {
            return Err(BinaryError::Dynamic { what });
        }
    }
    let relocations = value(DT_RELASZ).unwrap_or(0);
    let relative = value(DT_RELACOUNT).unwrap_or(0);
    let of_calls = value(DT_PLTRELSZ).unwrap_or(0);
    if !relocations.is_multiple_of(24)
        || !of_calls.is_multiple_of(24)
        || relative > relocations / 24
    {
        return Err(BinaryError::Dynamic {
            what: "the end of the relocations",
        });
    }
    let names = [DT_NEEDED, DT_SONAME, DT_RPATH, DT_RUNPATH];
    let room = value(DT_STRSZ).unwrap_or(0);
    if (entries.iter()).any(|(tag, at)| names.contains(tag) && *at >= room) {
        return Err(BinaryError::Dynamic {
            what: "the name of a library",
        });
    }
    // The contents of a loaded table in the file.
    let in_file = |begin: u64, size: u64| {
        let own = headers.iter().find(|header| {
            let offset = begin.checked_sub(header.p_vaddr(endian));
            header.p_type(endian) == PT_LOAD
                && offset.is_some_and(|at| at.saturating_add(size) <= header.p_filesz(endian))
        })?;
        let at = own.p_offset(endian) + (begin - own.p_vaddr(endian));
        bytes
            .get(usize::try_from(at).ok()?..)?
            .get(..usize::try_from(size).ok()?)
    };
    for (tag, size) in [(DT_RELA, DT_RELASZ), (DT_JMPREL, DT_PLTRELSZ)] {
        let (Some(begin), Some(size)) = (value(tag), value(size)) else {
            continue;
        };
        // 24 bytes each, of which the first 8 are the target address.
        let all = in_file(begin, size).unwrap_or_default().chunks_exact(24);
        let places = all.map(|own| {
            let place: [u8; 8] = own[..8].try_into().unwrap_or_default();
            match endian.is_big_endian() {
                true => u64::from_be_bytes(place),
                false => u64::from_le_bytes(place),
            }
        });
        if places
            .into_iter()
            .any(|place| place != 0 && !is_loaded(place, 8))
        {
            return Err(BinaryError::Dynamic {
                what: "the place of a relocation",
            });
        }
    }
    Ok(())
}
