//! Links libraries and programs such that they also run on old Linux systems.
//!
//! A library refers to each function of glibc in the newest version available when it was linked, and older systems
//! then refuse to load it. Therefore FMUs, the command and the Python module are linked against stand-ins for glibc's libraries,
//! which provide every function in its version of glibc 2.17 (2012; RHEL 7 and everything later). Newer functions are provided
//! without a version: they are used where available, as in Rust's standard library with `statx`. Functions that are always needed
//! are added ([`ADDED`]). The unwinder is added as a static library, so that `libgcc_s` is not required.
//!
//! This file is used both by the build script and by [`super::pack`].

use object::read::elf::ElfFile64;
use object::{Endianness, Object, ObjectSymbol, SymbolKind};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// Version number of glibc: major, minor.
type Version = Vec<u32>;

/// Newest glibc version that libraries may require.
const BASELINE: [u32; 2] = [2, 17];

/// The release that merged libpthread and libdl into libc.
const MERGED: [u32; 2] = [2, 34];

/// The libraries: the name at run time, and the file name of the stand-in for the linker.
const LIBRARIES: [(&str, &str); 5] = [
    ("libc.so.6", "libc-stand-in.so"),
    ("libpthread.so.0", "libpthread.so"),
    ("libdl.so.2", "libdl.so"),
    ("libm.so.6", "libm.so"),
    ("ld-linux-x86-64.so.2", "ld-stand-in.so"),
];

/// Functions that glibc 2.17 lacks: names and sources of the objects in a static library, of which only those are linked that
/// something asks for.
const ADDED: [(&str, &str); 2] = [
    ("functions", include_str!("old_glibc.c")),
    ("start", include_str!("old_glibc_start.c")),
];

/// That static library.
const LIBRARY: &str = "libadded.a";

/// A function or variable of a stand-in; without a version if glibc 2.17 does not have it.
struct Symbol {
    name: String,
    version: Option<Version>,
    is_data: bool,
}

/// The rustc target for which the stand-ins are used.
pub const TARGET: &str = "x86_64-unknown-linux-gnu";

/// Whether this machine has that target: the stand-ins are made from its libraries.
pub const IS_HERE: bool = cfg!(all(
    target_os = "linux",
    target_env = "gnu",
    target_arch = "x86_64"
));

/// The folder in which the linker finds the stand-ins. It lies in this one, and is made if it does not exist.
///
/// # Errors
/// If the C compiler with which Rust links is missing or does not find its libraries.
pub fn stand_ins(within: &Path) -> Result<PathBuf, String> {
    let folder = within.join("glibc-2.17");
    if !folder.exists() {
        // Other processes may do the same concurrently, so the folder appears only when complete.
        let (process, thread) = (std::process::id(), std::thread::current().id());
        let new = folder.with_added_extension(format!("{process}-{thread:?}"));
        let made = make(&new, &folder);
        if made.is_ok() {
            // If another process was faster, its folder has the same content.
            let _ = fs::rename(&new, &folder);
        }
        let _ = fs::remove_dir_all(&new);
        made?;
    }
    Ok(folder)
}

/// Creates the stand-ins in `folder`, which will be renamed to `named`.
fn make(folder: &Path, named: &Path) -> Result<(), String> {
    fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut stand_ins: BTreeMap<&str, Vec<Symbol>> = BTreeMap::new();
    for (library, _) in LIBRARIES {
        for (home, symbol) in symbols(library)? {
            stand_ins.entry(home).or_default().push(symbol);
        }
    }
    for (library, file) in LIBRARIES {
        let symbols = stand_ins.remove(library).unwrap_or_default();
        link(folder, library, file, &symbols)?;
    }
    add(folder)?;
    // Linker scripts, as glibc's own libc.so. What is added comes first, and hides what the stand-in has of the same name.
    let [added, libc, threads, loader] = [
        LIBRARY,
        "libc-stand-in.so",
        "libpthread.so",
        "ld-stand-in.so",
    ]
    .map(|file| format!("\"{}\"", named.join(file).display()));
    let rest = known("libc_nonshared.a")?;
    let libc = format!(
        "GROUP ( {added} {libc} \"{}\" AS_NEEDED ( {loader} {threads} ) )\n",
        rest.display()
    );
    let unwinder = format!("GROUP ( \"{}\" )\n", known("libgcc_eh.a")?.display());
    write(&folder.join("libc.so"), &libc)?;
    write(&folder.join("libgcc_s.so"), &unwinder)
}

