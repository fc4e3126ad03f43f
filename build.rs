//! Builds the shared libraries of exported FMUs, which this crate then embeds (`src/export/binary.rs`): an installed
//! `pilotage` exports FMUs without a compiler or further files. With `PILOTAGE_FMU_PLATFORMS` it embeds the libraries for all
//! platforms that are in that folder instead, where `scripts/platforms.py` has put them.
//!
//! This is a nested `cargo build` of two of the workspace's packages, in a separate target folder so that the
//! two cargo processes do not wait for each other's lock. It needs no network if the outer build needs none: both use
//! the same `Cargo.lock`, and it is locked.
//!
//! The library, the command and the Python module (`crates/python/build.rs`) run on older systems too.

#[path = "src/export/old_glibc.rs"]
mod old_glibc;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// What is embedded, and its file without the ending.
const PACKAGES: [(&str, &str); 2] = [
    ("pilotage-fmu", "pilotage_fmu"),
    ("pilotage-container", "pilotage_container"),
];
/// Folder of the libraries for all platforms.
const PLATFORMS: &str = "PILOTAGE_FMU_PLATFORMS";
/// The profile in Cargo.toml: optimised, stripped, and unwinding, so that panics can be caught.
const PROFILE: &str = "fmu";

fn main() {
    for input in [
        "build.rs",
        "src/export/old_glibc.rs",
        "src/export/old_glibc.c",
        "src/export/old_glibc_start.c",
        "Cargo.toml",
        "Cargo.lock",
        "fmu",
        "crates/cosim",
        "crates/fmi",
        "crates/linear",
        "crates/ode",
        "crates/process",
        "crates/series",
        "crates/units",
        "crates/text",
        "crates/expression",
        "crates/language",
    ] {
        println!("cargo::rerun-if-changed={input}");
    }
    let out = PathBuf::from(variable("OUT_DIR"));
    let target = variable("TARGET");
    let folder = target_folder(&out);
    let mut flags = portable_flags();
    if let Some(folder) = stand_ins(&out, &target) {
        let folder = folder.display();
        flags.push(format!("-Lnative={folder}"));
        println!("cargo::rustc-link-arg-bins=-L{folder}");
        println!("cargo::metadata=stand_ins={folder}");
    }
    println!("cargo::rerun-if-env-changed={PLATFORMS}");
    let platforms = env::var_os(PLATFORMS);
    if platforms.is_none() {
        build(&folder, &target, &flags);
    }
    for (package, file) in PACKAGES {
        let (own, all) = match &platforms {
            Some(platforms) => (None, Some(archive(Path::new(platforms), package))),
            None => {
                let built = folder.join(&target).join(PROFILE).join(library(file));
                (Some(built), None)
            }
        };
        embed(own, &out.join(format!("{package}.library")));
        embed(all, &out.join(format!("{package}.zip")));
    }
}

/// The archive of a package's libraries.
fn archive(platforms: &Path, package: &str) -> PathBuf {
    if !platforms.is_absolute() {
        fail(&format!(
            "{PLATFORMS} is {}; give the whole path",
            platforms.display()
        ));
    }
    let archive = platforms.join(format!("{package}.zip"));
    println!("cargo::rerun-if-changed={}", archive.display());
    if !archive.is_file() {
        fail(&format!(
            "{PLATFORMS} is {}, where there is no {package}.zip; python3 scripts/platforms.py makes it",
            platforms.display()
        ));
    }
    archive
}

/// Copies a file, or makes an empty one.
fn embed(file: Option<PathBuf>, embedded: &Path) {
    let written = match &file {
        Some(file) => fs::copy(file, embedded).map(drop),
        None => fs::write(embedded, []),
    };
    if let Err(error) = written {
        let file = file.unwrap_or_default();
        fail(&format!(
            "{} cannot be copied to {}: {error}",
            file.display(),
            embedded.display()
        ));
    }
}

/// `<target>/fmu`, from `<target>/<profile>/build/<package>/out`.
fn target_folder(out: &Path) -> PathBuf {
    match out.ancestors().nth(4) {
        Some(folder) => folder.join("fmu"),
        None => out.join("fmu"),
    }
}

fn build(folder: &Path, target: &str, flags: &[String]) {
    let mut command = Command::new(variable("CARGO"));
    command
        .args(["build", "--profile", PROFILE])
        .args(PACKAGES.map(|(package, _)| format!("--package={package}")))
        .args(["--locked", "--target", target, "--target-dir"])
        .arg(folder)
        .current_dir(variable("CARGO_MANIFEST_DIR"))
        // Lints belong to the outer build; a wrapper would only cause a second build.
        .env_remove("RUSTC_WORKSPACE_WRAPPER")
        .env_remove("CLIPPY_ARGS")
        .env("CARGO_ENCODED_RUSTFLAGS", flags.join("\x1f"));
    match command.status() {
        Ok(status) if status.success() => {}
        Ok(status) => fail(&format!(
            "the libraries of exported FMUs could not be built ({status}); the messages above say why. \
             To see them alone: cargo build -p pilotage-fmu -p pilotage-container --profile {PROFILE} --locked"
        )),
        Err(error) => fail(&format!("cargo could not be started: {error}")),
    }
}

/// The outer build's flags, without those that would keep the library from running on other machines, since FMUs are
/// distributed. Paths of this machine's sources are removed from the library too.
fn portable_flags() -> Vec<String> {
    let flags = env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default();
    let unportable = |flag: &str| {
        ["target-cpu", "target-feature", "instrument-coverage"]
            .iter()
            .any(|option| flag.trim_start_matches("-C").starts_with(option))
    };
    let mut kept: Vec<String> = Vec::new();
    for flag in flags.split('\x1f').filter(|flag| !flag.is_empty()) {
        if !unportable(flag) {
            kept.push(flag.to_owned());
        } else if !flag.starts_with("-C") && kept.last().is_some_and(|last| last == "-C") {
            kept.pop();
        }
    }
    let home = env::home_dir().map(|home| home.join(".cargo").into_os_string());
    let cargo = env::var_os("CARGO_HOME").or(home).unwrap_or_default();
    let places = [
        (cargo, "cargo"),
        (variable("CARGO_MANIFEST_DIR").into(), "pilotage"),
    ];
    for (folder, name) in places {
        kept.push(format!(
            "--remap-path-prefix={}={name}",
            Path::new(&folder).display()
        ));
    }
    kept
}

/// What to link with for older systems. If the linker's files are not as expected, what is built only runs on systems like this
/// one.
fn stand_ins(out: &Path, target: &str) -> Option<PathBuf> {
    if !(old_glibc::IS_HERE && target == old_glibc::TARGET) {
        return None;
    }
    let made = old_glibc::stand_ins(out).inspect_err(|error| {
        println!(
            "cargo::warning=exported FMUs, the command and the Python module will not run on systems older than this one: {error}"
        );
    });
    made.ok()
}

/// Name of a library on the target.
fn library(file: &str) -> String {
    match variable("CARGO_CFG_TARGET_OS").as_str() {
        "windows" => format!("{file}.dll"),
        "macos" => format!("lib{file}.dylib"),
        _ => format!("lib{file}.so"),
    }
}

/// Value of an environment variable of build scripts.
fn variable(name: &str) -> String {
    env::var(name).unwrap_or_else(|_| fail(&format!("cargo did not set {name}")))
}

fn fail(message: &str) -> ! {
    println!("cargo::error={message}");
    std::process::exit(1);
}
