//! C99 sources in compilers that are not `cc`: clang, zig for other platforms, and fmpy's way with CMake.

use super::python;
use crate::sources::{compare, each, exported, stripped};
use pilotage::export::platform;
use pilotage::export::platform::Platform;
use std::path::Path;
use std::process::Command;

/// All warnings, as errors.
const WARNINGS: [&str; 6] = [
    "-std=c99",
    "-O2",
    "-Wall",
    "-Wextra",
    "-pedantic",
    "-Werror",
];

#[test]
fn clang_makes_libraries_with_the_results_of_the_binary() {
    if Command::new("clang").arg("--version").output().is_err() {
        eprintln!("NOT TESTED: there is no clang; `apt install clang` has it");
        return;
    }
    let cc: Vec<&str> = [&["clang"][..], &WARNINGS].concat();
    each(&cc, |name, fmus| compare(name, &fmus));
}

/// Libraries for four platforms, which are not run here: format, architecture and functions are those of the platform. That of
/// Windows is not linked, for which zig first compiles all of MinGW, a minute.
#[test]
fn zig_makes_libraries_for_four_platforms_without_a_warning() {
    let folder = crate::command::Folder::new();
    for (target, tuple) in [
        ("x86_64-linux-gnu.2.17", "x86_64-linux"),
        ("aarch64-linux-gnu.2.17", "aarch64-linux"),
        ("x86_64-windows-gnu", "x86_64-windows"),
        ("aarch64-macos", "aarch64-darwin"),
    ] {
        // Of the three models the one with delays, tables and all functions.
        let all = exported(&folder).into_iter();
        for (name, version, fmu) in all.filter(|(name, ..)| *name == "delayed") {
            let library = folder.path("library");
            let main = unpacked(&folder.path(&format!("{name}{version}")), &fmu);
            let mut zig = Command::new(python::compilers());
            let is_linked = !target.contains("windows");
            zig.args(["-m", "ziglang", "cc", "-target", target])
                .arg(if is_linked { "-shared" } else { "-c" })
                .args(WARNINGS);
            let output = zig
                .arg("-o")
                .arg(&library)
                .arg(main)
                .output()
                .expect("zig can be started");
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{target}, {name}: {said}");
            if !is_linked {
                continue;
            }
            let platform: Platform = platform::named(tuple).unwrap();
            let bytes = std::fs::read(&library).unwrap();
            platform::check(&platform, &bytes, version)
                .unwrap_or_else(|error| panic!("{target}, {name}: {error}"));
        }
    }
}

/// Writes the sources, and names the file to compile.
fn unpacked(folder: &Path, fmu: &[u8]) -> std::path::PathBuf {
    std::fs::create_dir_all(folder).unwrap();
    let mut main = None;
    for (name, content) in crate::export::files(fmu) {
        if let Some(name) = name.strip_prefix("sources/") {
            std::fs::write(folder.join(name), content).unwrap();
            main = main.or(name.ends_with(".c").then(|| folder.join(name)));
        }
    }
    main.expect("a file in C")
}

#[test]
fn fmpy_compiles_them_and_finds_nothing_wrong() {
    let folder = crate::command::Folder::new();
    let mut fmus = Vec::new();
    for (name, version, fmu) in exported(&folder) {
        let [binary, compiled] =
            ["binary", "fmpy"].map(|own| folder.path(&format!("{name}{version}-{own}.fmu")));
        std::fs::write(&binary, &fmu).unwrap();
        std::fs::write(&compiled, stripped(&fmu)).unwrap();
        fmus.push((name, [binary, compiled]));
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/compile.py");
    let mut command = Command::new(python::compilers());
    command
        .arg("-I")
        .arg(script)
        .args(fmus.iter().map(|(_, [_, compiled])| compiled));
    // CMake is beside the interpreter.
    let beside = python::compilers().parent().unwrap().to_owned();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let paths = std::iter::once(beside).chain(std::env::split_paths(&path));
    command.env("PATH", std::env::join_paths(paths).unwrap());
    let output = command.output().expect("Python can be started");
    let said = [output.stdout, output.stderr].map(|own| String::from_utf8_lossy(&own).into_owned());
    assert!(output.status.success(), "{said:?}");
    assert!(!said[1].contains("warning:"), "{}", said[1]);
    for (name, both) in fmus {
        compare(name, &both);
    }
}