/// The symbols provided by a library of this system, each with its library on old systems.
fn symbols(library: &'static str) -> Result<Vec<(&'static str, Symbol)>, String> {
    let path = known(library)?;
    let unreadable = |error: String| format!("{}: {error}", path.display());
    let bytes = fs::read(&path).map_err(|error| unreadable(error.to_string()))?;
    let file = ElfFile64::<Endianness>::parse(&*bytes).map_err(|e| unreadable(e.to_string()))?;
    let versions = file
        .elf_section_table()
        .versions(file.endian(), file.data());
    let versions = (versions.map_err(|e| unreadable(e.to_string()))?)
        .ok_or_else(|| unreadable("it has no symbol versions".to_owned()))?;
    let mut offered: BTreeMap<&str, (BTreeSet<Version>, bool)> = BTreeMap::new();
    for symbol in file.dynamic_symbols().filter(|s| !s.is_undefined()) {
        let index = versions.version_index(file.endian(), symbol.index());
        let version = versions.version(index).ok().flatten();
        let version = version.and_then(|version| parsed(version.name()));
        // Versions themselves are also listed as symbols.
        let name = symbol.name().ok().filter(|n| !n.starts_with("GLIBC_"));
        if let (Some(version), Some(name)) = (version, name) {
            let (versions, is_data) = offered.entry(name).or_default();
            versions.insert(version);
            *is_data |= symbol.kind() == SymbolKind::Data;
        }
    }
    let symbol = |(name, (versions, is_data)): (&str, (BTreeSet<Version>, bool))| {
        let version = versions.range(..=BASELINE.to_vec()).next_back().cloned();
        let moved = version.is_some() && versions.contains(&MERGED[..]);
        let home = match name {
            _ if !moved => library,
            _ if name.starts_with("dl") => "libdl.so.2",
            _ if name.starts_with("pthread_") || name.starts_with("sem_") => "libpthread.so.0",
            _ => library,
        };
        let name = name.to_owned();
        (
            home,
            Symbol {
                name,
                version,
                is_data,
            },
        )
    };
    Ok(offered.into_iter().map(symbol).collect())
}

/// Parses `2.17` from `GLIBC_2.17`; `None` for `GLIBC_PRIVATE`.
fn parsed(version: &[u8]) -> Option<Version> {
    let numbers = std::str::from_utf8(version).ok()?.strip_prefix("GLIBC_")?;
    numbers
        .split('.')
        .map(|number| number.parse().ok())
        .collect()
}

/// Links a stand-in, which has only symbols and no code.
fn link(folder: &Path, library: &str, file: &str, symbols: &[Symbol]) -> Result<(), String> {
    let named = |version: &Version| {
        let numbers: Vec<String> = version.iter().map(u32::to_string).collect();
        format!("GLIBC_{}", numbers.join("."))
    };
    let mut assembly = String::from(".text\n");
    for (i, symbol) in symbols.iter().enumerate() {
        let Symbol {
            name,
            version,
            is_data,
        } = symbol;
        let kind = if *is_data { "object" } else { "function" };
        let label = version
            .as_ref()
            .map_or(name.clone(), |_| format!("stand_in_{i}"));
        assembly += &format!(".globl {label}\n.type {label},@{kind}\n{label}: .byte 0\n");
        if let Some(version) = version {
            assembly += &format!(".symver {label}, {name}@@{}\n", named(version));
        }
    }
    let versions: BTreeSet<_> = symbols.iter().filter_map(|s| s.version.as_ref()).collect();
    let nodes = versions
        .iter()
        .map(|version| format!("{} {{ local: stand_in_*; }};\n", named(version)));
    let [source, map] =
        ["s", "map"].map(|extension| folder.join(library).with_added_extension(extension));
    write(&source, &assembly)?;
    write(&map, &nodes.collect::<String>())?;
    let mut linked = Command::new(compiler());
    linked
        .args(["-shared", "-nostdlib"])
        .arg(format!("-Wl,-soname,{library}"))
        .arg(format!("-Wl,--version-script={}", map.display()))
        .arg(&source)
        .arg("-o")
        .arg(folder.join(file));
    done(&mut linked, &format!("the stand-in for {library}"))
}

/// Makes the static library of what is added.
fn add(folder: &Path) -> Result<(), String> {
    let archiver = asked("-print-prog-name=ar")?;
    let mut archive = Command::new(&archiver);
    archive.arg("rcs").arg(folder.join(LIBRARY));
    for (name, text) in ADDED {
        let [source, object] = ["c", "o"].map(|own| folder.join(name).with_extension(own));
        write(&source, text)?;
        let mut compile = Command::new(compiler());
        compile.args(["-O2", "-fPIC", "-g0", "-c"]).arg(&source);
        done(compile.arg("-o").arg(&object), name)?;
        archive.arg(object);
    }
    done(&mut archive, LIBRARY)
}

/// Runs a command that makes something.
fn done(command: &mut Command, what: &str) -> Result<(), String> {
    let output = command
        .output()
        .map_err(|error| not_started(command.get_program(), &error))?;
    match output.status.success() {
        true => Ok(()),
        false => Err(format!(
            "{what} could not be made: {}",
            String::from_utf8_lossy(&output.stderr)
        )),
    }
}

/// Path at which the C compiler finds a library.
fn known(file: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(asked(&format!("-print-file-name={file}"))?);
    // The compiler prints the name of an unknown file unchanged.
    match path.is_absolute() {
        true => Ok(path),
        false => Err(format!("the C compiler does not know {file}")),
    }
}

/// The C compiler's answer to a question.
fn asked(question: &str) -> Result<String, String> {
    let answer = Command::new(compiler()).arg(question).output();
    let answer = answer.map_err(|error| not_started(&compiler(), &error))?;
    Ok(String::from_utf8_lossy(&answer.stdout).trim().to_owned())
}

/// The C compiler with which Rust links.
fn compiler() -> OsString {
    env::var_os("RUSTC_LINKER").unwrap_or_else(|| "cc".into())
}

fn not_started(program: &OsStr, error: &std::io::Error) -> String {
    format!("{} cannot be started: {error}", program.display())
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}
